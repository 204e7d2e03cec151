"""Relative motion of two point masses under J2 to J4, about the chief's orbit as the filter itself knows it."""

from __future__ import annotations

from typing import ClassVar, Literal

from numpy.typing import ArrayLike
from pydantic import Field

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.dynamics.about_chief import AboutChiefDynamics, about_chief, about_given
from relnav_sim.dynamics.context import DynamicsContext, Need
from relnav_sim.dynamics.motion import ZonalMotion
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.orbit_filter import OrbitFilterOptions
from relnav_sim.dynamics.process_noise import white_acceleration
from relnav_sim.dynamics.registry import register_dynamics


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
        description="Highest zonal harmonic for both craft: 2 (J2; default, which neglects some 1e-8 m/s^2 at 12 "
        "km), 3 (J2, J3) or 4 (J2 to J4)",
    )
    chief_orbit: OrbitFilterOptions = Field(
        default=OrbitFilterOptions(), description="How the chief's orbit is estimated from its GNSS fixes"
    )

    @property
    def believed_field(self) -> FieldExtent:
        """The zonal harmonics."""
        return FieldExtent(self.zonals)

    def build(self, context: DynamicsContext) -> AboutChiefDynamics:
        """Return the dynamics about the nominal orbit until they are fed with fixes of the chief."""
        orbit = context.orbit.up_to(self.zonals)
        return about_chief(ZonalMotion(orbit, context.step_s), orbit, context, self.chief_orbit)


def nonlinear_j2(
    *,
    orbit: ChiefOrbit,
    step_s: float,
    acceleration_psd_m2_s3: float,
    chief: ArrayLike | None = None,
    zonals: Literal[2, 3, 4] = 2,
) -> AboutChiefDynamics:
    """Return the exact relative motion of two craft under J2, or J2 to J4, for `create_filter`.

    The state is the deputy's position and velocity relative to the chief, (6,), m and m/s, in the chief's RTN frame
    (see `cw`); the frame's rate includes the tilt of the orbit plane by the harmonics.

    Args:
        orbit: The chief's nominal orbit and the body's constants, whose `j3` and `j4` count with `zonals` 3 and 4.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3,
            discretised about a circular orbit.
        chief: The chief's states at the start of each step, so one step before each measurement, ECI (J2000 axes), (T,
            6) or (runs, T, 6), m and m/s; default: the nominal orbit under the same gravity.
        zonals: Highest zonal harmonic.

    Raises:
        ValueError: The density is negative, or the chief's states have another shape or are not finite.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> orbit = dynamics.ChiefOrbit(7.0e6, 0.001, 0.9, 0.0, 0.0, 0.0)
        >>> motion = dynamics.nonlinear_j2(orbit=orbit, step_s=10.0, acceleration_psd_m2_s3=1e-10)
        >>> motion.propagate(np.array([[0.0, -1000.0, 0.0, 0.0, 0.0, 0.0]]), Step(0)).shape
        (1, 6)
    """
    context = DynamicsContext(orbit, white_acceleration(acceleration_psd_m2_s3), step_s)
    return about_given(NonlinearJ2Options(zonals=zonals).build(context), chief)
