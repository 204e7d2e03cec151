"""What arrives in a chunk of epochs, sensor by sensor, and which channels the filter's measurement attends to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Integers, Mask
from relnav_sim.linalg import LOG_TWO_PI
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import Sensor, sensors_of


@dataclass(frozen=True)
class SensorReadings:
    """The measurements of one sensor over a chunk of K epochs.

    Args:
        sensor: The sensor.
        z: Measurements (K, runs, m), an epoch after the other in memory, read-only; NaN where a channel is absent.
        read: Where there is a measurement, (runs, K).
        present: Its channels (runs, K, m); None where every measurement of the chunk has all of them.
        partial: At which epochs a measurement of any run has some of its channels only, by epoch.
        any_read: At which epochs any run has a measurement, by epoch.
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
        """Return the channels (runs, m) to attend to at a partial column k; all of them in a run without a measurement.

        Such a run is updated with its own prediction and the result is not used, whatever the other runs read.
        """
        assert self.present is not None
        return self.present[:, k] | ~self.read[:, k, None]


class Readings:
    """The measurements of a filter's sensors over a chunk of epochs.

    Where every measurement of the only sensor has all its channels, nothing is done but looking. It is a context, in
    which nobody gives the measurement another function, and at whose end that counts every channel as present again.

    Args:
        measurement: The filter's.
        z: Measurements (runs, K, m), or by sensor; NaN where a channel is absent.
        first_epoch: Number of the chunk's first epoch.

    Attributes:
        sensors: The measurements by sensor, in the order in which they are processed.
        several: Whether there are several sensors.
        plain: Whether every measurement of the chunk is of one sensor and has all its channels.
    """

    def __init__(self, measurement: Measurement, z: Array | Mapping[str, Array], first_epoch: int) -> None:
        self._measurement = measurement
        sensors = sensors_of(measurement)
        given = z if isinstance(z, Mapping) else {sensors[0].name: z}
        self.sensors = tuple(_arrived(one, given[one.name], first_epoch) for one in sensors)
        self.several = len(self.sensors) > 1
        self.plain = not self.several and not any(self.sensors[0].partial)
        self._attends = False
        if self.several:
            self._expected = _joint(self.sensors)
            self._own = [self._in_all(one, True, len(one.read), bool) for one in self.sensors]

    def begin(self, k: int) -> None:
        """Let the measurement attend to all that is read at column k, for the prediction to that epoch."""
        if self.plain:
            return
        if not self.several:
            one = self.sensors[0]
            self._attend(one.mask(k) if one.partial[k] else None)
            return
        self._attend(self._expected[k])

    def attend(self, place: int, k: int) -> Array:
        """Let the measurement attend to the sensor in that place at column k.

        Returns:
            The measurement (runs, m) in the channels of the filter's measurement, NaN in runs without one.
        """
        one = self.sensors[place]
        z = one.z[k]
        mask = one.mask(k) if one.partial[k] else None
        if mask is not None:
            z = np.where(mask, z, 0.0)
        if self.several:
            self._attend(self._own[place] if mask is None else self._in_all(one, mask, len(z), bool))
            z = self._in_all(one, z, len(z), float)
        return z

    def lacking(self) -> Array | None:
        """Return what the log-likelihoods lack, (runs, K): absent channels count in their constant. None: nothing."""
        if self.plain:
            return None
        m = self._measurement.dimension
        absent = [np.where(one.read, m - one.dof, 0) for one in self.sensors]
        return np.asarray(0.5 * LOG_TWO_PI * sum(absent[1:], absent[0]))

    def _in_all(self, one: SensorReadings, values: Any, runs: int, kind: type) -> Any:
        """Return values in the channels of one sensor, (runs, m), with zeros in those of the others."""
        every: Any = np.zeros((runs, self._measurement.dimension), dtype=kind)
        every[:, one.sensor.channels] = values
        return every

    def __enter__(self) -> Readings:
        self._stand_aside(True)
        return self

    def __exit__(self, *error: object) -> None:
        """Let the measurement count every channel as present again, whatever has happened."""
        self._attend(None)
        self._stand_aside(False)

    def _stand_aside(self, aside: bool) -> None:
        stand_aside = getattr(self._measurement, "stand_aside", None)
        if stand_aside is not None:
            stand_aside(aside)

    def _attend(self, present: Mask | None) -> None:
        if present is None and not self._attends:
            return
        self._measurement.attend(present)  # type: ignore[attr-defined]  # only what has `sensors` has partial measurements
        self._attends = present is not None


def _joint(sensors: Sequence[SensorReadings]) -> Mask:
    """Return the channels (K, runs, m) that are read at an epoch; of a run that reads nothing, all are to come."""
    masks = [
        np.broadcast_to(one.read[..., None], (*one.read.shape, one.z.shape[-1]))
        if one.present is None
        else one.present & one.read[..., None]
        for one in sensors
    ]
    mask = np.concatenate(masks, axis=2)
    return np.ascontiguousarray((mask | ~mask.any(axis=2, keepdims=True)).swapaxes(0, 1))


def _arrived(sensor: Sensor, z: Array, first_epoch: int) -> SensorReadings:
    z = sensor.take(z, first_epoch)
    by_epoch = np.ascontiguousarray(z.swapaxes(0, 1)).view()
    by_epoch.flags.writeable = False  # it may be the other filters' too
    absent = np.isnan(z)
    # Channel by channel: NumPy is slow along a short last axis.
    channels = [absent[..., i] for i in range(z.shape[2])]
    missing = np.logical_or.reduce(channels)
    some = np.zeros_like(missing) if sensor.whole else missing & ~np.logical_and.reduce(channels)
    partial = _by_epoch(some.any(axis=0))
    read, present = np.asarray(~missing | some), ~absent if any(partial) else None
    return SensorReadings(
        sensor, by_epoch, read, present, partial, _by_epoch(read.any(axis=0)), _by_epoch(read.all(axis=0))
    )


def _by_epoch(mask: Any) -> list[bool]:
    flags: list[bool] = mask.tolist()
    return flags
