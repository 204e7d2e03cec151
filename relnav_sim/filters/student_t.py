"""Student-t Kalman filter by variational Bayes."""

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
from relnav_sim.measurements.partial import channel_count
from relnav_sim.options import Tunable


class StudentOptions(ReweightingOptions):
    """Options of the Student-t filter."""

    degrees_of_freedom: Annotated[float, Tunable(1, 100)] = Field(
        default=4.0,
        gt=0,
        description="Degrees of freedom of the measurement noise; 3 to 5 suit glint; very large: the extended filter",
    )
    per_channel: bool = Field(
        default=True,
        description="Let range and angles have outliers by themselves; false: one scale for the whole measurement",
    )
    iterations: int = Field(default=4, ge=1, le=50, description="Variational steps; they settle within 3 to 5")


@register_filter("student_t", StudentOptions, cost_us=2.0, overhead_us=115.0, operations=reweighted_operations)
class StudentFilter(EitherArithmetic):
    """Student-t filter: heavy-tailed measurement noise, a Gaussian whose precision is itself random.

    Roth, Ozkan and Gustafsson, ICASSP 2013; the variational form of Agamennoni, Nieto and Nebot, IEEE Trans. Signal
    Processing 60(10), 2012. v | lambda ~ N(0, R / lambda), lambda ~ Gamma(nu/2, nu/2); the weight is the expected
    lambda given the residual and its own uncertainty. Use it against glint of unknown share and size: a huge residual
    loses all influence, as with correntropy, but gradually. R is the scale, so with noise that is Gaussian of
    covariance R the filter is slightly cautious; weights rise to 1 + 1/nu where the residuals are small.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: StudentOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the variational update."""
        return reweighted_update(belief, z, self.seen, step.epoch, self._weigh, self._options.iterations)

    def _weigh(self, e: Array, spread: Array) -> Array:
        freedom, squared = self._options.degrees_of_freedom, np.square(e) + spread
        if self._options.per_channel:
            return (freedom + 1) / (freedom + squared)
        channels = np.reshape(channel_count(self.measurement), (-1, 1))
        one = (freedom + channels) / (freedom + squared.sum(axis=-1, keepdims=True))
        return np.broadcast_to(one, e.shape)
