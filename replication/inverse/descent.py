"""How a setting gets nearer to printed numbers: by Gauss-Newton steps, and by moving one unknown at a time anywhere.

All settings fly with the same noise, so that two of them differ by what they are, and numbers are smooth functions of
the settings nearly everywhere. Some unknowns act on a group of numbers alone, as a filter's process noise on its
columns: they are moved together, and each group keeps its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.bank import Paper
from replication.inverse.prior import Unknown
from replication.inverse.table import Number, compared

RUNS = 4
FREEDOM = 4.0
"""Degrees of freedom of the Student t by which residuals count: a number that can't be met must not decide the rest."""
MODEL = 0.03
"""What a number may be off by short flights and long steps, on the scale on which numbers are compared."""
INCREMENT = 0.01
"""Of uniform numbers, for derivatives."""
DAMPINGS = (1.0, 10.0, 100.0, 1000.0, 10_000.0)
"""Of a step, in inverse variances of uniform numbers: a prior of 1/12 has 12."""
SHIFT = 0.1
"""Standard deviation of uniform numbers by which all groups' own unknowns are moved at once."""
PLACES, COMBINED, TRIED = 6, 5, 48
"""How many values of an unknown are tried, changes of single unknowns together, and changes of several at once."""


@dataclass(frozen=True)
class Sought:
    """What settings are compared with.

    Attributes:
        paper: Whose numbers they are.
        printed: The numbers, (numbers,).
        seed: Seed of the noise of all flights.
    """

    paper: Paper
    printed: Array
    seed: int

    def flown(self, u: Array) -> Looked:
        """Return what settings u (n, unknowns) give."""
        numbers = self.paper.flown(u, [[self.seed, 2]] * len(u), RUNS)
        return looked(self.paper.numbers, numbers, self.printed)

    def at(self, u: Array) -> Place:
        """Return the place of a setting (unknowns,)."""
        return Place(u, self.flown(u[None]).misfit[0], 1)


@dataclass(frozen=True)
class Looked:
    """Numbers of settings on the scale on which they are compared.

    Attributes:
        off: Printed less mean, (n, numbers).
        sigma: Standard deviation of a printed number about that mean, (n, numbers).
    """

    off: Array
    sigma: Array

    @property
    def misfit(self) -> Array:
        """-2 log likelihood of each number, (n, numbers)."""
        each = distance(self.off / self.sigma) + 2 * np.log(self.sigma)
        return np.where(np.isfinite(each), each, 1e3)


def looked(numbers: Sequence[Number], flown: Array, printed: Array) -> Looked:
    """Return how settings that gave these numbers (n, runs, numbers) look beside the printed ones."""
    scale = compared(flown, numbers)
    digits = np.array([number.digit for number in numbers])
    rounding = (compared(printed + digits / 2, numbers) - compared(printed - digits / 2, numbers)) / np.sqrt(12)
    sigma = np.sqrt(scale.var(axis=1, ddof=1) * (1 + 1 / flown.shape[1]) + rounding**2 + MODEL**2)
    return Looked(compared(printed, numbers) - scale.mean(axis=1), sigma)


def distance(residual: Array) -> Array:
    """Return what residuals in units of scatter count for: squares as long as they are small."""
    return np.asarray((FREEDOM + 1) * np.log1p(residual**2 / FREEDOM))


@dataclass(frozen=True)
class Place:
    """A setting and how badly it gives each number.

    Attributes:
        u: Its uniform numbers, (unknowns,).
        misfit: That of each number, (numbers,).
        flown: How many settings have been flown until it was found.
    """

    u: Array
    misfit: Array
    flown: int

    @property
    def total(self) -> float:
        """The sum of the misfits."""
        return float(self.misfit.sum())


def stepped(sought: Sought, here: Place) -> Place:
    """Return the best of some Gauss-Newton steps from here, or this place (Nocedal and Wright, 2006, section 10.3).

    Residuals are weighted as the Student t has it (Lange, Little and Taylor, J. American Statistical Association
    84(408), 1989); a step is damped as by Levenberg and Marquardt.
    """
    paper = sought.paper
    own, common = _own(paper), _common(paper)
    sign = np.where(here.u < 0.5, 1.0, -1.0)
    tried = np.repeat(here.u[None], 1 + len(common) + own.shape[1], axis=0)
    for row, place in enumerate(common, 1):
        tried[row, place] += INCREMENT * sign[place]
    for row, places in enumerate(own.T, 1 + len(common)):
        tried[row, places] += INCREMENT * sign[places]
    seen = sought.flown(tried)
    change = -(seen.off[1:] - seen.off[0]) / INCREMENT
    J = np.zeros((len(here.misfit), len(here.u)))
    J[:, common] = change[: len(common)].T * sign[common]
    for numbers, unknowns in paper.groups:
        for k, place in enumerate(unknowns):
            J[numbers, place] = change[len(common) + k, numbers] * sign[place]
    r = seen.off[0] / seen.sigma[0]
    weight = (FREEDOM + 1) / (FREEDOM + r**2) / seen.sigma[0] ** 2
    N, g = J.T @ (weight[:, None] * J), J.T @ (weight * seen.off[0])
    steps = [np.linalg.solve(N + damping * np.eye(len(N)), g) for damping in DAMPINGS]
    candidates = _inside(here.u + np.array(steps))
    return _best(sought, here, candidates, here.flown + len(tried))


def swept(sought: Sought, here: Place) -> Place:
    """Return the best place found by moving single unknowns across their whole range, and the best moves together."""
    paper = sought.paper
    if paper.groups:
        here = _with_own_swept(sought, here)
    moves = [(place, value) for place in _common(paper) for value in representatives(paper.unknowns[place])]
    tried = np.repeat(here.u[None], len(moves), axis=0)
    for row, (place, value) in enumerate(moves):
        tried[row, place] = value
    total = sought.flown(paper.apart(tried)).misfit.sum(axis=1)
    chosen: dict[int, float] = {}
    for row in np.argsort(total, kind="stable"):
        if total[row] < here.total and len(chosen) < COMBINED:
            chosen.setdefault(*moves[row])
    together = np.repeat(here.u[None], len(chosen), axis=0)
    for row, (place, value) in enumerate(chosen.items()):
        together[row:, place] = value
    return _best(sought, here, together, here.flown + len(moves))


def shuffled(sought: Sought, here: Place, rng: np.random.Generator) -> Place:
    """Return the best of `TRIED` places at which several unknowns have other values, or this one.

    One to four common unknowns have values from anywhere; every other time those that act on one group alone are all
    moved by the same normal step as well.
    """
    tried = np.repeat(here.u[None], TRIED, axis=0)
    common, own = _common(sought.paper), _own(sought.paper)
    for row in tried:
        moved = rng.choice(common, size=min(int(rng.integers(1, 5)), len(common)), replace=False)
        row[moved] = rng.random(len(moved))
        row[own.ravel()] += SHIFT * rng.integers(2) * rng.standard_normal()
    return _best(sought, here, _inside(tried), here.flown)


def _with_own_swept(sought: Sought, here: Place) -> Place:
    """Return a place where each group has the best of many values of the unknowns that act on it alone."""
    paper = sought.paper
    u, misfit = here.u.copy(), here.misfit.copy()
    own = _own(paper)
    values = [representatives(paper.unknowns[place]) for place in own[0]]
    pairs = np.stack(np.meshgrid(*values, indexing="ij"), axis=-1).reshape(-1, own.shape[1])
    tried = np.repeat(u[None], len(pairs), axis=0)
    for unknowns in own:
        tried[:, unknowns] = pairs
    found = sought.flown(tried).misfit
    for numbers, unknowns in paper.groups:
        kept = int(np.argmin(found[:, numbers].sum(axis=1)))
        if found[kept, numbers].sum() < misfit[numbers].sum():
            u[unknowns], misfit[numbers] = tried[kept, unknowns], found[kept, numbers]
    return Place(u, misfit, here.flown + len(tried))


def representatives(unknown: Unknown) -> Array:
    """Return uniform numbers that give values of all kinds that an unknown has: each choice, or six over its range."""
    grid = (np.arange(60) + 0.5) / 60
    first = np.sort(np.unique(unknown.law(grid), return_index=True)[1])
    return np.asarray(grid[first[np.unique(np.linspace(0, len(first) - 1, PLACES).round().astype(int))]])


def _best(sought: Sought, here: Place, candidates: Array, flown: int) -> Place:
    if not len(candidates):
        return Place(here.u, here.misfit, flown)
    found = sought.flown(sought.paper.apart(candidates)).misfit
    kept = int(np.argmin(found.sum(axis=1)))
    flown += len(candidates)
    if found[kept].sum() < here.total:
        return Place(sought.paper.apart(candidates)[kept], found[kept], flown)
    return Place(here.u, here.misfit, flown)


def _own(paper: Paper) -> Indices:
    """Return the unknowns that act on one group alone, (groups, each)."""
    return np.array([unknowns for _, unknowns in paper.groups], dtype=int).reshape(len(paper.groups), -1)


def _common(paper: Paper) -> Indices:
    return np.setdiff1d(np.arange(len(paper.unknowns)), _own(paper))


def _inside(u: Array) -> Array:
    return np.clip(u, 0.0, 1 - 1e-9)
