"""What each source leaves in a filter's error: one recursion of a covariance or a mean, batched over the sources."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.budget.linearised import LinearFilter


@dataclass(frozen=True)
class RandomSourceOfError:
    """A source that each run draws anew, with a number s of its own: s_k = phi s_{k-1} + eta_k, stationary.

    Attributes:
        name: What it is called.
        column: Which injection it is; None: none, it is in the start alone.
        phi: 0 for white noise, 1 for a number that a run keeps.
        sigma: Standard deviation of s, in units of the injection.
        start: Covariance of the start's error that it brings by itself, (n, n); None: none.
        size: Its standard deviation, in `unit`.
        unit: Of the size; ``sigma`` where it is drawn as a number of its own.
    """

    name: str
    column: int | None
    phi: float
    sigma: float
    start: Array | None = None
    size: float = 1.0
    unit: str = "sigma"


@dataclass(frozen=True)
class FixedSourceOfError:
    """A source that is the same in every run.

    Attributes:
        name: What it is called.
        column: Which injection it is; None: none.
        value: Of the injection.
        start: The start's error that it is, (n,); None: none.
        left_out: Whether it is what the dynamics leave out.
        size: Its absolute value, in `unit`.
        unit: Of the size; ``whole`` where it is no number.
    """

    name: str
    column: int | None = None
    value: float = 0.0
    start: Array | None = None
    left_out: bool = False
    size: float = 1.0
    unit: str = "whole"


def variances(filter: LinearFilter, sources: Sequence[RandomSourceOfError], states: int = 6) -> Array:
    """Return the variances of the leading states that each source leaves, (S, T, states).

    By the covariance of [e; s] in its blocks (Maybeck, Stochastic Models, Estimation, and Control 1, 1979, section
    6.8).
    """
    g = _columns(filter, [one.column for one in sources])
    v = np.square([one.sigma for one in sources])
    P0 = v[:, None, None] * g[:, 0, :, None] * g[:, 0, None]
    for P, one in zip(P0, sources, strict=True):
        P += 0.0 if one.start is None else one.start
    phi = np.array([one.phi for one in sources], dtype=float)
    return _leading(kernels.budget.variances(filter.transition, g, phi, v, P0), states)


def means(filter: LinearFilter, sources: Sequence[FixedSourceOfError], states: int = 6) -> Array:
    """Return the errors of the leading states that each source is, (S, T, states)."""
    value = np.array([one.value for one in sources])
    b = _columns(filter, [one.column for one in sources]) * value[:, None, None]
    m0 = b[:, 0].copy()
    pushed = -np.einsum("kij,kj->ki", filter.kept, filter.left_out)
    for s, one in enumerate(sources):
        m0[s] += 0.0 if one.start is None else one.start
        if one.left_out:
            b[s] += pushed
    return _leading(kernels.budget.means(filter.transition, b, m0), states)


def _columns(filter: LinearFilter, columns: Sequence[int | None]) -> Array:
    """Return the columns of G, (S, T, N); zeros for None."""
    T, N, _ = filter.response.shape
    found = np.zeros((len(columns), T, N))
    for s, column in enumerate(columns):
        if column is not None:
            found[s] = filter.response[:, :, column]
    return found


def _leading(found: Array, states: int) -> Array:
    return np.ascontiguousarray(found[:, :, :states])
