"""Exact relative motion of two point masses about the chief's nominal orbit, circular or not."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.kepler import arc
from relnav_sim.dynamics.by_epoch import PerChunk
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix, white_acceleration
from relnav_sim.dynamics.registry import register_dynamics
from relnav_sim.dynamics.relative_flow import Legs, divide, flow, linear_flow


@register_dynamics("nonlinear")
class NonlinearOptions(DynamicsOptions):
    """Exact two-body relative motion about the chief's nominal orbit, of any eccentricity below 1; no J2, no drag."""

    step_cost_us: ClassVar[float] = 0.4
    step_overhead_us: ClassVar[float] = 15.0

    kind: Literal["nonlinear"] = Field(default="nonlinear", description="Exact two-body relative motion")

    @property
    def believed_field(self) -> FieldExtent:
        """The point mass's."""
        return FieldExtent(0)

    def build(self, context: DynamicsContext) -> NonlinearDynamics:
        """Return the dynamics; epoch k is k steps after the nominal orbit's own epoch."""
        Q = process_noise_matrix(context.process_noise, cw_system(context.orbit.mean_motion_rad_s), context.step_s)
        return NonlinearDynamics(context.orbit, Q, context.step_s)


def nonlinear(*, orbit: ChiefOrbit, step_s: float, acceleration_psd_m2_s3: float) -> NonlinearDynamics:
    """Return the exact relative motion of two point masses, integrated to rounding error for `create_filter`.

    The state is the deputy's position and velocity relative to the chief, (6,), m and m/s, in the chief's RTN frame
    (see `cw`). Epoch k is k steps
    after the nominal orbit's own epoch, at which it has its true anomaly.

    Args:
        orbit: The chief's nominal orbit.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3,
            discretised about a circular orbit.

    Raises:
        ValueError: The density is negative.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> orbit = dynamics.ChiefOrbit(7.0e6, 0.02, 0.9, 0.0, 0.0, 0.0)
        >>> motion = dynamics.nonlinear(orbit=orbit, step_s=10.0, acceleration_psd_m2_s3=1e-8)
        >>> motion.propagate(np.array([[0.0, -1000.0, 0.0, 0.0, 0.0, 0.0]]), Step(0)).shape
        (1, 6)
    """
    return NonlinearOptions().build(DynamicsContext(orbit, white_acceleration(acceleration_psd_m2_s3), step_s))


class NonlinearDynamics:
    """The difference of two Kepler orbits in the chief's RTN frame, integrated to rounding error.

    Truncation per step is below 1e-9 m at 100 km for any step up to minutes; the duration of a `Step` is not looked
    at, nor does Q follow the orbit: it is that of white acceleration about a circular one.

    Args:
        orbit: The chief's nominal orbit.
        process_noise: Q (6, 6).
        step_s: Time between epochs, s.
    """

    dimension = 6
    linear = False
    leaves_arguments_alone = True

    def __init__(self, orbit: ChiefOrbit, process_noise: Array, step_s: float) -> None:
        self._orbit = orbit
        self._Q = process_noise
        self._step_s = step_s
        self._division = divide(orbit, step_s)
        self._gravity = Gravity(orbit.mu_m3_s2)
        self._legs = PerChunk(self._legs_of)

    def propagate(self, states: Array, step: Step) -> Array:
        """Return states (runs, ..., 6) after the step that ends at its epoch."""
        return flow(states, self._legs.at(step.epoch), self._division, self._gravity)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian (runs, 6, 6) of `propagate` at `mean` (runs, 6), by the variational equations."""
        return linear_flow(mean, self._legs.at(step.epoch), self._division, self._gravity)[1]

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (6, 6)."""
        return self._Q

    def _legs_of(self, epochs: Array) -> Legs:
        """Return the legs of the steps that end at `epochs`, shared by all runs.

        The axes that do not turn are the chief's own at the start of each step.
        """
        division, K = self._division, len(epochs)
        offsets = np.append(division.node_times_s, self._step_s)
        along = arc(self._orbit, (epochs - 1) * self._step_s, offsets)
        c, s = np.cos(along.sweep_rad), np.sin(along.sweep_rad)
        nodes = np.zeros((K, division.node_times_s.size, 2, 3))
        nodes[:, :, 0, 0], nodes[:, :, 0, 1] = (along.radius_m * c)[:, :-1], (along.radius_m * s)[:, :-1]
        frames = np.zeros((K, 2, 4, 3))
        frames[:, 0, :3] = np.eye(3)
        frames[:, 1, 0, 0] = frames[:, 1, 1, 1] = c[:, -1]
        frames[:, 1, 0, 1], frames[:, 1, 1, 0] = s[:, -1], -s[:, -1]
        frames[:, 1, 2, 2] = 1.0
        frames[:, :, 3, 2] = self._areal_rate / np.square(
            np.stack([along.start_radius_m, along.radius_m[:, -1]], axis=-1)
        )
        return Legs(frames.reshape(K, 1, -1), nodes.reshape(K, 1, -1))

    @property
    def _areal_rate(self) -> float:
        """The chief's angular momentum per mass, m^2/s."""
        orbit = self._orbit
        return orbit.mean_motion_rad_s * orbit.semi_major_axis_m**2 * float(np.sqrt(1 - orbit.eccentricity**2))
