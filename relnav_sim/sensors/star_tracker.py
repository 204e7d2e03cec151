"""Star tracker: inertial attitude of the body that carries the radar."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from relnav_sim.astro.attitude import nadir_axes, quaternion_from_axes, turned
from relnav_sim.astro.line_of_sight import ARCSEC, components, rotate, rows
from relnav_sim.options import Options
from relnav_sim.sensors.noise import GaussianNoise, Noise, NoiseOption, check_parts, noise_parts
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]
CHANNELS = 3


class StarTrackerOptions(Options):
    """Star tracker on the craft that carries the radar: its body's attitude at every step.

    Three small turns corrupt the attitude: two across the boresight, and a larger one about it. Without a tracker in
    the campaign the body's attitude in inertial space is known perfectly.
    """

    cross_boresight_sigma_arcsec: float = Field(
        gt=0, lt=36000, description="Turn about each axis across the boresight, 1 sigma, arcsec"
    )
    about_boresight_sigma_arcsec: float = Field(
        gt=0, lt=36000, description="Turn about the boresight, 1 sigma, arcsec; commonly 3 to 10 times the other"
    )
    boresight_body: tuple[float, float, float] = Field(
        default=(0.0, 1.0, 0.0),
        description="Direction of the boresight in the body's nadir frame (x along-track, y minus orbit normal, "
        "z nadir), of any length; default: across the orbit, away from Earth and, mostly, Sun. A turn about the "
        "line of sight does no harm, so a boresight towards the target is the kindest to the radar",
    )
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, channels cross, cross, about: one part or a list of parts that "
        "add; default: white Gaussian. A white share of 0.84 beside a gauss_markov share of 0.55 with tau_s 60 is a "
        "fair picture of a real tracker",
    )

    @field_validator("noise")
    @classmethod
    def _fits(cls, noise: NoiseOption) -> NoiseOption:
        check_parts(noise_parts(noise), CHANNELS)
        return noise

    @field_validator("boresight_body")
    @classmethod
    def _is_direction(cls, boresight: tuple[float, float, float]) -> tuple[float, float, float]:
        if not any(boresight):
            raise ValueError("must not be zero: it is a direction")
        return boresight

    @property
    def sigmas(self) -> Array:
        """Standard deviations (3,) of the turns across, across and about the boresight, rad."""
        cross, about = self.cross_boresight_sigma_arcsec, self.about_boresight_sigma_arcsec
        return np.array([cross, cross, about]) * ARCSEC

    @property
    def axes(self) -> Array:
        """The tracker's axes as columns (3, 3) in the body: two across the boresight, and the boresight."""
        boresight = np.array(self.boresight_body) / np.linalg.norm(self.boresight_body)
        first = np.cross(boresight, np.eye(3)[np.argmin(np.abs(boresight))])
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(boresight, first), boresight], axis=1)


class StarTracker:
    """The tracker over one block of runs.

    Args:
        options: How badly it measures, and where it looks.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.
    """

    def __init__(self, options: StarTrackerOptions, source: RandomSource, step_s: float) -> None:
        self._body_from_tracker = rows(options.axes * options.sigmas)
        self._noise = Noise(noise_parts(options.noise), "star_tracker", source, CHANNELS, step_s)

    def measure(self, times_s: Array, carrier: Array) -> Array:
        """Return the body's attitude as a quaternion (x, y, z, w), (runs, K, 4); NaN where there is none.

        The quaternion turns ECI into body components, v_body = C(q) v_eci; scipy's Rotation.from_quat(q) is its
        inverse, from body to ECI.

        Args:
            times_s: Epochs (K,), the ones that follow the last call's.
            carrier: ECI states of the craft, whose body keeps to its nadir frame, (runs or 1, K, 6).
        """
        error = rotate(self._body_from_tracker, components(self._noise.sample(times_s)))
        attitude = turned(quaternion_from_axes(nadir_axes(carrier)), error)
        return np.stack(attitude, axis=-1)
