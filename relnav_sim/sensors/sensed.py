"""The truth as a sensor meets it."""

from __future__ import annotations

from dataclasses import dataclass

from relnav_sim.arrays import Array


@dataclass(frozen=True)
class Sensed:
    """The truth as one sensor meets it over a chunk of epochs; the leading axis is 1 where all runs share it.

    Attributes:
        times_s: The epochs (K,), s.
        host: ECI states of the sensor's host when the measurements are taken, (runs or 1, K, 6), m and m/s.
        target: The same of the other craft.
        felt: Mean specific force on the host over the step before each epoch, plain and weighted with the time that was
            left, RTN of the host, (runs or 1, K, 2, 3), m/s^2; None where no sensor asks for it.
        step_s: Time between epochs, s.
    """

    times_s: Array
    host: Array
    target: Array
    felt: Array | None
    step_s: float
