"""Extended Kalman filter."""

from __future__ import annotations

from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.kalman import GaussianFilter, LinearisedFilterOptions, joseph_update, linearised_operations
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.underweighting import UnderweightingOptions, underweighted
from relnav_sim.measurements.interface import CompiledUpdate, Measurement, Stretch, linearised
from relnav_sim.options import AddedLater


class ExtendedOptions(LinearisedFilterOptions):
    """Options of the extended Kalman filter."""

    underweighting: Annotated[UnderweightingOptions | None, AddedLater()] = Field(
        default=None,
        description="Less weight for measurements while the position is poorly known; default: none",
    )

    @model_validator(mode="after")
    def _in_double(self) -> Self:
        if self.underweighting is not None and self.arithmetic == "float32":
            raise ValueError("underweighting is computed in float64 only; leave it or arithmetic: float32 out")
        return self


@register_filter("ekf", ExtendedOptions, cost_us=0.7, overhead_us=25.0, operations=linearised_operations)
class ExtendedKalmanFilter(GaussianFilter):
    """Extended Kalman filter: the measurement linearised at the prediction.

    Jazwinski, Stochastic Processes and Filtering Theory, 1970, ch. 8. The cheapest filter for range and angles.
    Trust it when the prior is small against the range; from a poor prior give it `underweighting`, or prefer an
    iterated or sigma-point filter.
    """

    nominal_gain = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: ExtendedOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._underweighting = getattr(options, "underweighting", None)

    def compiled_epochs(self, belief: Gaussian, stretch: Stretch, first_epoch: int) -> int | None:
        """Take as many epochs of a stretch in one go as dynamics and measurement can; None: they can't."""
        if self._underweighting:
            return None
        return self.epochs_by(ExtendedKalmanFilter, CompiledUpdate("filtered", 1.0), belief, stretch, first_epoch)

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the Kalman update with H = dh/dx at the predicted mean."""
        if self._single is not None:
            return self._single.joseph_update(belief, *self._single.linearised(z, belief, step.epoch))
        residual, H, R = linearised(self.measurement, z, belief.mean, step.epoch)
        update = joseph_update(belief, residual, H, R)
        if self._underweighting is None:
            return update
        return underweighted(belief, update, residual, H, R, self._underweighting)
