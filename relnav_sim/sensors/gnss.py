"""GNSS receiver: inertial position and velocity of the craft that carries the radar."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from relnav_sim.options import Options
from relnav_sim.sensors.noise import GaussianNoise, Noise, NoiseOption, check_parts, noise_parts
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]
CHANNELS = 6


class GnssOptions(Options):
    """GNSS receiver on the craft that carries the radar: its ECI position and velocity at every step.

    The front end builds the orbit frame from them. Without a receiver in the campaign the orbit frame is perfect.
    """

    position_sigma_m: float = Field(gt=0, description="Position noise per axis, 1 sigma, m")
    velocity_sigma_m_s: float = Field(gt=0, description="Velocity noise per axis, 1 sigma, m/s")
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, three channels of position and three of velocity: one part or a "
        "list of parts that add; default: white Gaussian. Real solutions are largely gauss_markov, tau_s 100 to 3600",
    )

    @field_validator("noise")
    @classmethod
    def _fits(cls, noise: NoiseOption) -> NoiseOption:
        check_parts(noise_parts(noise), CHANNELS)
        return noise

    @property
    def sigmas(self) -> Array:
        """Standard deviations (6,), m and m/s."""
        return np.repeat([self.position_sigma_m, self.velocity_sigma_m_s], 3)


class Gnss:
    """The receiver over one block of runs.

    Args:
        options: How badly it measures.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.
    """

    def __init__(self, options: GnssOptions, source: RandomSource, step_s: float) -> None:
        self._sigmas = options.sigmas
        self._noise = Noise(noise_parts(options.noise), "gnss", source, CHANNELS, step_s)

    def measure(self, times_s: Array, carrier: Array) -> Array:
        """Return the measured ECI states (runs, K, 6), m and m/s; NaN where there is no solution.

        Args:
            times_s: Epochs (K,), the ones that follow the last call's.
            carrier: ECI states of the craft, (runs or 1, K, 6).
        """
        z = self._noise.sample(times_s)
        z *= self._sigmas
        z += carrier
        return z
