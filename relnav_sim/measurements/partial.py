"""Measurements of which some channels are missing: what a filter is then told of the measurement.

With a selection S of the present channels, H -> S H, R -> S R S^T, z -> S z. Runs with other channels present share one
batch, so every array keeps its m channels: an absent channel has residual 0, a row of zeros in H, and in R a row and
column of zeros with 1 on the diagonal, in every component of a mixture. H P H^T + R is then block diagonal with ones
for the absent channels, so mean, covariance, normalised innovation and log det S are those of the present ones. Only
the constant m log 2 pi of a log-likelihood counts too many channels; the loop over epochs takes that back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults, Mixture, has_own_density


@dataclass(frozen=True)
class Sensor:
    """One of the sensors that a filter measures by.

    Args:
        name: Its name; empty where the filter was made with a measurement without one.
        channels: Its channels among those of the filter's measurement.
        whole: Whether a measurement counts with all its channels only.
        take: ``take(z, first_epoch)`` -> z, told of its measurements (runs, K, m) before a chunk of epochs is filtered.
    """

    name: str
    channels: slice
    whole: bool
    take: Callable[[Array, int], Array]


def sensors_of(measurement: Measurement) -> tuple[Sensor, ...]:
    """Return the sensors of a filter's measurement, in the order in which they are processed.

    `create_filter` gives a filter a measurement that says so by an attribute ``sensors``. One without can't be told
    which channels are present: its measurements count as a whole.
    """
    sensors: tuple[Sensor, ...] | None = getattr(measurement, "sensors", None)
    return (_sensor("", measurement, whole=True),) if sensors is None else sensors


def present_channels(measurement: Measurement) -> Mask | None:
    """Return which channels (runs, m) of a filter's measurement are present; None: all of them."""
    present: Mask | None = getattr(measurement, "present", None)
    return present


def channel_count(measurement: Measurement) -> int | Integers:
    """Return how many channels of a filter's measurement are present, by run (runs,) where some are absent."""
    present = present_channels(measurement)
    return measurement.dimension if present is None else present.sum(axis=1)


def all_channels(measurement: Measurement) -> Measurement:
    """Return a filter's measurement as it is with every channel present, whatever is read."""
    complete: Measurement = getattr(measurement, "complete", measurement)
    return complete


_MASKED = ("predict", "jacobian", "noise", "mixture", "residual", "linearised", "squared_errors", "filtered")
"""The functions of a measurement that absent channels change."""


class PartialMeasurement(MeasurementDefaults):
    """A measurement whose channels may be absent, run by run.

    Everything that is not said here is as in the measurement behind it.

    Args:
        base: The measurement with all its channels.
        name: The sensor's name, if it has one.

    Attributes:
        complete: The base.
        present: The channels (runs, m) that are present; None: all, and then its functions are the base's own.
        sensors: The one sensor.
    """

    def __init__(self, base: Measurement, name: str = "") -> None:
        self.complete = base
        self.dimension = base.dimension
        self.angles = getattr(base, "angles", ())
        self.depends_on = getattr(base, "depends_on", None)
        self.states = getattr(base, "states", None)
        self.whole = getattr(base, "whole", False)
        self.present: Mask | None = None
        self._stand_aside()
        self.sensors = (_sensor(name, base, self.whole),)
        if has_own_density(base):
            self.log_likelihood = self._own_density  # type: ignore[method-assign]  # only then is there one of its own

    def __getattr__(self, name: str) -> Any:
        if name == "complete":
            raise AttributeError(name)  # while it is unpickled
        return getattr(self.complete, name)

    def __setattr__(self, name: str, value: Any) -> None:
        """Give a function that absent channels change to the base, which is as if it had had it from the first."""
        if name not in _MASKED:
            super().__setattr__(name, value)
            return
        setattr(self.complete, name, value)
        if self.present is None:
            self._stand_aside()

    def attend(self, present: Mask | None) -> None:
        """Count the channels (runs, m) as present and the others as absent; None: all are present."""
        before, self.present = self.present, present
        if present is not None:
            for name in _MASKED:
                vars(self).pop(name, None)
        elif before is not None:
            self._stand_aside()

    def _stand_aside(self) -> None:
        """Let the functions be those of the base themselves: a filter calls them so often that looking would show."""
        vars(self).update({name: getattr(self.complete, name) for name in _MASKED if hasattr(self.complete, name)})

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states), zero in absent channels."""
        return zero_absent(self.complete.predict(states, epoch), self._mask)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx, rows of zeros for absent channels."""
        return zero_absent_rows(self.complete.jacobian(states, epoch), self._mask, states.shape[:-1])

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R, with a variance of 1 and no correlation for absent channels."""
        return unit_where_absent(self.complete.noise(mean, epoch), self._mask)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the noise, each with a variance of 1 for absent channels."""
        mixture = self.complete.mixture(mean, epoch)
        if mixture is None:
            return None
        return Mixture(mixture.weights, unit_where_absent(mixture.covariances, self._mask[:, None]), mixture.shared)

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return the base's residual, zero in absent channels."""
        return zero_absent(self.complete.residual(z, predicted), self._mask)

    @property
    def _mask(self) -> Mask:
        assert self.present is not None, (
            "with all channels present the base's own functions stand in the place of these"
        )
        return self.present

    def _own_density(self, z: Array, states: Array, epoch: int) -> Array:
        if self.present is not None and (self.present.any(axis=1) & ~self.present.all(axis=1)).any():
            raise ValueError(
                f"a measurement at epoch {epoch} has channels missing, for which the measurement model's own "
                "log_likelihood has no density; give the model `whole = True`, and such a measurement counts as missing"
            )
        return self.complete.log_likelihood(z, states, epoch)


def zero_absent(values: Array, present: Mask) -> Array:
    """Return values (runs, ..., m) with zeros in absent channels, laid out in memory as they were."""
    kept = values.copy(order="K")
    np.copyto(kept, 0.0, where=~present.reshape(len(present), *[1] * (values.ndim - 2), -1))
    return kept


def zero_absent_rows(H: Array, present: Mask, leading: tuple[int, ...]) -> Array:
    """Return H (m, n) or (runs, ..., m, n) as (*leading, m, n) with rows of zeros for absent channels."""
    kept = np.array(np.broadcast_to(H, (*leading, *H.shape[-2:])))
    np.copyto(kept, 0.0, where=~present.reshape(len(present), *[1] * (len(leading) - 1), -1, 1))
    return kept


def unit_where_absent(R: Array, present: Mask) -> Array:
    """Return covariances (..., m, m) with the rows and columns of absent channels, (runs, ..., m), those of I."""
    return np.where(present[..., :, None] & present[..., None, :], R, np.eye(R.shape[-1], dtype=R.dtype))


def _sensor(name: str, measurement: Measurement, whole: bool) -> Sensor:
    return Sensor(name, slice(0, measurement.dimension), whole, getattr(measurement, "take", _as_they_are))


def _as_they_are(z: Array, first_epoch: int) -> Array:
    return z
