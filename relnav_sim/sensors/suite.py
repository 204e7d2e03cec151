"""All sensors of a campaign over one block of runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.coast import coasted
from relnav_sim.sensors.campaign_sensors import Sensors, reading_names
from relnav_sim.sensors.due import due
from relnav_sim.sensors.interface import Craft, RelativeSensorOptions, Sensed, SensorOptions
from relnav_sim.sensors.noise import noise_parts
from relnav_sim.sensors.streams import SensorStreams
from relnav_sim.streams import RandomSource
from relnav_sim.truth.thrust import CRAFT


class TrueStates(Protocol):
    """What the sensors need of the truth: epochs (K,) and ECI states (runs or 1, K, 6), m and m/s."""

    @property
    def times_s(self) -> Array:
        """Epochs (K,), s."""
        ...

    @property
    def chief(self) -> Array:
        """States of the chief."""
        ...

    @property
    def deputy(self) -> Array:
        """States of the deputy."""
        ...


@dataclass(frozen=True)
class _Reader:
    """One sensor on one craft: its options, its host and its random numbers."""

    options: SensorOptions
    host: Craft
    streams: SensorStreams


def streams_of(name: str, options: SensorOptions, host: Craft, source: RandomSource, step_s: float) -> SensorStreams:
    """Return the random numbers of one sensor on one craft."""
    stem = f"{name}.{host}" if options.per_craft else name
    return SensorStreams(stem, noise_parts(options.noise), len(options.channels), source, step_s)


StreamsMaker = Callable[[str, SensorOptions, Craft, RandomSource, float], SensorStreams]
"""Makes the random numbers of one sensor on one craft, as `streams_of` does."""


class SensorSuite:
    """The sensors over one block of runs; they remember where the last chunk of epochs ended.

    A run's measurements do not depend on the block it is in, on how the epochs are split, or on which other sensors
    there are.

    Args:
        sensors: The sensors by name.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.
        streams: Makes the random numbers of each sensor; default: those of the seed and the runs.

    Raises:
        ValueError: A sensor's period is no multiple of the step.
    """

    def __init__(
        self, sensors: Sensors, source: RandomSource, step_s: float, streams: StreamsMaker = streams_of
    ) -> None:
        self._step_s = step_s
        self._runs = len(source.runs)
        self._readers: dict[str, _Reader] = {}
        for options in sensors.values():
            due(np.arange(1), options.period_s, options.offset_s, step_s)
        for reading, (name, host) in reading_names(sensors).items():
            options = sensors[name]
            self._readers[reading] = _Reader(options, host, streams(name, options, host, source, step_s))
        self._next_epoch = 0

    def measure(
        self,
        truth: TrueStates,
        first_epoch: int,
        earlier: Callable[[float], tuple[Array, Array]] | None = None,
        felt: Array | None = None,
    ) -> dict[str, Array]:
        """Return what each sensor reads over the next chunk of epochs.

        Args:
            truth: Epochs and true states of the chunk.
            first_epoch: Number of its first epoch; chunks follow one another from epoch 0.
            earlier: Gives the states of chief and deputy, (runs or 1, K, 6), so many seconds before the epochs, NaN
                before the start; sensors with a latency need it.
            felt: Specific force on both craft, as `TruthTrajectory.felt` gives it; accelerometers need it.

        Returns:
            By sensor, NaN where nothing is measured: the sensor's measurement (runs, K, m) as its options describe it;
            of a sensor that both craft may carry, ``chief_NAME`` and ``deputy_NAME``.

        Raises:
            ValueError: The chunk does not follow the last one, a sensor returned another shape, or something that a
                sensor needs is missing.
        """
        if first_epoch != self._next_epoch:
            raise ValueError(f"the next epoch to measure is {self._next_epoch}, not {first_epoch}")
        self._next_epoch += len(truth.times_s)
        return {
            name: self._read(name, reader, truth, first_epoch, earlier, felt) for name, reader in self._readers.items()
        }

    def _read(
        self,
        name: str,
        reader: _Reader,
        truth: TrueStates,
        first_epoch: int,
        earlier: Callable[[float], tuple[Array, Array]] | None,
        felt: Array | None,
    ) -> Array:
        options, times_s = reader.options, truth.times_s
        states = truth.chief, truth.deputy
        late_s = None
        if isinstance(options, RelativeSensorOptions):
            if options.latency_s:
                if earlier is None:
                    raise ValueError(f"the sensor {name} has a latency and needs the states some time ago")
                states = earlier(options.latency_s)
            late_s = _late(options, reader.streams, len(times_s))
        if late_s is not None:
            states = coasted(states[0], late_s), coasted(states[1], late_s)
        if options.role == "force" and felt is None:
            raise ValueError("accelerometers need the specific force that the craft feel")
        host, target = states if reader.host == "chief" else states[::-1]
        own = None if felt is None else felt[:, :, CRAFT.index(reader.host)]
        truth_met = Sensed(times_s, host, target, own, self._step_s)
        for fault in reader.streams.faults:
            truth_met = fault.seen(truth_met)
        z = options.sample(truth_met, reader.streams)
        epochs = np.arange(first_epoch, first_epoch + len(times_s))
        read = due(epochs, options.period_s, options.offset_s, self._step_s)
        if not read.all():
            z[:, ~read] = np.nan
        for fault in reader.streams.faults:
            z = fault.reported(z, times_s)
        return z


def _late(options: RelativeSensorOptions, streams: SensorStreams, epochs: int) -> Array | None:
    """Return how much later than they say measurements are taken, (runs, K or 1), s; None where they are not."""
    if not options.time_tag_sigma_s and not options.time_tag_jitter_s:
        return None
    constant = options.time_tag_sigma_s * streams.constant("time_tag", 1)
    if options.time_tag_jitter_s:
        return constant + options.time_tag_jitter_s * streams.normal("time_tag_jitter", epochs)
    return constant
