"""What every sensor is: its options in a campaign, what it reads of the truth, and what a filter is told of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from relnav_sim.arrays import Array, Mask
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.augmentation.kinds import AugmentedStateOption
from relnav_sim.measurements.augmented import AdditiveBias, Distortion
from relnav_sim.measurements.channel import Channel
from relnav_sim.measurements.interface import Measurement
from relnav_sim.options import AddedLater, Effect, Options
from relnav_sim.sensors.host_frame import HostFrame
from relnav_sim.sensors.noise import GaussianNoise, NoiseOption, check_parts, constant_part, has_white_part, noise_parts
from relnav_sim.sensors.sensed import Sensed as Sensed
from relnav_sim.sensors.streams import SensorStreams

Craft = Literal["chief", "deputy"]
Role = Literal["other", "orbit", "attitude", "force"]
Form = Literal["spherical", "cartesian"]
AssumedNoise = Literal["nominal", "total", "mixture"]

ECI_STATE = (
    *(Channel(f"position_{axis}", "m", f"ECI position {axis}") for axis in "xyz"),
    *(Channel(f"velocity_{axis}", "m/s", f"ECI velocity {axis}") for axis in "xyz"),
)
OWN_READINGS: Mapping[Role, tuple[Channel, ...]] = {
    "orbit": ECI_STATE,
    "attitude": tuple(Channel(f"quaternion_{part}", "", f"attitude quaternion {part}") for part in "xyzw"),
    "force": tuple(
        Channel(f"{mean}force_{axis}", "m/s^2", f"{mean}specific force, {axis}".replace("_", " "))
        for mean in ("", "weighted_")
        for axis in ("radial", "along", "normal")
    ),
}
"""The numbers of a measurement of a host's own state: an ECI state; a quaternion, scalar last, that turns ECI into body
components; two means of the specific force over the step before, plain and weighted with the time left, RTN."""


@dataclass(frozen=True)
class MeasurementContext:
    """What a filter may be told around a sensor's own options; never the truth of a run.

    Attributes:
        orbit: The chief's nominal orbit, where it was when the measurement of epoch 0 was taken.
        attitude: Covariance (3, 3) of the white error of the host's attitude in its orbit frame, about the LVLH
            frame's axes (x along-track, y minus orbit normal, z nadir), rad^2.
        assumed_noise: The noise that the filter believes in: nominal, total or mixture.
        form: The form that it takes measurements in: ``spherical``, as they are read, or ``cartesian``.
        step_s: Time between epochs, s.
        frame: Covariance (6, 6) of the white error of the orbit frame alone in inertial space, RTN: its turn, rad, and
            the error of its rate, rad/s, as `astro.frame_error` has them; zero where the host knows its orbit
            perfectly. Its turn is in `attitude` already.
    """

    orbit: ChiefOrbit
    attitude: Array
    assumed_noise: AssumedNoise
    form: Form
    step_s: float
    frame: Array = field(default_factory=lambda: np.zeros((6, 6)))


@dataclass(frozen=True)
class ErrorShares:
    """What a filter's augmented states b (e,) do to a sensor's measurements.

    Attributes:
        channels: By the name of a channel, what each state adds to it, (e,), SI units.
        turn: The turn of the host's body that each state is, about the LVLH frame's axes, (3, e), rad.
    """

    channels: Mapping[str, Array]
    turn: Array


class SensorOptions(Options):
    """The options of a sensor and what it does; a new kind is a subclass, registered under the kind's name.

    Attributes:
        channels: The numbers of one measurement.
        role: What it measures: the ``other`` craft, so that filters can go by it, or its host's own ``orbit`` (an ECI
            state), ``attitude`` (a quaternion) or ``force`` (specific force).
        per_craft: Whether both craft may carry one; measurements and random numbers then have the craft in their names.
        forms: The forms that filters can take its measurements in; the first is the usual one.
        linear_forms: Those of them that are linear in the state.
        error_states: Kinds of the augmented states by which a filter can carry its constant or slow errors.
    """

    channels: ClassVar[tuple[Channel, ...]]
    role: ClassVar[Role]
    per_craft: ClassVar[bool] = False
    forms: ClassVar[tuple[Form, ...]] = ("spherical",)
    linear_forms: ClassVar[tuple[Form, ...]] = ()
    error_states: ClassVar[tuple[str, ...]] = ()

    kind: str
    host: Annotated[Craft | Literal["both"] | None, AddedLater()] = Field(
        default=None, description="Craft that carries it; default: the one that carries the relative sensors"
    )
    noise: NoiseOption = Field(
        default=GaussianNoise(),
        description="Noise in units of the sigmas, one channel each: one part or a list of parts that add; default: "
        "white Gaussian",
    )
    period_s: Annotated[float | None, AddedLater(), Effect("period", "absence")] = Field(
        default=None,
        gt=0,
        description="Time between measurements, s, a multiple of the clock's step; default: every step",
    )
    offset_s: Annotated[float, AddedLater()] = Field(
        default=0.0, ge=0, description="Time of the first measurement, s, a multiple of the clock's step; default 0"
    )

    @field_validator("host")
    @classmethod
    def _carried(cls, host: str | None) -> str | None:
        if host == "both" and not cls.per_craft:
            raise ValueError(
                "one sensor of this kind is on one craft, chief or deputy; for the other craft give a second sensor of "
                "the kind, under a name of its own"
            )
        return host

    @field_validator("noise")
    @classmethod
    def _fits(cls, noise: NoiseOption) -> NoiseOption:
        check_parts(noise_parts(noise), len(cls.channels))
        if cls.role != "other" and any(getattr(part, "needs_other", False) for part in noise_parts(noise)):
            raise ValueError("wrong_target is for sensors that measure the other craft; take step, ramp or stuck")
        return cls.with_white_part(noise)

    @classmethod
    def with_white_part(cls, noise: NoiseOption) -> NoiseOption:
        """Return the noise, of a sensor that filters go by with a white part.

        Raises:
            ValueError: It has none.
        """
        if cls.role == "other" and not has_white_part(noise_parts(noise)):
            raise ValueError("the noise needs a gaussian or mixture part: no filter can weigh it without")
        return noise

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(channel.name for channel in self.channels)

    @property
    def reading(self) -> tuple[Channel, ...]:
        """The m numbers that `sample` returns of one measurement, as files of measurements name them.

        By default those of `OWN_READINGS` for the sensor's role, the channels where it measures the other craft.
        """
        return OWN_READINGS.get(self.role, self.channels)

    @property
    def sigmas(self) -> Array:
        """Standard deviations (m,) of the channels, SI units, by which the noise is multiplied."""
        raise NotImplementedError(f"{type(self).__name__} has no sigmas")

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the measurements (runs, K, m), SI units; NaN in a channel where nothing is read.

        The measurements of a run may depend on no other run, and not on how the epochs are split: random numbers come
        from `streams`, which go on from chunk to chunk. Measurements that are not due are left out by the caller.

        Args:
            truth: The true states when they are taken.
            streams: The sensor's random numbers.
        """
        raise NotImplementedError(f"{type(self).__name__} has no sample(truth, streams)")

    def slow_errors(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the errors of the channels in truth that are not white, (runs or 1, K, m), SI units.

        NaN where they are not known. By default the constant ones.

        Args:
            truth: The true states.
            streams: The sensor's random numbers; only those that each run keeps may be drawn from it.
        """
        return self.constant_errors()[None, None]

    def constant_errors(self) -> Array:
        """Return the constant errors (m,) of the channels in truth, SI units; NaN where they drift."""
        return constant_part(noise_parts(self.noise), len(self.channels)) * self.sigmas


class RelativeSensorOptions(SensorOptions):
    """A sensor that measures the other craft: what a filter is told of it, and when it reads.

    Attributes:
        direction_from: What its host must know of itself for the channels that need a direction: its ``orbit``, and the
            ``attitude`` of its body unless the sensor's own axes are inertial.
    """

    role: ClassVar[Role] = "other"
    direction_from: ClassVar[tuple[Role, ...]] = ("orbit", "attitude")

    host: Craft = Field(default="chief", description="Craft that carries it and sees the other one; default: the chief")
    latency_s: Annotated[float, Effect("latency", "latency")] = Field(
        default=0.0,
        ge=0,
        description="The measurement of an epoch was taken this long before it, s; a filter's `assumed_latency` says "
        "whether it knows; default 0",
    )
    drawn_latency_s: Annotated[tuple[float, float] | None, AddedLater(), Effect("random latency", "arrival")] = Field(
        default=None,
        description="Shortest and longest time after which a measurement arrives, s, drawn evenly between for each; it "
        "is late from one step on. A filter's `out_of_sequence` says what becomes of late ones; default: none is late",
    )
    time_tag_sigma_s: Annotated[float, Effect("time-tag error", "never")] = Field(
        default=0.0,
        ge=0,
        description="Standard deviation of each run's constant error of the time at which measurements are taken, s; "
        "no filter is told of it; default 0",
    )
    time_tag_jitter_s: Annotated[float, Effect("time-tag jitter", "never")] = Field(
        default=0.0, ge=0, description="The same of each measurement, white, s; no filter is told of it; default 0"
    )
    range_limits_m: Annotated[tuple[float, float] | None, Effect("range limits", "absence")] = Field(
        default=None, description="Shortest and longest true range that is measured, m; default: no limits"
    )

    @field_validator("range_limits_m")
    @classmethod
    def _rising(cls, limits: tuple[float, float] | None) -> tuple[float, float] | None:
        if limits is not None and not 0 <= limits[0] < limits[1]:
            raise ValueError(f"[{limits[0]:g}, {limits[1]:g}] must be two rising values from 0 up")
        return limits

    @field_validator("drawn_latency_s")
    @classmethod
    def _from_shortest(cls, limits: tuple[float, float] | None) -> tuple[float, float] | None:
        if limits is not None and not (0 <= limits[0] <= limits[1] and limits[1] > 0):
            raise ValueError(f"[{limits[0]:g}, {limits[1]:g}] must be the shortest and the longest, from 0 up")
        return limits

    def in_reach(self, truth: Sensed) -> Mask:
        """Return where the other craft can be measured, (runs or 1, K): range limits, field of view, light."""
        offset = truth.target[..., :3] - truth.host[..., :3]
        return within(self.range_limits_m, np.sqrt(np.square(offset).sum(axis=-1)))

    def off_pole(self, truth: Sensed) -> Array | None:
        """Return the angle (runs or 1, K), rad, from where a channel does not exist; None: they exist everywhere."""
        return None

    def no_echo(self, distance: Array) -> Array | None:
        """Return the probability that noise leaves no measurement at a distance, m; None: it never does."""
        return None

    def needs_direction(self) -> tuple[bool, ...]:
        """Return for each channel whether it is lost without what `direction_from` says the host must know."""
        return (False,) * len(self.channels)

    def inputs(self, z: Array, frame: HostFrame) -> dict[Form, Array]:
        """Return what filters take, by form, from measurements (runs, K, m): by default the measurements themselves.

        Args:
            z: The measurements.
            frame: What the host knows of its attitude and orbit.
        """
        return {"spherical": z}

    def measurement(self, context: MeasurementContext) -> Measurement:
        """Return the sensor as a filter is told of it, for the inputs of the same form, without its latency."""
        raise NotImplementedError(f"{type(self).__name__} has no measurement(context)")

    def distortion(self, shares: ErrorShares, form: Form) -> Distortion:
        """Return what a filter's augmented states do to the measurements: by default they add to the channels."""
        e = shares.turn.shape[1]
        return AdditiveBias(np.stack([shares.channels.get(name, np.zeros(e)) for name in self.channel_names]))

    def drawn_errors(self) -> tuple[AugmentedStateOption, ...]:
        """Return the constant or slow errors that each run draws, as the augmented states that they are; default: none.

        No filter is told of them unless it carries such states itself, but none can know better.
        """
        return ()

    def first_fix(self, measurement: Measurement, z: Array) -> tuple[Array, Array] | None:
        """Return the position that measurements (runs, m) give, RTN (runs, 3) m, and its covariance (runs, 3, 3) m^2.

        None where one measurement gives no position. The first three channels are those that give it.

        Args:
            measurement: From `measurement`, in the spherical form.
            z: Inputs of that form; NaN gives NaN.
        """
        return None

    @property
    def gives_fix(self) -> bool:
        """Whether one measurement gives a position, so that filters can start from it."""
        return type(self).first_fix is not RelativeSensorOptions.first_fix


def within(limits: tuple[float, float] | None, distance: Array) -> Mask:
    """Return where a distance, m, can be measured: within the limits, and not zero, where there is no direction."""
    seen = np.asarray(distance != 0)
    if limits is not None:
        seen &= (distance >= limits[0]) & (distance <= limits[1])
    return seen
