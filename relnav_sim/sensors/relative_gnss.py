"""Relative GNSS: where the deputy is from the chief, by the receivers of both craft."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from relnav_sim.arrays import Array
from relnav_sim.measurements.channel import Channel
from relnav_sim.measurements.given_noise import MixtureNoise
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.relative_state import relative_state
from relnav_sim.options import Effect
from relnav_sim.sensors.host_frame import HostFrame
from relnav_sim.sensors.interface import (
    ECI_STATE,
    Form,
    MeasurementContext,
    RelativeSensorOptions,
    Role,
    Sensed,
)
from relnav_sim.sensors.noise import NoiseOption, check_parts, noise_parts, white_law
from relnav_sim.sensors.registry import register_sensor
from relnav_sim.sensors.streams import SensorStreams

_SIGMAS_M = {"code": 1.0, "carrier": 0.02}
_CHANNELS = (
    *(Channel(f"position_{axis}", "m", f"relative position, {axis}") for axis in ("radial", "along", "normal")),
    *(Channel(f"velocity_{axis}", "m/s", f"relative velocity, {axis}") for axis in ("radial", "along", "normal")),
)

_READ = tuple(replace(each, label=f"relative {each.label}") for each in ECI_STATE)


@register_sensor("relative_gnss")
class RelativeGnssOptions(RelativeSensorOptions):
    """Differential GNSS: position, and velocity, of the deputy relative to the chief, from the receivers of both.

    The solution is inertial. Filters take it turned into the chief's RTN axes by the chief's own GNSS fix, or by the
    true orbit where it carries no receiver, so that it is linear in the state; they are told of the frame's error.
    """

    forms: ClassVar[tuple[Form, ...]] = ("cartesian",)
    linear_forms: ClassVar[tuple[Form, ...]] = ("cartesian",)
    direction_from: ClassVar[tuple[Role, ...]] = ("orbit",)

    kind: Literal["relative_gnss"] = Field(
        default="relative_gnss", description="Relative position, and velocity, by GNSS receivers of both craft"
    )
    host: Literal["chief"] = Field(
        default="chief", description="Craft into whose orbit frame the solution is turned: the chief"
    )
    solution: Literal["code", "carrier"] = Field(
        default="code",
        description="code: differential pseudoranges; carrier: carrier phases with fixed ambiguities. It decides the "
        "default of position_sigma_m",
    )
    position_sigma_m: float | None = Field(
        default=None,
        gt=0,
        description="Position noise per axis, 1 sigma, m; default 1 (code) or 0.02 (carrier; 0.01 to 0.05 is common)",
    )
    velocity_sigma_m_s: float | None = Field(
        default=None, gt=0, description="Velocity noise per axis, 1 sigma, m/s; default: no velocity is read"
    )
    slip_rate_per_hour: Annotated[float, Effect("cycle slips", "never")] = Field(
        default=0.0, ge=0, description="Cycle slips that go unnoticed, per hour; default 0. No filter is told of them"
    )
    slip_sigma_m: Annotated[float, Effect("cycle slips", "never")] = Field(
        default=0.5, gt=0, description="Size per axis, 1 sigma, m, of the position error that a cycle slip leaves"
    )
    refix_s: Annotated[float, Effect("cycle slips", "never")] = Field(
        default=60.0, gt=0, description="Time after which the ambiguities are fixed anew and a slip's error is gone, s"
    )

    @field_validator("noise")
    @classmethod
    def _fits(cls, noise: NoiseOption) -> NoiseOption:
        return cls.with_white_part(noise)  # how many channels there are is known when all is read

    @model_validator(mode="after")
    def _noise_fits(self) -> RelativeGnssOptions:
        check_parts(noise_parts(self.noise), len(self.channels))
        return self

    @property
    def channels(self) -> tuple[Channel, ...]:  # type: ignore[override]  # they depend on what is read
        """The three numbers of a position, or six with a velocity."""
        return _CHANNELS[: 3 if self.velocity_sigma_m_s is None else 6]

    @property
    def reading(self) -> tuple[Channel, ...]:
        """The solution as it is read: inertial axes."""
        return _READ[: len(self.channels)]

    @property
    def sigmas(self) -> Array:
        """Standard deviations, (3,) m or (6,) m and m/s."""
        position = _SIGMAS_M[self.solution] if self.position_sigma_m is None else self.position_sigma_m
        return np.repeat([position, self.velocity_sigma_m_s or 0.0], 3)[: len(self.channels)]

    def needs_direction(self) -> tuple[bool, ...]:
        """Return that all need the orbit frame."""
        return (True,) * len(self.channels)

    def sample(self, truth: Sensed, streams: SensorStreams) -> Array:
        """Return the relative state, ECI, (runs, K, 3 or 6), m and m/s; NaN where there is none."""
        z = streams.noise(truth.times_s)
        z *= self.sigmas
        z += (truth.target - truth.host)[..., : z.shape[-1]]
        if self.slip_rate_per_hour:
            epochs_held = max(round(self.refix_s / truth.step_s), 1)
            chance = -np.expm1(-self.slip_rate_per_hour * truth.step_s / 3600)
            z[..., :3] += self.slip_sigma_m * streams.jumps("slip", len(truth.times_s), chance, epochs_held, 3)
        seen = self.in_reach(truth)
        if not seen.all():
            z[~np.broadcast_to(seen, z.shape[:2])] = np.nan
        return z

    def inputs(self, z: Array, frame: HostFrame) -> dict[Form, Array]:
        """Return the state relative to the chief in the RTN frame of its own orbit, when that was measured."""
        return {"cartesian": frame.in_rtn(z, self.latency_s)}

    def measurement(self, context: MeasurementContext) -> Measurement:
        """Return the relative state as a filter is told of it.

        In a frame that turns at n, an error e of the position puts the velocity off by -n x e.
        """
        law = white_law(noise_parts(self.noise), len(self.channels))
        turning = np.eye(6)
        turning[3, 1], turning[4, 0] = context.orbit.mean_motion_rad_s, -context.orbit.mean_motion_rad_s
        turning = turning[: len(self.channels), : len(self.channels)]

        def covariance(scales: Array) -> Array:
            return np.asarray(turning @ np.diag(np.square(scales * self.sigmas)) @ turning.T)

        covariances = np.stack([covariance(scales) for scales in law.scales])
        noise: Any = np.einsum("k,kij->ij", law.weights, covariances)
        if context.assumed_noise == "nominal":
            noise = covariance(law.nominal)
        elif context.assumed_noise == "mixture" and len(law.weights) > 1:
            noise = MixtureNoise(law.weights, covariances)
        return relative_state(noise, context.frame if context.frame.any() else None)

    def first_fix(self, measurement: Measurement, z: Array) -> tuple[Array, Array] | None:
        """Return the position, and its covariance; the velocity at the start is the campaign's."""
        states = np.zeros((len(z), 6))
        states[:, : z.shape[1]] = z
        R = np.broadcast_to(measurement.noise(states, 0), (len(z), z.shape[1], z.shape[1]))
        return z[:, :3].copy(), R[:, :3, :3].copy()
