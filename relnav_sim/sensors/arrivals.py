"""When measurements arrive: at their own epoch, or later by a time drawn for each."""

from __future__ import annotations

from math import floor

import numpy as np

from relnav_sim.arrays import Integers
from relnav_sim.sensors.campaign_sensors import Sensors, relative_sensors
from relnav_sim.streams import RandomSource


def most_epochs_late(drawn_latency_s: tuple[float, float], step_s: float) -> int:
    """Return the most epochs after its own at which a measurement arrives."""
    return floor(drawn_latency_s[1] / step_s + 1e-9)


class Arrivals:
    """Draws the latency of every measurement of a block; chunks follow one another from epoch 0.

    Args:
        sensors: The sensors by name.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.
    """

    def __init__(self, sensors: Sensors, source: RandomSource, step_s: float) -> None:
        self._step_s = step_s
        self._drawn = {
            name: (each.drawn_latency_s, source.streams(f"sensor.{name}.latency"))
            for name, each in relative_sensors(sensors).items()
            if each.drawn_latency_s is not None
        }

    def delays(self, epochs: int) -> dict[str, Integers]:
        """Return how many epochs after its own a measurement of each of the next epochs arrives, (runs, epochs).

        By the sensors that draw a latency. What an epoch's estimate is to know must have arrived before the next epoch.
        """
        found = {}
        for name, (limits, streams) in self._drawn.items():
            latency_s = limits[0] + (limits[1] - limits[0]) * streams.uniform(epochs)
            found[name] = np.floor(latency_s / self._step_s + 1e-9).astype(np.int64)
        return found
