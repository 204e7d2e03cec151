"""The nearest least misfit: Fisher scoring, damped as by Levenberg and Marquardt.

Printed numbers have a Student t distribution whose location and scale both depend on the setting. With off = z - m,
r = off / s and weight w = (nu + 1) / (nu + r^2), half the gradient of -2 log likelihood is
-Jm' (w r / s) + Js' (1 - w r^2), where Jm is the Jacobian of m and Js that of log s, and its expected half curvature is
(nu + 1) / (nu + 3) Jm' s^-2 Jm + 2 nu / (nu + 3) Js' Js (Lange, Little and Taylor, J. American Statistical Association
84(408), 1989, appendix B). Unknowns at an end of their range that would leave it stay there, as in projected Newton
methods (Bertsekas, SIAM J. Control and Optimization 20(2), 1982); angles go round.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Indices, Mask
from replication.inverse.bank import Paper
from replication.inverse.misfit import FREEDOM, Place, Sought

INCREMENT = 0.01
"""Of uniform numbers, for derivatives."""
FIRST, WIDER, WIDEST = 10.0, 30.0, 1e5
"""Damping at first, in inverse variances of uniform numbers (a prior of 1/12 has 12); the factor between the dampings
that are tried at a time; and the damping at which there is nothing left to gain."""


def scored(sought: Sought, here: Place, steps: int, enough: float) -> Place:
    """Return the place to which steps lead from here.

    Args:
        sought: What is sought.
        here: Where they begin.
        steps: How many there are at most.
        enough: A step that lowers the misfit by less is the last.
    """
    wraps = np.array([unknown.wraps for unknown in sought.paper.unknowns])
    damping = FIRST
    for _ in range(steps):
        g, N = _gradient_and_curvature(sought, here)
        free = wraps | ~(((here.u <= 0) & (g > 0)) | ((here.u >= 1 - 2e-9) & (g < 0)))
        dampings = damping * np.array([1 / WIDER, 1.0, WIDER])
        tried = np.repeat(here.u[None], len(dampings), axis=0)
        for row, each in zip(tried, dampings, strict=True):
            row[free] -= np.linalg.solve(N[np.ix_(free, free)] + each * np.eye(free.sum()), g[free])
        misfit = sought.look(inside(sought.paper, tried)).misfit
        kept = int(np.argmin(misfit.sum(axis=1)))
        fall = here.total - float(misfit[kept].sum())
        if fall > 0:
            here, damping = Place(inside(sought.paper, tried)[kept], misfit[kept]), max(float(dampings[kept]), 0.01)
        else:
            damping *= WIDER**2
        if 0 < fall < enough or damping > WIDEST:
            break
    return here


def inside(paper: Paper, u: Array) -> Array:
    """Return settings (n, unknowns) with each uniform number in [0, 1): angles go round, others stop at the end."""
    wraps = np.array([unknown.wraps for unknown in paper.unknowns])
    return np.where(wraps, u % 1.0, np.clip(u, 0.0, 1 - 1e-9))


def own_unknowns(paper: Paper) -> Indices:
    """Return the unknowns that act on one group of numbers alone, (groups, each)."""
    return np.array([unknowns for _, unknowns in paper.groups], dtype=int).reshape(len(paper.groups), -1)


def common_unknowns(paper: Paper) -> Indices:
    """Return the unknowns that act on more than one group of numbers."""
    return np.setdiff1d(paper.acting, own_unknowns(paper))


def _gradient_and_curvature(sought: Sought, here: Place) -> tuple[Array, Array]:
    """Return half the gradient, (unknowns,), and half the expected curvature, (unknowns, unknowns)."""
    paper = sought.paper
    change = np.where(here.u < 0.5, INCREMENT, -INCREMENT)
    moves = [np.array([place]) for place in common_unknowns(paper)] + list(own_unknowns(paper).T)
    moves = [places for places in moves if _differs(paper, here.u, here.u + change)[places].any()]
    tried = np.repeat(here.u[None], 1 + len(moves), axis=0)
    for row, places in enumerate(moves, 1):
        tried[row, places] += change[places]
    seen = sought.look(tried)
    Jm, Js = np.zeros((2, len(here.misfit), len(here.u)))
    for row, places in enumerate(moves, 1):
        for place in places:
            acted = _acted(paper, place, len(here.misfit))
            Jm[acted, place] = ((seen.off[0] - seen.off[row]) / change[place])[acted]
            Js[acted, place] = (np.log(seen.sigma[row] / seen.sigma[0]) / change[place])[acted]
    s, nu = seen.sigma[0], FREEDOM
    r = seen.off[0] / s
    w = (nu + 1) / (nu + r**2)
    g = -Jm.T @ (w * r / s) + Js.T @ (1 - w * r**2)
    Jm /= s[:, None]
    return g, (nu + 1) / (nu + 3) * Jm.T @ Jm + 2 * nu / (nu + 3) * Js.T @ Js


def _differs(paper: Paper, u: Array, v: Array) -> Mask:
    """Return for which unknowns two settings have different values, (unknowns,)."""
    pairs = zip(paper.unknowns, u, v, strict=True)
    return np.array([not unknown.choices and unknown.law(a) != unknown.law(b) for unknown, a, b in pairs])


def _acted(paper: Paper, place: int, count: int) -> Indices:
    """Return the numbers on which an unknown acts, of so many."""
    own = [numbers for numbers, unknowns in paper.groups if place in unknowns]
    return own[0] if own else np.arange(count)
