"""The augmented states that a campaign can name."""

from __future__ import annotations

from math import exp, expm1
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import ARCSEC
from relnav_sim.dynamics.correlated_acceleration import CorrelatedAcceleration
from relnav_sim.options import AddedLater, Options

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


class AugmentedStateOptions(Options):
    """What augmented states of one kind say, and how they move in time.

    Attributes:
        names: Names of the states of this kind.
        units: Their SI units.
        channels: The channels of a sensor that the states add to, one each; empty: to none.
        axis: The axis, RTN, of the relative acceleration that the state is; None: of none.
    """

    names: ClassVar[tuple[str, ...]]
    units: ClassVar[tuple[str, ...]]
    channels: ClassVar[tuple[str, ...]] = ()
    axis: ClassVar[int | None] = None

    kind: str
    mode: Literal["estimate", "consider"] = Field(default="estimate", description=_MODE)
    sensor: Annotated[str | None, AddedLater()] = Field(default=None, description=_SENSOR)

    @property
    def sigmas(self) -> Array:
        """Standard deviations (e,) at the start, SI units."""
        raise NotImplementedError(f"{type(self).__name__} has no sigmas")

    def motion(self, step_s: float) -> tuple[Array, Array]:
        """Return D and the covariance of u in b_k = D b_{k-1} + u over one step, (e, e) each."""
        raise NotImplementedError(f"{type(self).__name__} has no motion(step_s)")

    def turn(self) -> Array:
        """Return the turn about the axes of the host's LVLH frame that each of the states is, (3, e)."""
        return np.zeros((3, len(self.names)))

    @property
    def correlated(self) -> tuple[CorrelatedAcceleration, ...]:
        """The accelerations that the states are, where they and their noise move the craft within a step; or none."""
        return ()

    def acceleration(self) -> Array:
        """Return the share of the states in the relative acceleration, held over a step, RTN, (3, e)."""
        return _unit_column(3, self.axis, len(self.names))


class SeparateStateOptions(AugmentedStateOptions):
    """Augmented states of one kind that move each by itself: constants, random walks or Gauss-Markov processes.

    Attributes:
        key_unit: The unit of the campaign's keys, as it stands in their names.
        key_factor: From that unit to SI.
    """

    key_unit: ClassVar[str]
    key_factor: ClassVar[float] = 1.0

    tau_s: float | None = Field(default=None, gt=0, description=_TAU)

    @model_validator(mode="after")
    def _one_process(self) -> SeparateStateOptions:
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

    @property
    def sigmas(self) -> Array:
        """Standard deviations (e,) at the start, SI units."""
        return np.full(len(self.names), self.sigma)

    def motion(self, step_s: float) -> tuple[Array, Array]:
        """Return the same factor for all, and the variance that each gains."""
        each = np.eye(len(self.names))
        if self.tau_s is None:
            return each, self.walk * self.walk * step_s * each
        return exp(-step_s / self.tau_s) * each, self.sigma * self.sigma * -expm1(-2 * step_s / self.tau_s) * each


def _unit_column(rows: int, place: int | None, columns: int) -> Array:
    matrix = np.zeros((rows, columns))
    if place is not None:
        matrix[place, 0] = 1.0
    return matrix


class _AngleBiasOptions(SeparateStateOptions):
    units: ClassVar[tuple[str, ...]] = ("rad",)
    key_unit: ClassVar[str] = "deg"
    key_factor: ClassVar[float] = np.pi / 180

    sigma_deg: float = Field(gt=0, description="Standard deviation of the bias at the start, deg")
    walk_deg_per_sqrt_s: float = Field(
        default=0.0, ge=0, description="Random walk: standard deviation gained in one second, deg; default 0: constant"
    )


class AzimuthBiasOptions(_AngleBiasOptions):
    """Bias of a sensor's azimuth."""

    names: ClassVar[tuple[str, ...]] = ("azimuth_bias",)
    channels: ClassVar[tuple[str, ...]] = ("azimuth",)

    kind: Literal["azimuth_bias"] = Field(default="azimuth_bias", description="Bias of a sensor's azimuth")


class ElevationBiasOptions(_AngleBiasOptions):
    """Bias of a sensor's elevation."""

    names: ClassVar[tuple[str, ...]] = ("elevation_bias",)
    channels: ClassVar[tuple[str, ...]] = ("elevation",)

    kind: Literal["elevation_bias"] = Field(default="elevation_bias", description="Bias of a sensor's elevation")


class RangeBiasOptions(SeparateStateOptions):
    """Bias of a sensor's range."""

    names: ClassVar[tuple[str, ...]] = ("range_bias",)
    units: ClassVar[tuple[str, ...]] = ("m",)
    key_unit: ClassVar[str] = "m"
    channels: ClassVar[tuple[str, ...]] = ("range",)

    kind: Literal["range_bias"] = Field(default="range_bias", description="Bias of a sensor's range")
    sigma_m: float = Field(gt=0, description="Standard deviation of the bias at the start, m")
    walk_m_per_sqrt_s: float = Field(
        default=0.0, ge=0, description="Random walk: standard deviation gained in one second, m; default 0: constant"
    )


class AttitudeErrorOptions(SeparateStateOptions):
    """Correlated error of the measured attitude: three small angles about the LVLH frame's axes of the radar's craft.

    The measured line of sight s is off by s x angle; a turn about the line of sight itself does nothing.
    """

    names: ClassVar[tuple[str, ...]] = ("attitude_error_x", "attitude_error_y", "attitude_error_z")
    units: ClassVar[tuple[str, ...]] = ("rad",) * 3
    key_unit: ClassVar[str] = "arcsec"
    key_factor: ClassVar[float] = ARCSEC

    kind: Literal["attitude_error"] = Field(
        default="attitude_error", description="Correlated error of the measured attitude, three angles"
    )
    sigma_arcsec: float = Field(gt=0, description="Standard deviation of each angle, arcsec")

    def turn(self) -> Array:
        """Return the turn that each of the three is."""
        return np.eye(3)


class DifferentialDragOptions(SeparateStateOptions):
    """Along-track acceleration of the deputy relative to the chief, by unequal drag above all."""

    names: ClassVar[tuple[str, ...]] = ("differential_drag",)
    units: ClassVar[tuple[str, ...]] = ("m/s^2",)
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


class AccelerometerBiasOptions(SeparateStateOptions):
    """Bias of the measured relative thrust, RTN: the deputy's accelerometer's less the chief's.

    A filter that is told measured forces u moves by u - b while there is a measurement.
    """

    names: ClassVar[tuple[str, ...]] = ("accelerometer_bias_x", "accelerometer_bias_y", "accelerometer_bias_z")
    units: ClassVar[tuple[str, ...]] = ("m/s^2",) * 3
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


class ClockOptions(AugmentedStateOptions):
    """Bias and drift of the clocks behind a crosslink: the bias adds to the range, and the drift to the range rate.

    The drift moves the bias. White noise of the frequency makes the bias a random walk and its own walk the drift, the
    two-state clock of Van Dierendonck, McGraw and Brown (1984; Brown and Hwang, section 9.3).
    """

    names: ClassVar[tuple[str, ...]] = ("clock_bias", "clock_drift")
    units: ClassVar[tuple[str, ...]] = ("m", "m/s")
    channels: ClassVar[tuple[str, ...]] = ("range", "range_rate")

    kind: Literal["clock"] = Field(default="clock", description="Bias and drift of a crosslink's clocks, two states")
    sigma_m: float = Field(gt=0, description="Standard deviation of the bias at the start, m")
    drift_sigma_m_s: float = Field(gt=0, description="Standard deviation of the drift at the start, m/s")
    walk_m_per_sqrt_s: float = Field(
        default=0.0, ge=0, description="Random walk of the bias: standard deviation gained in one second, m; default 0"
    )
    drift_walk_m_s_per_sqrt_s: float = Field(
        default=0.0,
        ge=0,
        description="Random walk of the drift: standard deviation gained in one second, m/s; default 0",
    )

    @property
    def sigmas(self) -> Array:
        """Standard deviations of bias (m) and drift (m/s) at the start."""
        return np.array([self.sigma_m, self.drift_sigma_m_s])

    def motion(self, step_s: float) -> tuple[Array, Array]:
        """Return the exact discretisation of bias' = drift + w1, drift' = w2."""
        white, drifting = np.square([self.walk_m_per_sqrt_s, self.drift_walk_m_s_per_sqrt_s]) * step_s
        shared = drifting * step_s / 2
        return (
            np.array([[1.0, step_s], [0.0, 1.0]]),
            np.array([[white + drifting * step_s**2 / 3, shared], [shared, drifting]]),
        )


AugmentedStateOption = (
    AzimuthBiasOptions
    | ElevationBiasOptions
    | RangeBiasOptions
    | AttitudeErrorOptions
    | DifferentialDragOptions
    | AccelerometerBiasOptions
    | ClockOptions
)
"""The kinds of augmented states."""
