"""The forces on both craft, and the Earth's constants."""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from relnav_sim.astro import constants
from relnav_sim.astro.gravity_field import GravityField
from relnav_sim.astro.gravity_options import GravityOptions
from relnav_sim.options import AddedLater, Options

HIGHEST_ZONAL = 4
"""The last zonal harmonic of which constants and filters know."""
_NEARLY_THE_EARTHS = 0.01


class AtmosphereOptions(Options):
    """An exponential atmosphere that turns with the Earth: density exp(-(altitude - base) / scale height)."""

    base_altitude_m: float = Field(
        default=constants.BASE_ALTITUDE_M,
        description="Altitude above the equatorial radius at which the density holds, m; default: the layer from "
        "400 km in Vallado's table 8-4",
    )
    density_kg_m3: float = Field(
        default=constants.DENSITY_KG_M3, gt=0, description="Density there, kg/m^3; default from the same layer"
    )
    scale_height_m: float = Field(
        default=constants.SCALE_HEIGHT_M,
        gt=0,
        description="Altitude over which the density falls by the factor e, m; default from the same layer",
    )


class ForcesOptions(Options):
    """The forces on both spacecraft besides the Earth's central pull."""

    gravity: Annotated[GravityOptions | None, AddedLater()] = Field(
        default=None,
        description="Gravity by spherical harmonics, in place of zonals and of the constants that belong to them; "
        "needs an epoch. Default: none",
    )
    zonals: Literal[0, 2, 3, 4] | None = Field(
        default=None,
        validate_default=True,
        description="Highest zonal harmonic: 0 (point mass), 2 (J2), 3 (J2, J3) or 4 (J2 to J4; default, unless "
        "gravity is given)",
    )
    third_bodies: Annotated[tuple[Literal["sun", "moon"], ...], AddedLater()] = Field(
        default=(), description="Bodies that pull besides the Earth: sun, moon or both; needs an epoch. Default: none"
    )
    radiation_pressure: Annotated[bool, AddedLater()] = Field(
        default=False,
        description="Pressure of sunlight, with the Earth's shadow, by each craft's reflectivity_coefficient; needs an "
        "epoch. Default: false",
    )
    drag: Literal["none", "exponential", "layers"] = Field(
        default="exponential",
        description="Drag: none, in one exponential layer (atmosphere; default), or in the layers of Vallado's table "
        "8-4 by altitude",
    )
    atmosphere: AtmosphereOptions = Field(
        default=AtmosphereOptions(),
        description="The exponential atmosphere; has no effect unless drag is exponential",
    )

    @field_validator("gravity", mode="after")
    @classmethod
    def _there_is_such_a_field(cls, gravity: GravityOptions | None) -> GravityOptions | None:
        if gravity is not None:
            _ = gravity.field
        return gravity

    @field_validator("zonals", mode="after")
    @classmethod
    def _without_gravity(cls, zonals: int | None, info: ValidationInfo) -> int | None:
        if info.data.get("gravity") is None:
            return HIGHEST_ZONAL if zonals is None else zonals
        if zonals is not None:
            raise ValueError("the gravity field has zonal harmonics of its own; leave zonals or gravity out")
        return None

    @field_validator("third_bodies", mode="after")
    @classmethod
    def _each_once(cls, bodies: tuple[str, ...]) -> tuple[str, ...]:
        if len(set(bodies)) < len(bodies):
            raise ValueError("names a body twice")
        # The order means nothing, and sums must round alike whatever it is.
        return tuple(sorted(bodies, reverse=True))

    @property
    def highest_zonal(self) -> int:
        """The highest zonal harmonic that filters can know of: at most J4."""
        if self.gravity is not None:
            return min(self.gravity.degree, HIGHEST_ZONAL)
        assert self.zonals is not None
        return self.zonals

    @property
    def needs_epoch(self) -> str | None:
        """The first force that depends on the calendar; None where none does."""
        if self.gravity is not None:
            return "gravity"
        return "third_bodies" if self.third_bodies else "radiation_pressure" if self.radiation_pressure else None


class ConstantsOptions(Options):
    """The Earth's constants; stored with the results. With a gravity field, they are its own."""

    mu_m3_s2: float = Field(
        default=constants.MU_M3_S2, gt=0, description="Gravitational parameter, m^3/s^2; default WGS 84"
    )
    radius_m: float = Field(default=constants.RADIUS_M, gt=0, description="Equatorial radius, m; default WGS 84")
    j2: float = Field(default=constants.J2, description="Zonal harmonic J2, unnormalised; default EGM96")
    j3: float = Field(default=constants.J3, description="Zonal harmonic J3, unnormalised; default EGM96")
    j4: float = Field(default=constants.J4, description="Zonal harmonic J4, unnormalised; default EGM96")
    rotation_rad_s: float = Field(
        default=constants.ROTATION_RAD_S, description="Rotation rate of Earth and atmosphere, rad/s; default WGS 84"
    )

    @field_validator("mu_m3_s2")
    @classmethod
    def _mu_in_metres(cls, mu: float) -> float:
        return _in_metres(mu, constants.MU_M3_S2, 1e9)

    @field_validator("radius_m")
    @classmethod
    def _radius_in_metres(cls, radius: float) -> float:
        return _in_metres(radius, constants.RADIUS_M, 1e3)

    def of_field(self, field: GravityField) -> ConstantsOptions:
        """Return the constants with those of a gravity field.

        Raises:
            ValueError: One is given and differs.
        """
        own = {"mu_m3_s2": field.mu_m3_s2, "radius_m": field.radius_m}
        for n in range(2, HIGHEST_ZONAL + 1):
            own[f"j{n}"] = -float(field.C[n, 0]) * sqrt(2 * n + 1) if n <= field.degree else 0.0
        given = [name for name in own if name in self.model_fields_set and getattr(self, name) != own[name]]
        if given:
            raise ValueError(f"the gravity field has {given[0]} of its own, {own[given[0]]!r}; leave {given[0]} out")
        return self.model_copy(update=own)


def _in_metres(value: float, of_the_earth: float, factor: float) -> float:
    """Return a value that is not the Earth's in kilometres."""
    if abs(factor * value / of_the_earth - 1) < _NEARLY_THE_EARTHS:
        raise ValueError(f"{value:.12g} is the Earth's in kilometres; write {factor * value:.12g}")
    return value
