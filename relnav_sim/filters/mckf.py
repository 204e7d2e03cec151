"""Maximum-correntropy Kalman filter."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Innovation
from relnav_sim.filters.either_arithmetic import EitherArithmetic
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.reweighting import ReweightingOptions, reweighted_operations, reweighted_update
from relnav_sim.measurements.interface import Measurement
from relnav_sim.options import Tunable

SMALLEST_WEIGHT = 1e-6


class CorrentropyOptions(ReweightingOptions):
    """Options of the maximum-correntropy filter."""

    bandwidth: Annotated[float, Tunable(0.5, 30)] = Field(
        default=3.0,
        gt=0,
        description="sigma of the correntropy kernel exp(-e^2 / (2 sigma^2)), in sigmas of the noise; 2 to 5 suit "
        "glint; very large: the extended Kalman filter",
    )
    iterations: int = Field(default=4, ge=1, le=50, description="Steps of the fixed point; it settles within 3 to 5")
    weigh_prior: bool = Field(
        default=False,
        description="Reweight the prediction too and begin the fixed point there, as the paper does. Default false, "
        "the measurement only: a prediction that is far off, at the start say, is then corrected all the same",
    )


@register_filter("mckf", CorrentropyOptions, cost_us=4.0, overhead_us=115.0, operations=reweighted_operations)
class CorrentropyFilter(EitherArithmetic):
    """Maximum-correntropy filter: a Gaussian kernel of the residuals replaces the square.

    Chen, Liu, Zhao and Principe, Automatica 76, 2017. Each whitened channel of the measurement is weighted by
    exp(-e^2 / (2 sigma^2)) in a fixed-point iteration. A large residual is ignored altogether: use it against rare and
    huge outliers. The paper weighs the prediction alike and begins at it (`weigh_prior: true`); from a prior much wider
    than the measurement, or with large process noise, that filter takes good measurements for outliers and never
    converges. The covariance is that of the reweighted update, not Joseph's form with the nominal P and R as published.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: CorrentropyOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the fixed point's update."""
        options = self._options
        return reweighted_update(belief, z, self.seen, step.epoch, self._weigh, options.iterations, options.weigh_prior)

    def _weigh(self, e: Array, spread: Array) -> Array:
        # The floor keeps the reweighted covariance finite.
        return np.maximum(np.exp(-np.square(e) / (2 * self._options.bandwidth**2)), SMALLEST_WEIGHT)
