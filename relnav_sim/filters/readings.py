"""What arrives in a chunk of epochs, sensor by sensor, and which channels the filter's measurement attends to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.linalg import LOG_TWO_PI
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import Sensor, sensors_of


@dataclass(frozen=True)
class SensorReadings:
    """The readings of one sensor over a chunk of K epochs.

    Args:
        sensor: The sensor.
        z: Readings (K, runs, m), an epoch after the other in memory, read-only; NaN where a channel is absent.
        read: Where there is a reading, (runs, K).
        present: Its channels (runs, K, m); None where every reading of the chunk has all of them.
        partial: At which epochs a reading of any run has some of its channels only, by epoch.
        any_read: At which epochs any run has a reading, by epoch.
        all_read: At which epochs all runs have one, by epoch.
    """

    sensor: Sensor
    z: Array
    read: Mask
    present: Mask | None
    partial: list[bool]
    any_read: list[bool]
    all_read: list[bool]

    @property
    def dof(self) -> Integers:
        """How many channels are read, (runs, K)."""
        if self.present is None:
            return self.read * np.int64(self.z.shape[-1])
        return np.where(self.read, self.present.sum(axis=2), 0)

    def mask(self, k: int) -> Mask:
        """Return the channels (runs, m) to attend to at column k; all of them in a run without a reading.

        Such a run is updated with its own prediction and the result is not used, whatever the other runs read.
        """
        if self.present is None or not self.partial[k]:
            return np.ones(self.z[k].shape, dtype=bool)
        return self.present[:, k] | ~self.read[:, k, None]


class Readings:
    """The readings of a filter's sensors over a chunk of epochs.

    Where every reading of the only sensor has all its channels, nothing is done but looking. It is a context, at whose
    end the measurement counts every channel as present again.

    Args:
        measurement: The filter's.
        z: Readings (runs, K, m), or by sensor; NaN where a channel is absent.
        first_epoch: Number of the chunk's first epoch.

    Attributes:
        sensors: The readings by sensor, in the order in which they are processed.
        several: Whether there are several sensors.
    """

    def __init__(self, measurement: Measurement, z: Array | Mapping[str, Array], first_epoch: int) -> None:
        self._measurement = measurement
        sensors = sensors_of(measurement)
        given = z if isinstance(z, Mapping) else {sensors[0].name: z}
        self.sensors = tuple(_arrived(one, given[one.name], first_epoch) for one in sensors)
        self.several = len(self.sensors) > 1
        self._plain = not self.several and not any(self.sensors[0].partial)
        self._attends = False

    def begin(self, k: int) -> None:
        """Let the measurement attend to all that is read at column k, for the prediction to that epoch."""
        if self._plain:
            return
        if not self.several:
            one = self.sensors[0]
            self._attend(one.mask(k) if one.partial[k] else None)
            return
        masks = [one.mask(k) & one.read[:, k, None] for one in self.sensors]
        mask = np.concatenate(masks, axis=1)
        # A run that reads nothing is predicted as if all were to come.
        self._attend(mask | ~mask.any(axis=1, keepdims=True))

    def attend(self, one: SensorReadings, k: int) -> tuple[Array, Array | None]:
        """Let the measurement attend to one sensor at column k.

        Returns:
            The reading (runs, m) in the channels of the filter's measurement, NaN in runs without one; and what its
            log-likelihood lacks because absent channels count in its constant, (runs,), or None where none is absent.
        """
        z = one.z[k]
        if self._plain or not (self.several or one.partial[k]):
            return z, None
        mask = one.mask(k)
        filled = np.where(mask, z, 0.0)
        if self.several:
            channels, (runs, m) = one.sensor.channels, (len(z), self._measurement.dimension)
            own, mask = mask, np.zeros((runs, m), dtype=bool)
            own_filled, filled = filled, np.zeros((runs, m))
            mask[:, channels], filled[:, channels] = own, own_filled
            self._attend(mask)
        return filled, 0.5 * LOG_TWO_PI * (~mask).sum(axis=1)

    def __enter__(self) -> Readings:
        return self

    def __exit__(self, *error: object) -> None:
        """Let the measurement count every channel as present again, whatever has happened."""
        self._attend(None)

    def _attend(self, present: Mask | None) -> None:
        if present is None and not self._attends:
            return
        self._measurement.attend(present)  # type: ignore[attr-defined]  # only what has `sensors` has partial readings
        self._attends = present is not None


def _arrived(sensor: Sensor, z: Array, first_epoch: int) -> SensorReadings:
    z = sensor.take(z, first_epoch)
    by_epoch = np.ascontiguousarray(z.swapaxes(0, 1)).view()
    by_epoch.flags.writeable = False  # it may be the other filters' too
    absent = np.isnan(z)
    missing = absent.any(axis=2)
    some = np.zeros_like(missing) if sensor.whole else missing & ~absent.all(axis=2)
    partial = _by_epoch(some.any(axis=0))
    read, present = np.asarray(~missing | some), ~absent if any(partial) else None
    return SensorReadings(
        sensor, by_epoch, read, present, partial, _by_epoch(read.any(axis=0)), _by_epoch(read.all(axis=0))
    )


def _by_epoch(mask: Any) -> list[bool]:
    flags: list[bool] = mask.tolist()
    return flags
