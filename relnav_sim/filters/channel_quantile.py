"""Chi-square quantiles of a normalised innovation of which some channels may be absent."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import channel_count


class ChannelQuantile:
    """The chi-square quantile of a normalised innovation, by the number of channels present.

    Args:
        measurement: The filter's.
        probability: Of a normalised innovation that is not larger.
    """

    def __init__(self, measurement: Measurement, probability: float) -> None:
        from scipy.special import chdtri

        self._measurement = measurement
        degrees = np.arange(1, measurement.dimension + 1)
        # Without a channel there is nothing to exceed.
        self._by_count = np.concatenate([[np.inf], chdtri(degrees, 1 - probability)])

    def of_present(self) -> Array:
        """Return the quantile for the channels that are present now, () or (runs,)."""
        return np.asarray(self._by_count[channel_count(self._measurement)])
