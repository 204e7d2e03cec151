"""The extra states that a campaign can name, and a filter's model built with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import exp, expm1
from typing import Annotated, ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import ARCSEC
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.dynamics.known_thrust import KnownThrust
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.options import AddedLater, Options

Array = NDArray[np.float64]
_MODE = (
    "estimate, or consider: account for the uncertainty without estimating (Schmidt's filter), right where the "
    "measurements hardly tell the state from others or its model is not trusted; default: estimate"
)
_SENSOR = (
    "Name of the sensor whose error it is, or, of the attitude, the sensor that it turns with all others on its craft; "
    "default: the first that has such an error"
)
_TAU = (
    "Correlation time, s, of a first-order Gauss-Markov process that keeps the sigma; default: none, a constant (or a "
    "random walk)"
)


class ExtraStateOptions(Options):
    """What every extra state says; how it moves in time is a constant, a random walk or a Gauss-Markov process.

    Attributes:
        names: Names of the states of this kind.
        unit: Their SI unit.
        key_unit: The unit of the campaign's keys, as it stands in their names.
        key_factor: From that unit to SI.
        channel: The channel of a sensor that the state adds to; None: to none.
        axis: The axis, RTN, of the relative acceleration that the state is; None: of none.
    """

    names: ClassVar[tuple[str, ...]]
    unit: ClassVar[str]
    key_unit: ClassVar[str]
    key_factor: ClassVar[float] = 1.0
    channel: ClassVar[str | None] = None
    axis: ClassVar[int | None] = None

    kind: str
    mode: Literal["estimate", "consider"] = Field(default="estimate", description=_MODE)
    sensor: Annotated[str | None, AddedLater()] = Field(default=None, description=_SENSOR)
    tau_s: float | None = Field(default=None, gt=0, description=_TAU)

    @model_validator(mode="after")
    def _one_process(self) -> ExtraStateOptions:
        if self.tau_s is not None and self.walk:
            raise ValueError("give tau_s or a random walk, not both")
        return self

    @property
    def sigma(self) -> float:
        """Standard deviation at the start, SI units."""
        return self.key_factor * float(getattr(self, f"sigma_{self.key_unit}"))

    @property
    def walk(self) -> float:
        """Standard deviation that a random walk gains in one second, SI units."""
        return self.key_factor * float(getattr(self, f"walk_{self.key_unit}_per_sqrt_s", 0.0))

    def added(self) -> Array:
        """Return what each of the states adds to its channel, (e,)."""
        return np.eye(1, len(self.names))[0]

    def turn(self) -> Array:
        """Return the turn about the axes of the host's nadir frame that each of the states is, (3, e)."""
        return np.zeros((3, len(self.names)))

    def acceleration(self) -> Array:
        """Return the share of the states in the relative acceleration, RTN, (3, e)."""
        return _unit_column(3, self.axis, len(self.names))


def _unit_column(rows: int, place: int | None, columns: int) -> Array:
    matrix = np.zeros((rows, columns))
    if place is not None:
        matrix[place, 0] = 1.0
    return matrix


class _AngleBiasOptions(ExtraStateOptions):
    unit: ClassVar[str] = "rad"
    key_unit: ClassVar[str] = "deg"
    key_factor: ClassVar[float] = np.pi / 180

    sigma_deg: float = Field(gt=0, description="Standard deviation of the bias at the start, deg")
    walk_deg_per_sqrt_s: float = Field(
        default=0.0, ge=0, description="Random walk: standard deviation gained in one second, deg; default 0: constant"
    )


class AzimuthBiasOptions(_AngleBiasOptions):
    """Bias of the radar's azimuth."""

    names: ClassVar[tuple[str, ...]] = ("azimuth_bias",)
    channel: ClassVar[str | None] = "azimuth"

    kind: Literal["azimuth_bias"] = Field(default="azimuth_bias", description="Bias of the radar's azimuth")


class ElevationBiasOptions(_AngleBiasOptions):
    """Bias of the radar's elevation."""

    names: ClassVar[tuple[str, ...]] = ("elevation_bias",)
    channel: ClassVar[str | None] = "elevation"

    kind: Literal["elevation_bias"] = Field(default="elevation_bias", description="Bias of the radar's elevation")


class RangeBiasOptions(ExtraStateOptions):
    """Bias of the radar's range."""

    names: ClassVar[tuple[str, ...]] = ("range_bias",)
    unit: ClassVar[str] = "m"
    key_unit: ClassVar[str] = "m"
    channel: ClassVar[str | None] = "range"

    kind: Literal["range_bias"] = Field(default="range_bias", description="Bias of the radar's range")
    sigma_m: float = Field(gt=0, description="Standard deviation of the bias at the start, m")
    walk_m_per_sqrt_s: float = Field(
        default=0.0, ge=0, description="Random walk: standard deviation gained in one second, m; default 0: constant"
    )


class AttitudeErrorOptions(ExtraStateOptions):
    """Correlated error of the measured attitude: three small angles about the nadir frame's axes of the radar's craft.

    The measured line of sight s is off by s x angle; a turn about the line of sight itself does nothing.
    """

    names: ClassVar[tuple[str, ...]] = ("attitude_error_x", "attitude_error_y", "attitude_error_z")
    unit: ClassVar[str] = "rad"
    key_unit: ClassVar[str] = "arcsec"
    key_factor: ClassVar[float] = ARCSEC

    kind: Literal["attitude_error"] = Field(
        default="attitude_error", description="Correlated error of the measured attitude, three angles"
    )
    sigma_arcsec: float = Field(gt=0, description="Standard deviation of each angle, arcsec")

    def turn(self) -> Array:
        """Return the turn that each of the three is."""
        return np.eye(3)


class DifferentialDragOptions(ExtraStateOptions):
    """Along-track acceleration of the deputy relative to the chief, by unequal drag above all."""

    names: ClassVar[tuple[str, ...]] = ("differential_drag",)
    unit: ClassVar[str] = "m/s^2"
    key_unit: ClassVar[str] = "m_s2"
    axis: ClassVar[int | None] = 1

    kind: Literal["differential_drag"] = Field(
        default="differential_drag", description="Along-track acceleration relative to the chief"
    )
    sigma_m_s2: float = Field(gt=0, description="Standard deviation of the acceleration at the start, m/s^2")
    walk_m_s2_per_sqrt_s: float = Field(
        default=0.0,
        ge=0,
        description="Random walk: standard deviation gained in one second, m/s^2; default 0: constant",
    )


class AccelerometerBiasOptions(ExtraStateOptions):
    """Bias of the measured relative thrust, RTN: the deputy's accelerometer's less the chief's.

    A filter that is told measured forces u moves by u - b while there is a reading.
    """

    names: ClassVar[tuple[str, ...]] = ("accelerometer_bias_x", "accelerometer_bias_y", "accelerometer_bias_z")
    unit: ClassVar[str] = "m/s^2"
    key_unit: ClassVar[str] = "m_s2"

    kind: Literal["accelerometer_bias"] = Field(
        default="accelerometer_bias", description="Bias of the measured relative thrust, three axes"
    )
    sigma_m_s2: float = Field(
        gt=0,
        description="Standard deviation of the bias on each axis at the start, m/s^2; of the difference where both "
        "craft carry an accelerometer, root 2 of one's",
    )
    walk_m_s2_per_sqrt_s: float = Field(
        default=0.0,
        ge=0,
        description="Random walk: standard deviation gained in one second, m/s^2; default 0: constant",
    )

    def acceleration(self) -> Array:
        """Return what is to be taken off what is measured."""
        return -np.eye(3)


ExtraStateOption = (
    AzimuthBiasOptions
    | ElevationBiasOptions
    | RangeBiasOptions
    | AttitudeErrorOptions
    | DifferentialDragOptions
    | AccelerometerBiasOptions
)
"""The kinds of extra states."""


@dataclass(frozen=True)
class Extension:
    """What a filter believes of its e extra states: independent, with mean 0 at the start.

    Attributes:
        names: Their names.
        units: Their SI units.
        sigma: Standard deviations at the start, (e,).
        decay: Factors over one step, (e,).
        noise: Variances gained in one step, (e,).
        considered: Numbers of those that are accounted for but not estimated.
        channels: What they add to the channels of sensors: by sensor and channel, (e,).
        turns: The turn of the host's body that each is, by sensor, about the nadir frame's axes, (3, e), rad.
        acceleration: Their share in the relative acceleration, RTN, (3, e).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    sigma: Array
    decay: Array
    noise: Array
    considered: tuple[int, ...]
    channels: Mapping[str, Mapping[str, Array]]
    turns: Mapping[str, Array]
    acceleration: Array

    def dynamics(
        self, base: Dynamics, orbit: ChiefOrbit, step_s: float, thrust: KnownThrust | None = None
    ) -> AugmentedDynamics:
        """Return the dynamics of [x; b]; an acceleration acts as on a circular orbit over one step.

        Args:
            base: How x moves.
            orbit: The chief's nominal orbit.
            step_s: Time between epochs, s.
            thrust: What is told of forces: an accelerometer's bias acts in steps with a force; None: in all.
        """
        inputs: Array | Callable[[Step], Array] | None = None
        if self.acceleration.any():
            G = held_acceleration(orbit.mean_motion_rad_s, step_s) @ self.acceleration
            measured = np.array([name.startswith("accelerometer_bias") for name in self.names])
            inputs = G
            if measured.any() and thrust is not None:
                inputs = _while_pushed(thrust, G, measured)
        return AugmentedDynamics(base, self.decay, self.noise, inputs, self.considered)


class SeenBy(Protocol):
    """What augmented states need to know of a sensor: its channels' names, and the craft that carries it."""

    @property
    def host(self) -> str | None:
        """The craft that carries it."""
        ...

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels."""
        ...


def extension(options: Sequence[ExtraStateOption], sensors: Mapping[str, SeenBy], step_s: float) -> Extension:
    """Return the augmented states of a filter.

    Args:
        options: The kinds, in order.
        sensors: The sensors that the filter goes by.
        step_s: Time between epochs, s.

    Raises:
        ValueError: A state is the error of a sensor that is not there, or that has no such channel.
    """
    each = [option for option in options for _ in option.names]
    sigma = np.array([option.sigma for option in each])
    decay = np.array([1.0 if option.tau_s is None else exp(-step_s / option.tau_s) for option in each])
    lost = np.array([0.0 if option.tau_s is None else -expm1(-2 * step_s / option.tau_s) for option in each])
    walk = np.array([option.walk for option in each])
    return Extension(
        names=tuple(name for option in options for name in option.names),
        units=tuple(option.unit for option in each),
        sigma=sigma,
        decay=decay,
        noise=np.square(sigma) * lost + np.square(walk) * step_s,
        considered=tuple(place for place, option in enumerate(each) if option.mode == "consider"),
        channels=_added(options, sensors, len(each)),
        turns=_turned(options, sensors, len(each)),
        acceleration=np.concatenate([option.acceleration() for option in options], axis=1),
    )


def sensor_of(option: ExtraStateOption, sensors: Mapping[str, SeenBy]) -> str | None:
    """Return the name of the sensor whose error an augmented state is; None where it is no error of a sensor.

    Raises:
        ValueError: The sensor is not there, or has no such channel.
    """
    if option.channel is None and not option.turn().any():
        return None
    having = [name for name, each in sensors.items() if option.channel in (None, *each.channel_names)]
    if option.sensor is None and having:
        return having[0]
    if option.sensor in having:
        return option.sensor
    which = "no sensor of this filter" if option.sensor is None else f"the sensor {option.sensor}"
    if option.sensor is not None and option.sensor not in sensors:
        raise ValueError(f"the filter has no sensor {option.sensor}; it goes by {', '.join(sensors)}")
    raise ValueError(f"{which} has no channel {option.channel}")


def _added(options: Sequence[ExtraStateOption], sensors: Mapping[str, SeenBy], e: int) -> dict[str, dict[str, Array]]:
    """Return what e states add to the channels of sensors."""
    added: dict[str, dict[str, Array]] = {name: {} for name in sensors}
    first = 0
    for option in options:
        name = sensor_of(option, sensors)
        if name is not None and option.channel is not None:
            share = added[name].setdefault(option.channel, np.zeros(e))
            share[first : first + len(option.names)] += option.added()
        first += len(option.names)
    return added


def _turned(options: Sequence[ExtraStateOption], sensors: Mapping[str, SeenBy], e: int) -> dict[str, Array]:
    """Return the turns of the sensors' hosts; a turn holds for all sensors on the same craft."""
    turns = {name: np.zeros((3, e)) for name in sensors}
    first = 0
    for option in options:
        name = sensor_of(option, sensors) if option.turn().any() else None
        for other, each in sensors.items():
            if name is not None and each.host == sensors[name].host:
                turns[other][:, first : first + len(option.names)] += option.turn()
        first += len(option.names)
    return turns


def _while_pushed(thrust: KnownThrust, G: Array, measured: NDArray[np.bool_]) -> Callable[[Step], Array]:
    """Return G (6, e) step by step, (runs or 1, 6, e), the measured columns zero in runs without a force."""

    def inputs(step: Step) -> Array:
        idle = measured & ~thrust.pushed(step)[:, None]
        return np.where(idle[:, None], 0.0, G)

    return inputs


def held_acceleration(mean_motion_rad_s: float, step_s: float) -> Array:
    """Return what an acceleration held over one step does to the state at its end, RTN, (6, 3)."""
    acts_on_velocity = np.vstack([np.zeros((3, 3)), np.eye(3)])
    system = np.zeros((9, 9))
    system[:6, :6] = cw_system(mean_motion_rad_s)
    system[:6, 6:] = acts_on_velocity
    F, _ = van_loan(system, np.zeros((9, 1)), np.zeros((1, 1)), step_s)
    return np.array(F[:6, 6:])
