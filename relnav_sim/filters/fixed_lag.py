"""The fixed-lag smoother: the estimate of every epoch given the measurements up to some epochs later.

By how much the estimate of an epoch changes follows from how much that of the next one does. With the filtered m_k, its
correction g_k = m_k - f(m_{k-1}) and the change d_k = x_k - m_k,

    d_{k-1} = C_k (d_k + g_k),    P_{k-1} = B_k + C_k P_k C_k^T,

where C_k is the gain of Rauch, Tung and Striebel and B_k the covariance of x_{k-1} were x_k known, a sum of positive
parts (Joseph's form). Two such steps in a row are one again, so they can be put together in any grouping.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.fixed_interval import gain
from relnav_sim.filters.segments import Segment, Segments
from relnav_sim.linalg import symmetric, transpose


@dataclass(frozen=True)
class Change:
    """What x_j tells of an earlier x_i, d_i = C d_j + h and P_i = B + C P_j C^T; epochs may lead.

    Attributes:
        C: (runs, n, n).
        h: (runs, n).
        B: (runs, n, n).
    """

    C: Array
    h: Array
    B: Array

    def __getitem__(self, k: int) -> Change:
        """Return that of the k-th epoch, where epochs lead."""
        return Change(self.C[k], self.h[k], self.B[k])

    def after(self, later: Change) -> Change:
        """Return this change where its x_j follows from a later one."""
        C = self.C
        return Change(C @ later.C, self.h + _times(C, later.h), symmetric(self.B + C @ later.B @ transpose(C)))

    def of(self, change: Array, covariance: Array) -> tuple[Array, Array]:
        """Return d_i (runs, n) and P_i (runs, n, n) from those at j."""
        C = self.C
        return self.h + _times(C, change), symmetric(self.B + C @ covariance @ transpose(C))


class Changes(Protocol):
    """Successive changes, one for each segment."""

    def __getitem__(self, place: int) -> Change:
        """Return one of them, with the epochs leading."""
        ...


def to_next_border(segments: Segments, lag: int) -> Iterator[Change]:
    """Yield what each epoch learns from the next border, with the epochs leading, last segment first.

    Borders are the epochs that are multiples of the lag, and the last epoch.
    """
    firsts = _firsts(segments)
    chain: Change | None = None  # from the epoch to the next border
    for place in reversed(range(len(firsts))):
        segment, first = segments[place], firsts[place]
        back = _steps_back(segment)
        own = Change(*(np.empty_like(part) for part in (back.C, back.h, back.B)))
        for k in reversed(range(len(segment.mean))):
            if chain is None:
                chain = _no_change(segment)
            own.C[k], own.h[k], own.B[k] = chain.C, chain.h, chain.B
            chain = back[k] if (first + k) % lag == 0 else back[k].after(chain)
        yield own


def fixed_lag(segments: Segments, to_border: Changes, lag: int) -> Iterator[tuple[Array, Array]]:
    """Yield means (K, runs, n) and covariances (K, runs, n, n), first segment first.

    A window that slides over what can be put together in any grouping costs the same whatever its length (van Herk,
    Pattern Recognition Letters 13(7), 1992): from an epoch to the next border, as `to_next_border` has it, and from
    there on, which grows by a step an epoch.

    Args:
        segments: The filter's.
        to_border: From `to_next_border`, first segment first.
        lag: How many epochs later the last measurement is that an epoch gets, 1 or more. The last epochs of the run get
            all that there are.
    """
    firsts = _firsts(segments)
    last = firsts[-1] + segments.lengths[-1] - 1
    ahead, at, reached = segments[0], 0, 0
    back = _steps_back(ahead)
    unchanged = np.zeros_like(ahead.mean[0])
    beyond = _no_change(ahead)  # from the last border to the epoch that is reached
    for place, first in enumerate(firsts):
        segment, own = segments[place], to_border[place]
        means, covariances = np.empty_like(segment.mean), np.empty_like(segment.covariance)
        for k in range(len(means)):
            while reached < min(first + k + lag, last):
                reached += 1
                if reached >= firsts[at] + segments.lengths[at]:
                    at += 1
                    ahead = segments[at]
                    back = _steps_back(ahead)
                beyond = _no_change(ahead) if reached % lag == 0 else beyond.after(back[reached - firsts[at]])
            end = unchanged, ahead.covariance[reached - firsts[at]]
            # Without a border on the way the next one is the last epoch, which is reached.
            border = end if (first + k) // lag == reached // lag else beyond.of(*end)
            change, covariances[k] = own[k].of(*border)
            means[k] = segment.mean[k] + change
        yield means, covariances


def _steps_back(segment: Segment) -> Change:
    """Return the steps back from each epoch to the one before, with the epochs leading."""
    K, runs, n = segment.mean.shape
    P = np.concatenate([segment.before.covariance[None], segment.covariance[:-1]]).reshape(-1, n, n)
    F, Q = segment.F.reshape(-1, n, n), segment.Q.reshape(-1, n, n)
    C = gain(P, F, Q)
    rest = np.eye(n) - C @ F
    B = symmetric(rest @ P @ transpose(rest) + C @ Q @ transpose(C))
    h = _times(C, (segment.mean - segment.image).reshape(-1, n))
    return Change(C.reshape(K, runs, n, n), h.reshape(K, runs, n), B.reshape(K, runs, n, n))


def _no_change(segment: Segment) -> Change:
    """Return the change from an epoch to itself."""
    runs, n = segment.mean.shape[1:]
    return Change(np.tile(np.eye(n), (runs, 1, 1)), np.zeros((runs, n)), np.zeros((runs, n, n)))


def _firsts(segments: Segments) -> list[int]:
    """Return the first epoch of each segment, that of the first counted 0."""
    firsts: list[int] = np.cumsum([0, *segments.lengths[:-1]]).tolist()
    return firsts


def _times(C: Array, v: Array) -> Array:
    return np.einsum("bij,bj->bi", C, v)
