"""Where the deputy starts, seen from the chief: a relative state, relative orbital elements, or a shape."""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro import drift_free
from relnav_sim.astro.frames import rtn_from_shi2025
from relnav_sim.astro.orbits import elements_from_state, state_from_elements
from relnav_sim.astro.relative_elements import RelativeElements, deputy_elements
from relnav_sim.options import Options
from relnav_sim.truth.start_context import StartContext

Vector = tuple[float, float, float]


class RelativeOptions(Options):
    """Where the deputy starts, seen from the chief."""

    position_m: Vector = Field(description="Position of the deputy relative to the chief, m")
    velocity_m_s: Vector = Field(
        description="Its time derivative in the chief's turning orbit frame, m/s: 0 is at rest in that frame"
    )
    axes: Literal["rtn", "shi2025"] = Field(
        default="rtn",
        description="Axes of both: rtn (x radial out, y along-track, z orbit normal; default) or shi2025 (x "
        "along-track, y minus orbit normal, z nadir, as Shi et al. (2025) use)",
    )

    @property
    def rtn(self) -> Array:
        """The relative state (6,), RTN, m and m/s."""
        state = np.array([*self.position_m, *self.velocity_m_s])
        return rtn_from_shi2025(state) if self.axes == "shi2025" else state


class RoeOptions(Options):
    """Quasi-nonsingular relative orbital elements (D'Amico 2010): deputy minus chief, times the chief's a.

    Differences of osculating elements, converted without linearisation. The chief's orbit must not be equatorial where
    `a_diy_m` is given.
    """

    a_da_m: float = Field(default=0.0, description="Semi-major axis, m; 0 (default): no drift about a point mass")
    a_dlambda_m: float = Field(
        default=0.0, description="Mean longitude, m: positive ahead; the centre of the motion on V-bar. Default 0"
    )
    a_dex_m: float = Field(default=0.0, description="Eccentricity vector e cos(omega), m; default 0")
    a_dey_m: float = Field(default=0.0, description="Eccentricity vector e sin(omega), m; default 0")
    a_dix_m: float = Field(default=0.0, description="Inclination, m; default 0")
    a_diy_m: float = Field(default=0.0, description="Ascending node times sin(i), m; default 0")

    def state(self, chief: Array, context: StartContext) -> Array:
        """Return the deputy's state (6,), ECI, m and m/s.

        Raises:
            ValueError: The elements make no orbit.
        """
        mu = context.gravity.mu_m3_s2
        relative = RelativeElements(**self.model_dump())
        return state_from_elements(deputy_elements(elements_from_state(chief, mu), relative), mu)


class TrailingShape(Options):
    """The deputy flies the chief's own orbit, ahead of it or behind."""

    kind: Literal["trailing"] = Field(description="On the chief's own orbit")
    along_track_m: float = Field(
        description="Straight distance from the chief at the start, m: positive ahead, negative behind"
    )

    def state(self, chief: Array, context: StartContext) -> Array:
        """Return the deputy's state (6,), ECI, m and m/s."""
        return drift_free.trailing(chief, self.along_track_m, context.gravity)


class HoldPointShape(Options):
    """The deputy waits on V-bar, the chief's along-track axis.

    On a circular orbit it stays; about a chief on an eccentric one no point of the turning frame is at rest, and the
    deputy comes back there once a revolution.
    """

    kind: Literal["hold_point"] = Field(description="At rest on V-bar")
    vbar_m: float = Field(description="Place on V-bar, m: positive ahead, negative behind")

    def state(self, chief: Array, context: StartContext) -> Array:
        """Return the deputy's state (6,), ECI, m and m/s."""
        return drift_free.nearest_to_rest(chief, np.array([0.0, self.vbar_m, 0.0]), context.gravity)


class DriftFreeShape(Options):
    """The deputy starts at a point with the velocity that is nearest to rest among those that don't drift away.

    Off V-bar it moves on: below the chief (on R-bar) it begins a 2:1 ellipse in the direction of flight.
    """

    kind: Literal["drift_free"] = Field(description="At a point, with no drift")
    vbar_m: float = Field(default=0.0, description="Place on V-bar, m: positive ahead, negative behind; default 0")
    rbar_m: float = Field(
        default=0.0, description="Place on R-bar, which points at the Earth, m: positive below; default 0"
    )
    hbar_m: float = Field(default=0.0, description="Place along the orbit normal, m; default 0")

    def state(self, chief: Array, context: StartContext) -> Array:
        """Return the deputy's state (6,), ECI, m and m/s."""
        place = np.array([-self.rbar_m, self.vbar_m, self.hbar_m])
        return drift_free.nearest_to_rest(chief, place, context.gravity)


class SafetyEllipseShape(Options):
    """The deputy circles V-bar without crossing it: relative eccentricity and inclination vectors are parallel.

    Where it is level with the chief it is farthest out of plane, and where it crosses the chief's orbit plane it is
    farthest above or below, so that an error along-track brings no collision. Sizes hold for near-circular orbits.
    """

    kind: Literal["safety_ellipse"] = Field(description="Around V-bar, safe by eccentricity/inclination separation")
    rbar_amplitude_m: float = Field(
        gt=0, description="Largest distance above and below the centre, m; along V-bar it is twice that"
    )
    hbar_amplitude_m: float = Field(ge=0, description="Largest distance out of plane, m; 0: a 2:1 ellipse in the plane")
    vbar_centre_m: float = Field(
        default=0.0, description="The centre's place on V-bar, m: positive ahead; default 0, around the chief"
    )
    phase_deg: float = Field(
        default=0.0, description="Where it starts, deg: 0 lowest (default), 90 foremost, 180 highest, 270 hindmost"
    )

    def state(self, chief: Array, context: StartContext) -> Array:
        """Return the deputy's state (6,), ECI, m and m/s."""
        return drift_free.ellipse(
            chief,
            self.rbar_amplitude_m,
            self.hbar_amplitude_m,
            self.vbar_centre_m,
            radians(self.phase_deg),
            context.gravity,
        )


ShapeOptions = Annotated[
    SafetyEllipseShape | HoldPointShape | TrailingShape | DriftFreeShape, Field(discriminator="kind")
]
