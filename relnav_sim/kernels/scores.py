"""What whitened residuals say: NIS and likelihood, and whether their covariance leaves digits to an update."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.kernels.compiling import inner
from relnav_sim.kernels.elementary import log

WIDE = 1e6
"""Ratio of S to R, on the diagonal, from which on the short form of the covariance is not trusted."""
WIDEST = 1e12
"""The same of Joseph's form; S itself keeps four digits of R then."""
SINGULAR = 1e-12
"""Share of S that a pivot of its factor must keep, or S is as good as singular."""
_LOG_TWO_PI = math.log(2 * math.pi)


@inner
def score(w: Array, L: Array, first: int, used: int, nis: Array, log_likelihood: Array) -> None:
    """Set NIS and log-likelihood of the runs from `first` on by their whitened residuals w = L^-1 nu, (k, LANES).

    The residuals are lost: their place is taken by logarithms, which are computed side by side only by themselves.
    """
    for b in range(used):
        nis[first + b], log_likelihood[first + b] = 0.0, 0.0
    for i in range(len(w)):
        for b in range(used):
            nis[first + b] += w[i, b] * w[i, b]
        for b in range(used):
            w[i, b] = log(np.float64(L[i, i, b]))
        for b in range(used):
            log_likelihood[first + b] += w[i, b]
    for b in range(used):
        log_likelihood[first + b] = -0.5 * (nis[first + b] + len(w) * _LOG_TWO_PI + 2 * log_likelihood[first + b])


@inner
def log_determinant(L: Array, b: int) -> float:
    """Return log det(L L^T) of lane b."""
    total = 0.0
    for i in range(len(L)):
        total += math.log(L[i, i, b])
    return 2 * total


@inner
def doubtful(S: Array, R: Array, L: Array, used: int) -> bool:
    """Return whether any lane may be `singular`, or is `WIDE`; nearly always none is, and this is sooner told."""
    found = False
    for i in range(len(S)):
        for b in range(used):
            sound = L[i, i, b] * L[i, i, b] > SINGULAR * S[i, i, b]
            found |= not (sound and S[i, i, b] <= WIDE * R[i, i, b])
    return found


@inner
def exceeds(S: Array, R: Array, b: int, ratio: float) -> bool:
    """Return whether S is so many times as wide as R in any channel of lane b."""
    found = False
    for i in range(len(S)):
        found |= S[i, i, b] > ratio * R[i, i, b]
    return found


@inner
def singular(S: Array, L: Array, b: int) -> bool:
    """Return whether S of lane b, where it is finite, is as good as singular: a pivot of L is next to nothing."""
    sound, total = True, 0.0
    for i in range(len(S)):
        # Written so that a pivot that is not a number counts.
        sound &= L[i, i, b] * L[i, i, b] > SINGULAR * S[i, i, b]
        for j in range(len(S)):
            total += S[i, j, b]
    return not sound and math.isfinite(total)


@inner
def loses(S: Array, R: Array, L: Array, read: Mask, first: int, used: int) -> bool:
    """Return whether a lane that is read, (runs,), has an S that is `WIDE` or as good as singular."""
    if doubtful(S, R, L, used):
        for b in range(used):
            if read[first + b] and (singular(S, L, b) or exceeds(S, R, b, WIDE)):
                return True
    return False


@inner
def lost(P: Array, run: int) -> bool:
    """Return whether a run is lost: no variance of its covariance, of (runs, n, n), is a number."""
    none = True
    for i in range(P.shape[1]):
        none &= math.isnan(P[run, i, i])
    return none


@inner
def places(found: Mask) -> Indices:
    """Return the places (few,) where something is found, in order."""
    count = 0
    for run in range(len(found)):
        count += found[run]
    rows = np.empty(count, dtype=np.int64)
    count = 0
    if len(rows) > 0:
        for run in range(len(found)):
            if found[run]:
                rows[count] = run
                count += 1
    return rows
