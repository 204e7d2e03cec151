"""A measurement about another one: what all that change something of a measurement have in common."""

from __future__ import annotations

from typing import ClassVar, cast

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults, Mixture, Turnable, has_own_density


class Around(MeasurementDefaults):
    """A measurement that is its base in all that a subclass does not change.

    Args:
        base: The measurement; it need not have the attributes and functions that `MeasurementDefaults` gives.

    Attributes:
        change: What is changed of the base, in words.
    """

    change: ClassVar[str]

    def __init__(self, base: Measurement) -> None:
        self.base = base
        self.dimension = base.dimension
        self.angles = getattr(base, "angles", ())
        self.depends_on = getattr(base, "depends_on", None)
        self.states = getattr(base, "states", None)
        self.whole = getattr(base, "whole", False)
        if has_own_density(base):
            self.log_likelihood = self._own_density  # type: ignore[method-assign]  # only then is there one of its own

    def _own_density(self, z: Array, states: Array, epoch: int) -> Array:
        """Return the base's own log p(z | states), where it is still that of the measurement.

        Raises:
            ValueError: What is changed of the base can't be applied to a density that only the base knows.
        """
        raise ValueError(
            f"{type(self.base).__name__} has a log_likelihood of its own, to which {self.change} can't be applied; "
            "take a filter that goes by its noise alone, ekf say, or leave that out"
        )

    def take(self, z: Array, first_epoch: int) -> Array:
        """Return what the base makes of the measurements."""
        take = getattr(self.base, "take", None)
        return z if take is None else np.asarray(take(z, first_epoch))

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the base's h(states), (runs, ..., m)."""
        return self.base.predict(states, epoch)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the base's dh/dx, (runs, ..., m, n), or (m, n) where it is constant."""
        return self.base.jacobian(states, epoch)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the base's R, (m, m) or (runs, m, m)."""
        return self.base.noise(mean, epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the base's noise, if it has any."""
        return self.base.mixture(mean, epoch)

    def turning(self, states: Array, epoch: int) -> Array:
        """Return what a small turn of the host does to the base's measurement, (runs, ..., m, 3).

        Raises:
            TypeError: The base can't say.
        """
        return cast(Turnable, self.base).turning(states, epoch)

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return the base's residual."""
        return self.base.residual(z, predicted)
