"""Radar: range, azimuth and elevation of the other craft."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from relnav_sim.astro.attitude import in_axes, nadir_axes
from relnav_sim.astro.constants import MU_M3_S2
from relnav_sim.astro.line_of_sight import (
    Vector,
    components,
    dot,
    half_open,
    mounting_matrix,
    polar,
    rotate,
    rows,
)
from relnav_sim.options import Options
from relnav_sim.sensors.noise import GaussianNoise, Noise, NoiseOption, check_parts, has_white_part, noise_parts
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]
CHANNELS = 3
HalfAngle = Annotated[float, Field(gt=0, le=180)]


class RadarOptions(Options):
    """Radar that measures range, azimuth and elevation of the other craft.

    It is mounted in a body that keeps to its carrier's nadir frame: x along-track, y minus orbit normal, z nadir.
    Azimuth counts from the radar's x axis towards y, elevation towards minus z. GNSS receiver and star tracker, if
    any, are on the same craft.
    """

    carrier: Literal["chief", "deputy"] = Field(
        default="chief",
        description="Craft that carries the radar and sees the other one; default: the chief (Shi et al. 2025). In "
        "Wei, Song and Zhang (2012) it is the deputy",
    )
    range_sigma_m: float = Field(gt=0, description="Range noise, 1 sigma, m")
    angle_sigma_deg: float = Field(gt=0, lt=90, description="Noise of azimuth and of elevation, 1 sigma, deg")
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of these sigmas, channels range, azimuth, elevation: one part or a list of parts "
        "that add; default: white Gaussian",
    )
    range_bias_m: float = Field(default=0.0, description="Constant range error, m; no filter is told of it")
    azimuth_bias_deg: float = Field(default=0.0, description="Constant azimuth error, deg; no filter is told of it")
    elevation_bias_deg: float = Field(default=0.0, description="Constant elevation error, deg; no filter is told of it")
    mounting_deg: tuple[float, float, float] = Field(
        default=(0.0, 0.0, 0.0),
        description="Yaw, pitch and roll from the nadir frame to the radar frame, deg, about z, the new y and the new "
        "x; default: aligned, so that azimuth 0 is straight ahead. The azimuth does not exist on the radar's z axis",
    )
    range_limits_m: tuple[float, float] | None = Field(
        default=None, description="Shortest and longest true range that is measured, m; default: no limits"
    )
    field_of_view_deg: tuple[HalfAngle, HalfAngle] | None = Field(
        default=None,
        description="Half angles of the field of view in azimuth and elevation about the boresight, deg; default: all "
        "round",
    )
    boresight: Literal["fixed", "tracking"] = Field(
        default="fixed",
        description="fixed: along the radar's x axis; tracking: gimballed to the other craft, so that the field of "
        "view never cuts, the angles still counted from the mounting (the gimbal's are known)",
    )
    period_s: float | None = Field(
        default=None,
        gt=0,
        description="Time between readings, s, a multiple of the clock's step; default: every step",
    )
    latency_s: float = Field(
        default=0.0,
        ge=0,
        description="The reading of an epoch was taken this long before it, s; a filter's `assumed_latency` says "
        "whether it knows; default 0",
    )
    time_tag_sigma_s: float = Field(
        default=0.0,
        ge=0,
        description="Standard deviation of each run's constant error of the time at which readings are taken, s; no "
        "filter is told of it; default 0",
    )
    time_tag_jitter_s: float = Field(
        default=0.0, ge=0, description="The same of each reading, white, s; no filter is told of it; default 0"
    )

    @field_validator("noise")
    @classmethod
    def _can_be_weighed(cls, noise: NoiseOption) -> NoiseOption:
        parts = noise_parts(noise)
        check_parts(parts, CHANNELS)
        if not has_white_part(parts):
            raise ValueError("the radar's noise needs a gaussian or mixture part: no filter can weigh it without")
        return noise

    @field_validator("range_limits_m")
    @classmethod
    def _rising(cls, limits: tuple[float, float] | None) -> tuple[float, float] | None:
        if limits is not None and not 0 <= limits[0] < limits[1]:
            raise ValueError(f"[{limits[0]:g}, {limits[1]:g}] must be two rising values from 0 up")
        return limits

    @property
    def mounting(self) -> Array:
        """Rotation (3, 3) from the carrier's nadir frame to the radar frame."""
        return mounting_matrix(*self.mounting_deg)

    @property
    def sigmas(self) -> Array:
        """Standard deviations (3,) of range (m), azimuth and elevation (rad)."""
        angle = np.radians(self.angle_sigma_deg)
        return np.array([self.range_sigma_m, angle, angle])

    @property
    def biases(self) -> Array:
        """Constant errors (3,) of range (m), azimuth and elevation (rad)."""
        return np.array([self.range_bias_m, *np.radians([self.azimuth_bias_deg, self.elevation_bias_deg])])


def steps_per_reading(period_s: float | None, step_s: float) -> int:
    """Return after how many steps the next reading is due.

    Raises:
        ValueError: The period is no multiple of the step.
    """
    if period_s is None:
        return 1
    count = round(period_s / step_s)
    if count < 1 or abs(count * step_s - period_s) > 1e-9 * period_s:
        raise ValueError(f"period_s {period_s:g} s is no whole number of steps of {step_s:g} s")
    return count


def true_reading(options: RadarOptions, carrier: Array, other: Array) -> Vector:
    """Return the range (m), azimuth and elevation (rad) that a perfect radar would read, each (runs or 1, K).

    Args:
        options: The radar, whose mounting counts.
        carrier: ECI states of the craft with the radar, (runs or 1, K, 6).
        other: ECI states of the craft it looks at, (runs or 1, K, 6).
    """
    difference = other[..., :3] - carrier[..., :3]
    in_nadir = in_axes(nadir_axes(carrier), (difference[..., 0], difference[..., 1], difference[..., 2]))
    return polar(rotate(rows(options.mounting), in_nadir))


def in_sight(options: RadarOptions, reading: Vector) -> NDArray[np.bool_]:
    """Return where a true reading is within the range limits and the field of view."""
    distance, azimuth, elevation = reading
    seen = np.asarray(distance != 0)  # or there is no direction
    if options.range_limits_m is not None:
        nearest, farthest = options.range_limits_m
        seen &= (distance >= nearest) & (distance <= farthest)
    if options.field_of_view_deg is not None and options.boresight == "fixed":
        half_azimuth, half_elevation = np.radians(options.field_of_view_deg)
        seen &= (np.abs(azimuth) <= half_azimuth) & (np.abs(elevation) <= half_elevation)
    return seen


def _coasted(states: Array, late_s: Array) -> Array:
    """Return states (runs or 1, K, 6), ECI, a little later, (runs, K or 1) s: free fall to second order."""
    position, velocity, late = states[..., :3], states[..., 3:], late_s[..., None]
    squared = dot(components(states), components(states))
    fall = (-MU_M3_S2 / (squared * np.sqrt(squared)))[..., None] * position
    return np.concatenate([position + late * (velocity + late / 2 * fall), velocity + late * fall], axis=-1)


class Radar:
    """The radar over one block of runs.

    Args:
        options: What it measures and how badly.
        source: Seed and runs of the block.
        step_s: Time between epochs, s.

    Raises:
        ValueError: The period is no multiple of the step.
    """

    def __init__(self, options: RadarOptions, source: RandomSource, step_s: float) -> None:
        self._options = options
        self._biases = options.biases
        self._every = steps_per_reading(options.period_s, step_s)
        self._noise = Noise(noise_parts(options.noise), "radar", source, CHANNELS, step_s)
        self._late_s = options.time_tag_sigma_s * source.streams("sensor.radar.time_tag").normal(1)
        self._jitter = source.streams("sensor.radar.time_tag_jitter") if options.time_tag_jitter_s else None

    def measure(self, times_s: Array, carrier: Array, other: Array, first_epoch: int) -> Array:
        """Return range (m), azimuth and elevation (rad, in (-pi, pi]), (runs, K, 3); NaN where nothing is measured.

        A reading whose range would not be positive does not exist.

        Args:
            times_s: Epochs (K,), the ones that follow the last call's.
            carrier: ECI states of the craft with the radar when it looks, (runs or 1, K, 6).
            other: ECI states of the craft it looks at, (runs or 1, K, 6), at the same time.
            first_epoch: Number of the first epoch; readings are due at whole numbers of periods.
        """
        if self._late_s.any() or self._jitter is not None:
            late_s = self._late_s
            if self._jitter is not None:
                late_s = late_s + self._options.time_tag_jitter_s * self._jitter.normal(len(times_s))
            carrier, other = _coasted(carrier, late_s), _coasted(other, late_s)
        truth = true_reading(self._options, carrier, other)
        measured = in_sight(self._options, truth) & (
            np.arange(first_epoch, first_epoch + len(times_s)) % self._every == 0
        )
        z = self._noise.sample(times_s)
        z *= self._options.sigmas
        z += np.stack(truth, axis=-1) + self._biases
        z[..., 1:] = half_open(z[..., 1:])
        # A radar finds no echo before it has sent its pulse.
        measured = measured & (z[..., 0] > 0)
        if not measured.all():
            z[~measured] = np.nan
        return z
