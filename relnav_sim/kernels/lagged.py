"""Products of a series with itself, so many measurements apart, over a stream of chunks of epochs."""

from __future__ import annotations

import math

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.kernels.compiling import flag, given, integer, kernel, written


@kernel(given(3), given(2, flag), written(2, integer), written(2), written(3), written(3))
def products(x: Array, counted: Mask, count: Integers, total: Array, products: Array, last: Array) -> None:
    """Add the next epochs of each channel; those without a measurement, NaN, are skipped.

    Args:
        x: (runs, K, c).
        counted: Epochs that count (runs, K).
        count: Measurements so far (runs, c), which goes on.
        total: Their sum (runs, c), which goes on.
        products: Sum of the products with the measurement so many before, itself first, (runs, c, lags), which goes on.
        last: The last measurements, that of number n in place n modulo lags, (runs, c, lags).
    """
    runs, K, channels = x.shape
    lags = products.shape[2]
    for run in range(runs):
        for c in range(channels):
            n = count[run, c]
            for k in range(K):
                value = x[run, k, c]
                if counted[run, k] and abs(value) < math.inf:
                    last[run, c, n % lags] = value
                    for lag in range(min(n + 1, lags)):
                        products[run, c, lag] += value * last[run, c, (n - lag) % lags]
                    total[run, c] += value
                    n += 1
            count[run, c] = n
