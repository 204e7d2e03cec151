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
from functools import partial
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.measurements.interface import (
    CompiledUpdate,
    Measurement,
    MeasurementDefaults,
    Mixture,
    Stretch,
    has_own_density,
    linearised,
    one_by_one,
    squared_errors,
    squares_of_states,
)


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


FIXED = ("dimension", "angles", "depends_on", "states", "whole")
"""What a filter is made for; all else it asks its measurement at every epoch."""
_OWN = ("complete", "present", "sensors", "_aside", *FIXED)
MASKED = ("predict", "jacobian", "noise", "mixture", "residual", "linearised", "squared_errors", "filtered")
"""The functions of a measurement that absent channels change."""


class PartialMeasurement(MeasurementDefaults):
    """A measurement whose channels may be absent, run by run.

    Everything that is not said here is as in the measurement behind it, which is asked each time: a function that is
    assigned to it counts from then on.

    Args:
        base: The measurement with all its channels.
        name: The sensor's name, if it has one.

    Attributes:
        complete: The base.
        present: The channels (runs, m) that are present; None: all.
        sensors: The one sensor.
    """

    def __init__(self, base: Measurement, name: str = "") -> None:
        self.complete = base
        self.dimension = base.dimension
        self.angles = tuple(getattr(base, "angles", ()))
        self.depends_on = getattr(base, "depends_on", None)
        self.states = getattr(base, "states", None)
        self.whole = getattr(base, "whole", False)
        self.present: Mask | None = None
        self._aside = False
        self.sensors = (_sensor(name, base, self.whole),)

    def __getattr__(self, name: str) -> Any:
        if name == "complete":
            raise AttributeError(name)  # while it is unpickled
        return getattr(self.complete, name)

    def __setattr__(self, name: str, value: Any) -> None:
        """Give what a user assigns to the base, which is as if it had had it from the first."""
        if name in ("present", "_aside") or (name in _OWN and name not in vars(self)):
            object.__setattr__(self, name, value)
        else:
            setattr(self.complete, name, value)

    def attend(self, present: Mask | None) -> None:
        """Count the channels (runs, m) as present and the others as absent; None: all are present."""
        before, self.present = self.present, present
        if self._aside and (before is None) != (present is None):
            self._put_aside()

    def stand_aside(self, aside: bool) -> None:
        """Let the functions be those of the base themselves, or be asked for at each call again.

        While a chunk of epochs is filtered they are called so often that asking would show. Nobody assigns others then.
        """
        self._aside = aside
        self._put_aside()

    def _put_aside(self) -> None:
        for name in MASKED:
            vars(self).pop(name, None)
        if self._aside and self.present is None:
            vars(self).update({name: getattr(self.complete, name) for name in MASKED if hasattr(self.complete, name)})

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a measurement that is not what the filter was made for, or a block that it is not for.

        Raises:
            ValueError: It has other angles, say, or other runs, or more epochs, than its noise.
        """
        for name in FIXED:
            made_for, now = vars(self)[name], getattr(self.complete, name, vars(self)[name])
            if not np.array_equal(now, made_for):
                raise ValueError(
                    f"{name} of the measurement is {now!r}, and was {made_for!r} when the filter was made; make it "
                    "again by create_filter"
                )
        check_extent = getattr(self.complete, "check_extent", None)
        if check_extent is not None:
            check_extent(runs, epochs)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states), zero in absent channels."""
        predicted = self.complete.predict(states, epoch)
        return predicted if self.present is None else zero_absent(predicted, self.present)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx, rows of zeros for absent channels."""
        H = self.complete.jacobian(states, epoch)
        return H if self.present is None else zero_absent_rows(H, self.present, states.shape[:-1])

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R, with a variance of 1 and no correlation for absent channels."""
        R = self.complete.noise(mean, epoch)
        return R if self.present is None else unit_where_absent(R, self.present)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the noise, each with a variance of 1 for absent channels."""
        mixture = self.complete.mixture(mean, epoch)
        if mixture is None or self.present is None:
            return mixture
        covariances = unit_where_absent(mixture.covariances, self.present[:, None])
        return Mixture(mixture.weights, covariances, mixture.shared)

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return the base's residual, zero in absent channels."""
        residual = self.complete.residual(z, predicted)
        return residual if self.present is None else zero_absent(residual, self.present)

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual, dh/dx and R at the means, as the base has them where nothing is absent."""
        if self.present is None:
            return linearised(self.complete, z, mean, epoch)
        return one_by_one(self, z, mean, epoch)

    def squared_errors(self, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
        """Return squared errors of samples, as the base has them where nothing is absent."""
        if self.present is None:
            return squared_errors(self.complete, z, W, centre, root, e, epoch)
        return squares_of_states(self, z, W, centre, root, e, epoch)

    def filtered(
        self, mean: Array, covariance: Array, F: Array, Q: Array, update: CompiledUpdate, stretch: Stretch
    ) -> int | None:
        """Fill a stretch as the base does; None where it can't, or something is absent."""
        own = getattr(self.complete, "filtered", None) if self.present is None else None
        return None if own is None else own(mean, covariance, F, Q, update, stretch)

    @property
    def log_likelihood(self) -> Callable[[Array, Array, int], Array]:  # whose it is may change
        """The base's own density where it has one, else the one that follows from the functions above."""
        return self._own_density if has_own_density(self.complete) else super().log_likelihood

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
    return Sensor(name, slice(0, measurement.dimension), whole, partial(_taken, measurement))


def _taken(measurement: Measurement, z: Array, first_epoch: int) -> Array:
    """Return what the `take` of a measurement makes of z now, or z where it has none."""
    take: Callable[[Array, int], Array] | None = getattr(measurement, "take", None)
    return z if take is None else take(z, first_epoch)
