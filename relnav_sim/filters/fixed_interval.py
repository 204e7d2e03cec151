"""The fixed-interval smoother: the estimate of every epoch given all measurements, last epoch first."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.segments import Segments
from relnav_sim.filters.square_root import Whitener
from relnav_sim.linalg import symmetric, transpose


def fixed_interval(segments: Segments) -> Iterator[tuple[Array, Array]]:
    """Yield means (K, runs, n) and covariances (K, runs, n, n) given all measurements, last segment first.

    Rauch, Tung and Striebel, AIAA J. 3(8), 1965, with the covariance as a sum of positive parts (Joseph's form).
    """
    later: tuple[Array, Array] | None = None
    for place in reversed(range(len(segments.lengths))):
        segment = segments[place]
        K, n = len(segment.mean), segment.mean.shape[-1]
        means, covariances = np.empty_like(segment.mean), np.empty_like(segment.covariance)
        mean, P_s = (segment.mean[-1], segment.covariance[-1]) if later is None else later
        for k in reversed(range(K)):
            means[k], covariances[k] = mean, P_s
            if place == k == 0:
                break
            before = Gaussian(segment.mean[k - 1], segment.covariance[k - 1]) if k else segment.before
            m, P = before.mean, before.covariance
            F, Q = segment.F[k], segment.Q[k]
            C = gain(P, F, Q)
            mean = m + np.einsum("bij,bj->bi", C, mean - segment.image[k])
            rest = np.eye(n) - C @ F
            P_s = symmetric(rest @ P @ transpose(rest) + C @ (Q + P_s) @ transpose(C))
        later = mean, P_s
        yield means, covariances


def gain(P: Array, F: Array, Q: Array) -> Array:
    """Return C = P F^T (F P F^T + Q)^-1, (matrices, n, n), of stacks (matrices, n, n)."""
    FP = F @ P
    return transpose(Whitener(symmetric(FP @ transpose(F)) + Q).solve(FP))
