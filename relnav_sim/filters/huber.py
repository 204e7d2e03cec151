"""Huber's robust Kalman filter."""

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


class HuberOptions(ReweightingOptions):
    """Options of the Huber filter."""

    threshold: Annotated[float, Tunable(0.3, 10)] = Field(
        default=1.345,
        gt=0,
        description="c, in sigmas: residuals beyond it lose weight as c / |e|; 1.345 keeps 95 % efficiency when the "
        "noise is Gaussian; very large: the extended Kalman filter",
    )
    iterations: int = Field(default=4, ge=1, le=50, description="Reweighted updates; they settle within 3 to 5")
    weigh_prior: bool = Field(
        default=False,
        description="Reweight the prediction too (Boncelet and Dickinson 1983), for bursts of process noise",
    )


@register_filter("huber", HuberOptions, cost_us=2.5, overhead_us=100.0, operations=reweighted_operations)
class HuberFilter(EitherArithmetic):
    """Huber filter: residuals beyond a threshold count linearly instead of quadratically.

    Karlgaard and Schaub, J. Guidance, Control, and Dynamics 30(3), 2007. Each whitened channel of the measurement is
    weighted by min(1, c / |e|) in an iterated least-squares update. Use it against occasional outliers whose size is
    not known; an outlier's influence is bounded, not removed, and the weights cost some efficiency without outliers.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: HuberOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the iterated update."""
        options = self._options
        return reweighted_update(belief, z, self.seen, step.epoch, self._weigh, options.iterations, options.weigh_prior)

    def _weigh(self, e: Array, spread: Array) -> Array:
        c = self._options.threshold
        return c / np.maximum(np.abs(e), c)
