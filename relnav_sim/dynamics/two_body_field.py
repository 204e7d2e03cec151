"""Relative motion under a real gravity field, about the chief's orbit as the filter itself knows it."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.astro.gravity_options import GravityOptions
from relnav_sim.dynamics.about_chief import AboutChiefDynamics, about_chief, about_given
from relnav_sim.dynamics.context import DynamicsContext, Need
from relnav_sim.dynamics.field_motion import FieldMotion, about
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.orbit_filter import OrbitFilterOptions
from relnav_sim.dynamics.process_noise import white_acceleration
from relnav_sim.dynamics.registry import register_dynamics
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options
from relnav_sim.options import Origin


@register_dynamics("nonlinear_field")
class NonlinearFieldOptions(GravityOptions, DynamicsOptions):
    """Exact relative motion under a gravity field of any degree, about the chief's orbit from its own GNSS fixes.

    Without GNSS fixes of the chief, the nominal orbit takes their place, propagated by the same gravity. The field
    turns with the Earth, from the campaign's epoch on.
    """

    needs: ClassVar[frozenset[Need]] = frozenset({"chief_fixes", "known_thrust", "epoch"})
    step_cost_us: ClassVar[float] = 4.0
    step_overhead_us: ClassVar[float] = 20.0
    # The orbit filter, and the chief's segments.
    shared_overhead_us: ClassVar[float] = 30.0
    shared_epoch_bytes: ClassVar[float] = 1200.0

    kind: Literal["nonlinear_field"] = Field(
        default="nonlinear_field", description="Exact relative motion in a gravity field about the chief's orbit"
    )
    model: Annotated[str, Origin("sha256")] = Field(
        default="ggm05s",
        description="The field: ggm05s (comes with relnav, to degree 60; default) or a `.gfc` file, relative to the "
        "campaign's",
    )
    degree: int = Field(default=20, ge=2, description="Largest degree; default 20")
    chief_orbit: OrbitFilterOptions = Field(
        default=OrbitFilterOptions(), description="How the chief's orbit is estimated from its GNSS fixes"
    )

    @model_validator(mode="after")
    def _there_is_such_a_field(self) -> NonlinearFieldOptions:
        _ = self.field
        return self

    @property
    def believed_field(self) -> FieldExtent:
        """All of it."""
        return FieldExtent(self.degree, self.field.order, self.model)

    @property
    def simpler(self) -> NonlinearJ2Options:
        """J2 to J4 alone."""
        return NonlinearJ2Options(zonals=4, chief_orbit=self.chief_orbit)

    def build(self, context: DynamicsContext) -> AboutChiefDynamics:
        """Return the dynamics about the nominal orbit until they are fed with fixes of the chief.

        Raises:
            ValueError: The context has no epoch.
        """
        if context.epoch is None:
            raise ValueError("nonlinear_field needs to know how the Earth is turned: give an epoch (truth.epoch)")
        orbit = about(self.field, context.orbit)
        motion = FieldMotion(self.field, orbit, context.step_s, context.epoch)
        return about_chief(motion, orbit, context, self.chief_orbit)


def nonlinear_field(
    *,
    orbit: ChiefOrbit,
    step_s: float,
    acceleration_psd_m2_s3: float,
    epoch: str | Epoch,
    chief: ArrayLike | None = None,
    model: str = "ggm05s",
    degree: int = 20,
    order: int | None = None,
) -> AboutChiefDynamics:
    """Return the exact relative motion of two craft in a gravity field, for `create_filter`.

    The state is the deputy's position and velocity relative to the chief, (6,), m and m/s, in the chief's RTN frame
    (see `cw`); the frame's rate includes the tilt of the orbit plane by the field. UT1 - UTC and polar motion are 0.

    Args:
        orbit: The chief's nominal orbit; the field's constants take the place of its own.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3,
            discretised about a circular orbit.
        epoch: Calendar time of epoch 0 with its time scale, as ``"2010-07-27T00:00:00 GPS"``.
        chief: The chief's states at the start of each step, so one step before each measurement, ECI (J2000 axes), (T,
            6) or (runs, T, 6), m and m/s; default: the nominal orbit in the same field.
        model: The field, ``"ggm05s"`` or the path of a ``.gfc`` file.
        degree: Largest degree.
        order: Largest order; default: the degree.

    Raises:
        ValueError: The density is negative, the epoch can't be read, there is no such field, or the chief's states have
            another shape or are not finite.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> orbit = dynamics.ChiefOrbit(7.0e6, 0.001, 0.9, 0.0, 0.0, 0.0)
        >>> motion = dynamics.nonlinear_field(
        ...     orbit=orbit, step_s=10.0, acceleration_psd_m2_s3=1e-10, epoch="2025-03-20T12:00:00 UTC", degree=10
        ... )
        >>> motion.propagate(np.array([[0.0, -1000.0, 0.0, 0.0, 0.0, 0.0]]), Step(0)).shape
        (1, 6)
    """
    when = Epoch.parse(epoch) if isinstance(epoch, str) else epoch
    context = DynamicsContext(orbit, white_acceleration(acceleration_psd_m2_s3), step_s, epoch=when)
    options = NonlinearFieldOptions(model=model, degree=degree, order=order)
    return about_given(options.build(context), chief)
