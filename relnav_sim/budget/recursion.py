"""What each source leaves in a filter's error: one recursion of a covariance or a mean, batched over the sources."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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

    The covariance of [e; s] in its blocks P = E[e e^T], c = E[e s] and v = E[s^2]: with M = A F and the column g of G,
    P <- M P M^T + M c phi g^T + g (M c phi)^T + v g g^T and c <- phi M c + v g (Maybeck, Stochastic Models, Estimation,
    and Control 1, 1979, section 6.8).
    """
    S, (T, n) = len(sources), filter.left_out.shape
    g = _columns(filter, [one.column for one in sources])
    phi = np.array([one.phi for one in sources])[:, None]
    v = np.square([one.sigma for one in sources])[:, None]
    P = v[:, :, None] * g[0][:, :, None] * g[0][:, None]
    P += np.stack([np.zeros((n, n)) if one.start is None else one.start for one in sources]) if S else 0.0
    c = v * g[0]
    found = np.empty((T, S, states))
    found[0] = _leading(P, states)
    for k in range(1, T):
        M = filter.transition[k]
        c = phi * (c @ M.T)
        # P + h g^T + g h^T with h = M c + v g / 2 holds both cross terms and v g g^T.
        cross = (c + 0.5 * v * g[k])[:, :, None] * g[k][:, None]
        P = M @ P @ M.T + cross + cross.swapaxes(1, 2)
        c = c + v * g[k]
        found[k] = _leading(P, states)
    return np.ascontiguousarray(found.swapaxes(0, 1))


def means(filter: LinearFilter, sources: Sequence[FixedSourceOfError], states: int = 6) -> Array:
    """Return the errors of the leading states that each source is, (S, T, states)."""
    S, (T, n) = len(sources), filter.left_out.shape
    value = np.array([one.value for one in sources])[:, None]
    b = _columns(filter, [one.column for one in sources]) * value
    pushed = -np.einsum("kij,kj->ki", filter.kept, filter.left_out)
    for s, one in enumerate(sources):
        if one.left_out:
            b[1:, s] += pushed[1:]
    m = b[0] + (np.stack([np.zeros(n) if one.start is None else one.start for one in sources]) if S else 0.0)
    found = np.empty((T, S, states))
    found[0] = m[:, :states]
    for k in range(1, T):
        m = m @ filter.transition[k].T + b[k]
        found[k] = m[:, :states]
    return np.ascontiguousarray(found.swapaxes(0, 1))


def _columns(filter: LinearFilter, columns: Sequence[int | None]) -> Array:
    """Return the columns of G, (T, S, n); zeros for None."""
    found = np.zeros((len(filter.response), len(columns), filter.response.shape[1]))
    for s, column in enumerate(columns):
        if column is not None:
            found[:, s] = filter.response[:, :, column]
    return found


def _leading(P: Array, states: int) -> Array:
    return np.einsum("sii->si", P)[:, :states]
