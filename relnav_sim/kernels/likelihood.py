"""The likelihood of many states by one measurement."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import flag, given, kernel
from relnav_sim.kernels.elementary import wrapped
from relnav_sim.kernels.lanes import LANES, factor


@kernel(given(2), given(3), given(1, flag), given(3))
def gaussian(z: Array, predicted: Array, angle: Mask, R: Array) -> Array:
    """Return log N(z - h; 0, R) for every h that is predicted, (runs, N).

    Args:
        z: Measurements (runs, m).
        predicted: h, (runs, N, m).
        angle: Which components are angles, whose differences are wrapped, (m,).
        R: (runs, m, m), or (1, m, m) for all runs; a run in which it is not positive definite gets NaN.
    """
    runs, N, m = predicted.shape
    score = np.empty((runs, N))
    S, L, w = np.empty((m, m, 1)), np.zeros((m, m, 1)), np.empty((m, LANES))
    for run in range(runs):
        for i in range(m):
            for j in range(m):
                S[i, j, 0] = R[run if len(R) > 1 else 0, i, j]
        factor(S, 1, L)
        constant = m * math.log(2 * math.pi)
        for i in range(m):
            constant += 2 * math.log(L[i, i, 0])
        for first in range(0, N, LANES):
            used = min(LANES, N - first)
            h, result = predicted[run, first : first + used], score[run, first : first + used]
            for i in range(m):
                for b in range(used):
                    w[i, b] = z[run, i] - h[b, i]
                if angle[i]:
                    for b in range(used):
                        w[i, b] = wrapped(w[i, b])
                for k in range(i):
                    for b in range(used):
                        w[i, b] -= L[i, k, 0] * w[k, b]
                scale = 1 / L[i, i, 0]
                for b in range(used):
                    w[i, b] *= scale
            for b in range(used):
                result[b] = constant
            for i in range(m):
                for b in range(used):
                    result[b] += w[i, b] * w[i, b]
            for b in range(used):
                result[b] *= -0.5
    return score
