"""Cubature Kalman filter."""

from __future__ import annotations

from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.kalman import GaussianFilterOptions
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.ukf import UnscentedKalmanFilter, UnscentedOptions, unscented_operations
from relnav_sim.measurements.interface import Measurement


class CubatureOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of the cubature Kalman filter."""


@register_filter("ckf", CubatureOptions, cost_us=1.3, overhead_us=55.0, operations=unscented_operations)
class CubatureKalmanFilter(UnscentedKalmanFilter):
    """Cubature Kalman filter: 2 n equally weighted points at sqrt(n) sigma, no tuning parameter.

    Arasaratnam and Haykin, IEEE Trans. Automatic Control 54(6), 2009. The third-degree spherical-radial rule is the
    unscented transform with alpha = 1, beta = 0, kappa = 0, whose centre has no weight; this is a preset of `ukf`.
    Use it as the baseline that leaves nothing to tune. The points move away as sqrt(n), so with many states they
    sample far from the mean.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: CubatureOptions) -> None:
        preset = UnscentedOptions(
            alpha=1.0,
            beta=0.0,
            kappa=0.0,
            gate_probability=options.gate_probability,
            arithmetic=options.arithmetic,
        )
        super().__init__(dynamics, measurement, preset)
