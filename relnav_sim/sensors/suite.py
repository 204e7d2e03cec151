"""All sensors of a campaign over one block of runs."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from relnav_sim.sensors.accelerometer import Accelerometer
from relnav_sim.sensors.gnss import Gnss
from relnav_sim.sensors.options import SensorsOptions
from relnav_sim.sensors.radar import Radar
from relnav_sim.sensors.star_tracker import StarTracker
from relnav_sim.streams import RandomSource
from relnav_sim.truth.thrust import CRAFT

Array = NDArray[np.float64]


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


def carrier_and_other(options: SensorsOptions, truth: TrueStates) -> tuple[Array, Array]:
    """Return the true ECI states of the radar's carrier and of the craft it looks at."""
    if options.radar is not None and options.radar.carrier == "deputy":
        return truth.deputy, truth.chief
    return truth.chief, truth.deputy


class SensorSuite:
    """The sensors over one block of runs; they remember where the last chunk of epochs ended.

    A run's readings do not depend on the block it is in, on how the epochs are split, or on which other sensors
    there are.

    Args:
        options: The sensors.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.

    Raises:
        ValueError: The radar's period is no multiple of the step.
    """

    def __init__(self, options: SensorsOptions, source: RandomSource, step_s: float) -> None:
        self._options = options
        self._radar = None if options.radar is None else Radar(options.radar, source, step_s)
        self._gnss = None if options.gnss is None else Gnss(options.gnss, source, step_s)
        self._star_tracker = None if options.star_tracker is None else StarTracker(options.star_tracker, source, step_s)
        force = options.accelerometer
        self._accelerometers: dict[str, Accelerometer] = {}
        if force is not None:
            self._accelerometers = {craft: Accelerometer(force, craft, source, step_s) for craft in force.craft}
        self._next_epoch = 0

    def measure(
        self,
        truth: TrueStates,
        first_epoch: int,
        seen: tuple[Array, Array] | None = None,
        felt: Array | None = None,
    ) -> dict[str, Array]:
        """Return what each sensor reads over the next chunk of epochs.

        Args:
            truth: Epochs and true states of the chunk.
            first_epoch: Number of its first epoch; chunks follow one another from epoch 0.
            seen: States of chief and deputy, (runs or 1, K, 6), at the times at which a radar with latency looks, NaN
                before the start; default: those of the epochs.
            felt: Specific force on both craft, as `TruthTrajectory.felt` gives it; accelerometers need it.

        Returns:
            By sensor, NaN where nothing is measured: ``radar`` (runs, K, 3) range (m), azimuth, elevation (rad);
            ``gnss`` (runs, K, 6) ECI state of the carrier (m, m/s); ``star_tracker`` (runs, K, 4) attitude
            quaternion (x, y, z, w) of the carrier's body; ``chief_accelerometer`` and ``deputy_accelerometer``
            (runs, K, 6) two means of the specific force over the step before (m/s^2, RTN of the craft).

        Raises:
            ValueError: The chunk does not follow the last one, or there are accelerometers and nothing is felt.
        """
        if first_epoch != self._next_epoch:
            raise ValueError(f"the next epoch to measure is {self._next_epoch}, not {first_epoch}")
        times = truth.times_s
        self._next_epoch += len(times)
        carrier, other = carrier_and_other(self._options, truth)
        readings = {}
        if self._radar is not None:
            looking, target = carrier, other
            if seen is not None:
                looking, target = seen if carrier is truth.chief else seen[::-1]
            readings["radar"] = self._radar.measure(times, looking, target, first_epoch)
        if self._gnss is not None:
            readings["gnss"] = self._gnss.measure(times, carrier)
        if self._star_tracker is not None:
            readings["star_tracker"] = self._star_tracker.measure(times, carrier)
        for craft, accelerometer in self._accelerometers.items():
            if felt is None:
                raise ValueError("accelerometers need the specific force that the craft feel")
            readings[f"{craft}_accelerometer"] = accelerometer.measure(times, felt[:, :, CRAFT.index(craft)])
        return readings
