"""Where a craft starts, by itself: elements or a Cartesian state."""

from __future__ import annotations

from abc import abstractmethod
from math import radians
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from relnav_sim.arrays import Array
from relnav_sim.astro.earth_orientation import eme2000_from_gcrf
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.orbits import Elements, elements_from_state, state_from_elements
from relnav_sim.options import AddedLater, Options
from relnav_sim.truth.start_context import StartContext

Vector = tuple[float, float, float]


class OrbitStart(Options):
    """A craft's state at the start of a run.

    Attributes:
        is_mean: Whether it comes from mean elements, which are good to about a kilometre.
    """

    is_mean: ClassVar[bool] = False

    @property
    def own_epoch(self) -> Epoch | None:
        """The instant that the state belongs to by itself; None where it takes that of the truth."""
        return None

    @abstractmethod
    def state(self, context: StartContext) -> Array:
        """Return position and velocity (6,), ECI (EME2000), m and m/s.

        Raises:
            ValueError: It has none.
        """

    def osculating(self, context: StartContext) -> Elements:
        """Return the osculating elements of the state.

        Raises:
            ValueError: It has none.
        """
        return elements_from_state(self.state(context), context.gravity.mu_m3_s2)


class OrbitOptions(OrbitStart):
    """Osculating Keplerian elements at the start of a run, ECI (J2000 axes); their size by `a_km` or `altitude_km`."""

    a_km: float | None = Field(
        default=None,
        gt=0,
        le=1e6,
        description="Semi-major axis, km; at most 1000000, where the Earth's pull ends. Give this or altitude_km",
    )
    altitude_km: Annotated[float | None, AddedLater()] = Field(
        default=None,
        gt=0,
        le=1e6,
        description="Altitude of the perigee above the equatorial radius, km; of a circular orbit: of all of it. Give "
        "this or a_km",
    )
    e: float = Field(default=0.0, ge=0, lt=1, description="Eccentricity; default 0, circular")
    i_deg: float = Field(ge=0, le=180, description="Inclination, deg")
    raan_deg: float = Field(default=0.0, description="Right ascension of the ascending node, deg")
    argp_deg: float = Field(default=0.0, description="Argument of perigee, deg")
    ta_deg: float = Field(default=0.0, description="True anomaly, deg")

    @model_validator(mode="after")
    def _one_size(self) -> OrbitOptions:
        one_of_two("a_km", self.a_km, "altitude_km", self.altitude_km)
        return self

    def semi_major_axis_m(self, radius_m: float) -> float:
        """Return the semi-major axis, m, about a body of that equatorial radius."""
        if self.a_km is not None:
            return self.a_km * 1e3
        assert self.altitude_km is not None
        return (radius_m + self.altitude_km * 1e3) / (1 - self.e)

    def osculating(self, context: StartContext) -> Elements:
        """Return the elements as given."""
        return Elements(
            semi_major_axis_m=self.semi_major_axis_m(context.radius_m),
            eccentricity=self.e,
            inclination_rad=radians(self.i_deg),
            raan_rad=radians(self.raan_deg),
            argument_of_perigee_rad=radians(self.argp_deg),
            true_anomaly_rad=radians(self.ta_deg),
        )

    def state(self, context: StartContext) -> Array:
        """Return position and velocity (6,), ECI, m and m/s."""
        return state_from_elements(self.osculating(context), context.gravity.mu_m3_s2)


class CartesianOptions(OrbitStart):
    """Position and velocity at the start of a run, in a frame that is named."""

    position_m: Vector | None = Field(default=None, description="Position, m; give this or position_km")
    position_km: Vector | None = Field(default=None, description="Position, km; give this or position_m")
    velocity_m_s: Vector | None = Field(default=None, description="Velocity, m/s; give this or velocity_km_s")
    velocity_km_s: Vector | None = Field(default=None, description="Velocity, km/s; give this or velocity_m_s")
    frame: Literal["EME2000", "GCRF", "ITRF"] = Field(
        default="EME2000",
        description="Axes of both: EME2000 (mean equator and equinox of J2000; default), GCRF (differs by the frame "
        "bias, 0.8 m in low orbit) or ITRF (turns with the Earth, and so does the velocity; needs truth.epoch)",
    )

    @model_validator(mode="after")
    def _one_unit(self) -> CartesianOptions:
        one_of_two("position_m", self.position_m, "position_km", self.position_km)
        one_of_two("velocity_m_s", self.velocity_m_s, "velocity_km_s", self.velocity_km_s)
        return self

    def state(self, context: StartContext) -> Array:
        """Return position and velocity (6,), ECI, m and m/s."""
        given = np.concatenate(
            [_in_metres(self.position_m, self.position_km), _in_metres(self.velocity_m_s, self.velocity_km_s)]
        )
        if self.frame == "ITRF":
            return context.eci_from_itrf(given)
        return eme2000_from_gcrf(given) if self.frame == "GCRF" else given


def one_of_two(name: str, value: object, other: str, other_value: object) -> None:
    """Refuse two values that mean the same, or none.

    Raises:
        ValueError: Both are given, or neither.
    """
    if (value is None) == (other_value is None):
        raise ValueError(f"give exactly one of {name} and {other}")


def _in_metres(in_m: Vector | None, in_km: Vector | None) -> Array:
    return np.array(in_m) if in_m is not None else 1e3 * np.array(in_km)
