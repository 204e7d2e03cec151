"""Rauch-Tung-Striebel smoother: what all measurements say about every epoch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.run import FilterHistory
from relnav_sim.filters.square_root import Whitener
from relnav_sim.linalg import symmetric, transpose


@dataclass(frozen=True)
class SmoothedHistory:
    """State given all measurements, before and after each epoch.

    Args:
        mean: (runs, T, n).
        covariance: (runs, T, n, n).
    """

    mean: Array
    covariance: Array


def smooth(history: FilterHistory, dynamics: Dynamics, step_s: float = 1.0, first_epoch: int = 0) -> SmoothedHistory:
    """Run the fixed-interval smoother backwards over a filter's history.

    Rauch, Tung and Striebel, AIAA J. 3(8), 1965, with the covariance as a sum of positive parts (Joseph's form). Exact
    for linear dynamics and any filter that is exact; for nonlinear dynamics the transition is taken at the filtered
    mean. Epochs without a measurement are smoothed like the others. Filters that are not Gaussian give their mean and
    covariance, smoothed as if they were.

    Args:
        history: From `run_filter`; `mean` (runs, T, n) and `covariance` (runs, T, n, n) are used.
        dynamics: The filter's.
        step_s: Time between epochs, s.
        first_epoch: Number of the history's first epoch, for dynamics that differ from epoch to epoch.

    Returns:
        Means (runs, T, n) and covariances (runs, T, n, n); at the last epoch those of the filter.

    Raises:
        ValueError: The history's shapes and the dynamics do not fit together.
    """
    n = dynamics.dimension
    if history.mean.ndim != 3 or history.covariance.shape != (*history.mean.shape, n):
        raise ValueError(
            f"the history has means {history.mean.shape} and covariances {history.covariance.shape}; "
            f"for {n} states they must be (runs, T, {n}) and (runs, T, {n}, {n})"
        )
    mean, covariance = history.mean.copy(), history.covariance.copy()
    # A run that has diverged turns to inf and NaN in its own row.
    with np.errstate(all="ignore"):
        for k in reversed(range(mean.shape[1] - 1)):
            step = Step(first_epoch + k + 1, step_s)
            m, P = history.mean[:, k], history.covariance[:, k]
            F = dynamics.transition(m, step)
            Q = dynamics.process_noise(m, step)
            FP = F @ P
            C = transpose(Whitener(symmetric(FP @ transpose(F)) + Q).solve(FP))
            change = mean[:, k + 1] - dynamics.propagate(m, step)
            mean[:, k] = m + np.einsum("bij,bj->bi", C, change)
            rest = np.eye(n) - C @ F
            covariance[:, k] = symmetric(rest @ P @ transpose(rest) + C @ (Q + covariance[:, k + 1]) @ transpose(C))
    return SmoothedHistory(mean, covariance)
