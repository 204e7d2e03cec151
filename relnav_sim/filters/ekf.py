"""Extended Kalman filter."""

from __future__ import annotations

from typing import Any

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Innovation
from relnav_sim.filters.kalman import GaussianFilter, LinearisedFilterOptions, joseph_update, linearised_operations
from relnav_sim.filters.registry import register_filter
from relnav_sim.measurements.interface import linearised


@register_filter("ekf", LinearisedFilterOptions, cost_us=0.7, overhead_us=25.0, operations=linearised_operations)
class ExtendedKalmanFilter(GaussianFilter):
    """Extended Kalman filter: the measurement linearised at the prediction.

    Jazwinski, Stochastic Processes and Filtering Theory, 1970, ch. 8. The cheapest filter for range and angles.
    Trust it when the prior is small against the range; from a poor prior prefer an iterated or sigma-point filter.
    """

    nominal_gain = True

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the Kalman update with H = dh/dx at the predicted mean."""
        if self._single is not None:
            return self._single.joseph_update(belief, *self._single.linearised(z, belief, step.epoch))
        return joseph_update(belief, *linearised(self.measurement, z, belief.mean, step.epoch))
