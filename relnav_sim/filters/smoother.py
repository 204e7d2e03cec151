"""Smoothers: what all measurements, or those up to some epochs later, say about every epoch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.fixed_interval import fixed_interval
from relnav_sim.filters.fixed_lag import fixed_lag, to_next_border
from relnav_sim.filters.recorded_flow import recorded_flow
from relnav_sim.filters.run import FilterHistory
from relnav_sim.filters.segments import Segment


@dataclass(frozen=True)
class SmoothedHistory:
    """State given all measurements, before and after each epoch.

    Args:
        mean: (runs, T, n).
        covariance: (runs, T, n, n).

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter, smooth
        >>> dynamics = LinearDynamics([[1.0]], [[1.0]])
        >>> filter = create_filter("kf", dynamics, LinearMeasurement([[1.0]], [[1.0]]))
        >>> smoothed = smooth(run_filter(filter, np.zeros((1, 3, 1)), [0.0], [[1.0]]), dynamics)
        >>> smoothed.covariance[0, :, 0, 0].round(3).tolist()
        [0.476, 0.476, 0.619]
    """

    mean: Array
    covariance: Array


def smooth(
    history: FilterHistory, dynamics: Dynamics, step_s: float = 1.0, first_epoch: int = 0, lag: int | None = None
) -> SmoothedHistory:
    """Run a smoother backwards over a filter's history: fixed interval, or fixed lag.

    Rauch, Tung and Striebel, AIAA J. 3(8), 1965, with the covariance as a sum of positive parts (Joseph's form). Exact
    for linear dynamics and any filter that is exact; for nonlinear dynamics the transition is taken at the filtered
    mean. Epochs without a measurement are smoothed like the others. Filters that are not Gaussian give their mean and
    covariance, smoothed as if they were.

    Args:
        history: From `run_filter`; `mean` (runs, T, n) and `covariance` (runs, T, n, n) are used.
        dynamics: The filter's.
        step_s: Time between epochs, s.
        first_epoch: Number of the history's first epoch, for dynamics that differ from epoch to epoch.
        lag: Each epoch gets the measurements up to so many epochs later; None: all of them. The last `lag` epochs get
            all that there are.

    Returns:
        Means (runs, T, n) and covariances (runs, T, n, n); at the last epoch those of the filter.

    Raises:
        ValueError: The history's shapes and the dynamics do not fit together, or the lag is negative.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter, smooth
        >>> dynamics = LinearDynamics(np.eye(1), np.eye(1))
        >>> filter = create_filter("kf", dynamics, LinearMeasurement(np.eye(1), np.eye(1)))
        >>> history = run_filter(filter, [[[0.0], [1.0], [5.0]]], mean0=np.zeros(1), cov0=np.eye(1))
        >>> smooth(history, dynamics).mean.round(2).tolist()
        [[[0.67], [1.67], [3.33]]]
        >>> smooth(history, dynamics, lag=1).mean.round(2).tolist()
        [[[0.25], [1.67], [3.33]]]
    """
    n = dynamics.dimension
    if history.mean.ndim != 3 or history.covariance.shape != (*history.mean.shape, n):
        raise ValueError(
            f"the history has means {history.mean.shape} and covariances {history.covariance.shape}; "
            f"for {n} states they must be (runs, T, {n}) and (runs, T, {n}, {n})"
        )
    if lag is not None and lag < 0:
        raise ValueError(f"lag is {lag}; give a number of epochs, or None for all of them")
    if lag == 0 or history.mean.shape[1] < 2:
        return SmoothedHistory(history.mean.copy(), history.covariance.copy())
    # A run that has diverged turns to inf and NaN in its own row.
    with np.errstate(all="ignore"):
        whole = _Whole(history, dynamics, step_s, first_epoch)
        if lag is None:
            ((mean, covariance),) = fixed_interval(whole)
        else:
            ((mean, covariance),) = fixed_lag(whole, list(to_next_border(whole, lag)), lag)
    return SmoothedHistory(mean.swapaxes(0, 1), covariance.swapaxes(0, 1))


class _Whole:
    """A history as one segment."""

    def __init__(self, history: FilterHistory, dynamics: Dynamics, step_s: float, first_epoch: int) -> None:
        means, covariances = (
            np.ascontiguousarray(series.swapaxes(0, 1)) for series in (history.mean, history.covariance)
        )
        steps = recorded_flow(dynamics, history.mean[:, :-1], first_epoch + 1, step_s)
        # Of the step to the first epoch nothing is known, and nothing asked.
        image, F, Q = (np.concatenate([A[:, :1], A], axis=1).swapaxes(0, 1) for A in (steps.image, steps.F, steps.Q))
        self.lengths = (len(means),)
        self._segment = Segment(Gaussian(means[0], covariances[0]), means, covariances, image, F, Q)

    def __getitem__(self, place: int) -> Segment:
        return self._segment
