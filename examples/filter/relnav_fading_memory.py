"""A filter for relnav in a package of its own: copy it, rename it, and change what it does."""

import math

from pydantic import Field

from relnav_sim import register_filter
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.ekf import ExtendedKalmanFilter
from relnav_sim.filters.kalman import GaussianFilterOptions
from relnav_sim.measurements.interface import Measurement


class FadingMemoryOptions(GaussianFilterOptions):
    """Options of the fading-memory filter; those of every Gaussian filter (the innovation gate) come with the base."""

    memory_s: float = Field(
        default=100.0,
        gt=0,
        description="tau, s: what was measured tau ago counts 1/e of what is measured now; default 100, long enough "
        "to average a radar, short against an orbit; very long: the extended Kalman filter",
    )


@register_filter("fading_memory", FadingMemoryOptions)
class FadingMemoryFilter(ExtendedKalmanFilter):
    """Fading-memory filter: an extended Kalman filter that forgets old measurements exponentially.

    Sorenson and Sacks, Information Sciences 3, 1971. Each step of length T multiplies the covariance by
    exp(T / tau) before the prediction, P = exp(T / tau) F P F^T + Q, so that information ages with time constant tau.
    Use it when the dynamics are known to drift away from the model but no process noise can be named. It never becomes
    surer than about tau of measurements allows, and a long outage inflates all states alike.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: FadingMemoryOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._memory_s = options.memory_s

    def predict(self, belief: Gaussian, step: Step) -> Gaussian:
        """Return the prediction of a belief whose covariance has grown by the factor exp(T / tau)."""
        growth = math.exp(step.duration_s / self._memory_s)
        return super().predict(Gaussian(belief.mean, growth * belief.covariance), step)
