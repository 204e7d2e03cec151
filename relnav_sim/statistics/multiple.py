"""Many comparisons at once: what keeps the chance of any wrong verdict at 5 %."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def holm(p_values: Sequence[float]) -> tuple[float, ...]:
    """Return adjusted p-values of a family of tests (Holm 1979); below 0.05 none of the claims is wrong at 95 %.

    The smallest is multiplied by the number of tests, the next by one less, and so on, never below the one before.
    It needs nothing of the tests' dependence, which common random numbers make strong.
    """
    p = np.asarray(p_values, dtype=float)
    order = np.argsort(p, kind="stable")
    stepped = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(stepped, 1.0)
    return tuple(float(value) for value in adjusted)
