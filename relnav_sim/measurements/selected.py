"""Some channels of a measurement, as a measurement of its own."""

from __future__ import annotations

from collections.abc import Sequence

from relnav_sim.arrays import Array
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults, Mixture


class Selected(MeasurementDefaults):
    """What a measurement reads in some of its channels.

    Args:
        base: The measurement.
        channels: Which of its channels, in the new order.
    """

    def __init__(self, base: Measurement, channels: Sequence[int]) -> None:
        self.base = base
        self._channels = list(channels)
        self.dimension = len(self._channels)
        self.angles = tuple(
            place for place, channel in enumerate(self._channels) if channel in getattr(base, "angles", ())
        )
        self.depends_on = getattr(base, "depends_on", None)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return these channels of h(states), (runs, ..., m)."""
        return self.base.predict(states, epoch)[..., self._channels]

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return these rows of dh/dx."""
        return self.base.jacobian(states, epoch)[..., self._channels, :]

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return these rows and columns of R."""
        return self._block(self.base.noise(mean, epoch))

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the noise in these channels, if it is a mixture."""
        mixture = self.base.mixture(mean, epoch)
        return mixture and Mixture(mixture.weights, self._block(mixture.covariances), mixture.shared)

    def _block(self, covariances: Array) -> Array:
        return covariances[..., self._channels, :][..., self._channels]
