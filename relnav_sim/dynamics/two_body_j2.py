"""Relative motion of two point masses under J2 to J4, about the chief's orbit as the filter itself knows it."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.astro.gravity import Gravity
from relnav_sim.dynamics.chief_segments import ChiefFollower, ChiefSegments, NominalChief
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import Arrival, ChiefFixes, DynamicsContext, Need
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix, white_acceleration
from relnav_sim.dynamics.registry import register_dynamics
from relnav_sim.dynamics.relative_flow import divide, flow, linear_flow
from relnav_sim.given_arrays import finite, numbers


@register_dynamics("nonlinear_j2")
class NonlinearJ2Options(DynamicsOptions):
    """Exact relative motion under a point mass and J2 (or J2 to J4), about the chief's orbit from its own GNSS fixes.

    Without GNSS fixes of the chief, the nominal orbit takes their place, propagated by the same gravity.
    """

    needs: ClassVar[frozenset[Need]] = frozenset({"chief_fixes", "known_thrust"})
    step_cost_us: ClassVar[float] = 0.9
    step_overhead_us: ClassVar[float] = 10.0
    # The orbit filter, and the chief's segments.
    shared_overhead_us: ClassVar[float] = 5.0
    shared_epoch_bytes: ClassVar[float] = 830.0

    kind: Literal["nonlinear_j2"] = Field(
        default="nonlinear_j2", description="Exact relative motion with J2 about the chief's estimated orbit"
    )
    zonals: Literal[2, 3, 4] = Field(
        default=2,
        description="Highest zonal harmonic for both craft: 2 (J2; default, which leaves out some 1e-8 m/s^2 at 12 "
        "km), 3 (J2, J3) or 4 (J2 to J4)",
    )
    chief_orbit: OrbitFilterOptions = Field(
        default=OrbitFilterOptions(), description="How the chief's orbit is estimated from its GNSS fixes"
    )

    @property
    def believed_field(self) -> FieldExtent:
        """The zonal harmonics."""
        return FieldExtent(self.zonals)

    def build(self, context: DynamicsContext) -> NonlinearJ2Dynamics:
        """Return the dynamics about the nominal orbit until they are fed with fixes of the chief."""
        orbit, step_s, fixes = context.orbit.up_to(self.zonals), context.step_s, context.chief_fixes
        Q = process_noise_matrix(context.process_noise, cw_system(orbit.mean_motion_rad_s), step_s)
        if fixes is None:
            nominal = context.share("nominal chief", lambda: NominalChief(orbit, step_s))
            return NonlinearJ2Dynamics(orbit, Q, step_s, nominal)
        follower = context.share("chief", lambda: self._follower(orbit, fixes, step_s))
        return NonlinearJ2Dynamics(orbit, Q, step_s, follower=follower)

    def _follower(self, orbit: ChiefOrbit, fixes: ChiefFixes, step_s: float) -> ChiefFollower:
        filter = OrbitFilter(self.chief_orbit, orbit, fixes.sigmas, step_s, fixes.runs)
        return ChiefFollower(filter, divide(orbit, step_s), Gravity.of(orbit))


def nonlinear_j2(
    *,
    orbit: ChiefOrbit,
    step_s: float,
    acceleration_psd_m2_s3: float,
    chief: ArrayLike | None = None,
    zonals: Literal[2, 3, 4] = 2,
) -> NonlinearJ2Dynamics:
    """Return the exact relative motion of two craft under J2, or J2 to J4, for `create_filter`.

    The state is the deputy's position and velocity relative to the chief, (6,), m and m/s, in the chief's RTN frame
    (see `cw`); the frame's rate includes the tilt of the orbit plane by the harmonics.

    Args:
        orbit: The chief's nominal orbit and the body's constants, whose `j3` and `j4` count with `zonals` 3 and 4.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3,
            discretised about a circular orbit.
        chief: The chief's states at the start of each step, so one step before each reading, ECI (J2000 axes), (T, 6)
            or (runs, T, 6), m and m/s; default: the nominal orbit under the same gravity.
        zonals: Highest zonal harmonic.

    Raises:
        ValueError: The density is negative, or the chief's states have another shape or are not finite.

    Example:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> orbit = dynamics.ChiefOrbit(7.0e6, 0.001, 0.9, 0.0, 0.0, 0.0)
        >>> motion = dynamics.nonlinear_j2(orbit=orbit, step_s=10.0, acceleration_psd_m2_s3=1e-10)
        >>> motion.propagate(np.array([[0.0, -1000.0, 0.0, 0.0, 0.0, 0.0]]), Step(0)).shape
        (1, 6)
    """
    context = DynamicsContext(orbit, white_acceleration(acceleration_psd_m2_s3), step_s)
    dynamics = NonlinearJ2Options(zonals=zonals).build(context)
    if chief is None:
        return dynamics
    states = finite(numbers(chief, "chief"), "chief", ("run", "epoch", "component")[-np.ndim(chief) :])
    if states.ndim not in (2, 3) or states.shape[-1] != 6:
        raise ValueError(f"chief has shape {states.shape}; it must be (T, 6) or (runs, T, 6)")
    return dynamics.with_chief(states.reshape(-1, *states.shape[-2:]), first_epoch=-1)


class NonlinearJ2Dynamics:
    """The difference of two orbits under a point mass and zonal harmonics in the chief's RTN frame.

    It is integrated to rounding error, about the nominal orbit until it is given the chief's states.

    A step starts from the chief's state at its first epoch and carries the chief along, so that the frame at its end
    is the one that state leads to. The frame's rate includes the harmonics' tilt of the orbit plane. The duration of a
    `Step` is not looked at.

    Args:
        orbit: The chief's nominal orbit; its body has the harmonics.
        process_noise: Q (6, 6).
        step_s: Time between epochs, s.
        nominal: The chief on that orbit, which dynamics of the same orbit may share; default: one of its own.
        follower: What estimates the chief's orbit from the fixes that are fed; default: they are not looked at.
    """

    dimension = 6
    linear = False
    leaves_arguments_alone = True

    def __init__(
        self,
        orbit: ChiefOrbit,
        process_noise: Array,
        step_s: float,
        nominal: NominalChief | None = None,
        follower: ChiefFollower | None = None,
    ) -> None:
        self._orbit = orbit
        self._Q = process_noise
        self._step_s = step_s
        self._division = divide(orbit, step_s)
        self._gravity = Gravity.of(orbit)
        self._chief: ChiefSegments | NominalChief = nominal or NominalChief(orbit, step_s)
        self._follower = follower
        self._latest: tuple[int, bytes, Array] | None = None

    def with_chief(self, chief: Array, first_epoch: int) -> NonlinearJ2Dynamics:
        """Return the same dynamics about the chief's states at some epochs.

        Args:
            chief: The filter's own estimates, ECI, (runs, K, 6), m and m/s. The step to epoch k takes that of k - 1.
            first_epoch: Epoch of the first of them.
        """
        bound = NonlinearJ2Dynamics(self._orbit, self._Q, self._step_s)
        bound._chief = ChiefSegments(chief, first_epoch, self._division, self._gravity)
        return bound

    def feed(self, arrival: Arrival) -> None:
        """Take the chief's fixes at the next epochs, and the forces on it."""
        if self._follower is not None and arrival.chief_fixes is not None:
            chief_forces = None if arrival.forces is None else arrival.forces[:, :, 0]
            self._chief = self._follower.take(arrival.chief_fixes, arrival.first_epoch, chief_forces)
            self._latest = None

    def propagate(self, states: Array, step: Step) -> Array:
        """Return states (runs, ..., 6) after the step that ends at its epoch."""
        # A filter asks for the Jacobian and then for the mean of the same step.
        if self._latest is not None and self._latest[:2] == (step.epoch, states.tobytes()) and states.ndim == 2:
            return self._latest[2].copy()
        return flow(states, self._chief.segment(step.epoch), self._division, self._gravity)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian (runs, 6, 6) of `propagate` at `mean` (runs, 6), by the variational equations."""
        end, F = linear_flow(mean, self._chief.segment(step.epoch), self._division, self._gravity)
        self._latest = step.epoch, mean.tobytes(), end
        return F

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (6, 6)."""
        return self._Q
