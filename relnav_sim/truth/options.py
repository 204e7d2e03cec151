"""The `truth:` section of a campaign."""

from __future__ import annotations

from math import radians
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, StringConstraints, ValidationError, field_validator, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from relnav_sim.arrays import Array
from relnav_sim.astro import constants
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.astro.frames import eci_from_rtn, rtn_from_shi2025
from relnav_sim.astro.orbits import Elements, elements_from_state, state_from_elements
from relnav_sim.options import Options
from relnav_sim.truth.distributions import FactorDispersion, PositionDispersion, VelocityDispersion
from relnav_sim.truth.manoeuvres import ExecutionErrors, ManoeuvreOptions, overlaps

Vector = tuple[float, float, float]
ManoeuvreName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]


class OrbitOptions(Options):
    """Osculating Keplerian elements at the start of a run, ECI (J2000 axes)."""

    a_km: float = Field(gt=0, le=1e6, description="Semi-major axis, km; at most 1000000, where the Earth's pull ends")
    e: float = Field(ge=0, lt=1, description="Eccentricity")
    i_deg: float = Field(ge=0, le=180, description="Inclination, deg")
    raan_deg: float = Field(default=0.0, description="Right ascension of the ascending node, deg")
    argp_deg: float = Field(default=0.0, description="Argument of perigee, deg")
    ta_deg: float = Field(default=0.0, description="True anomaly, deg")

    def state(self, mu_m3_s2: float) -> Array:
        """Return position and velocity (6,), ECI, m and m/s."""
        elements = Elements(
            semi_major_axis_m=self.a_km * 1e3,
            eccentricity=self.e,
            inclination_rad=radians(self.i_deg),
            raan_rad=radians(self.raan_deg),
            argument_of_perigee_rad=radians(self.argp_deg),
            true_anomaly_rad=radians(self.ta_deg),
        )
        return state_from_elements(elements, mu_m3_s2)


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


class SpacecraftOptions(Options):
    """What drag needs to know of a spacecraft."""

    mass_kg: float = Field(gt=0, description="Mass, kg")
    area_m2: float = Field(gt=0, description="Area that meets the air, m^2")
    drag_coefficient: float = Field(
        default=2.2, ge=0, description="Drag coefficient; default 2.2, the usual value in free molecular flow"
    )

    @property
    def ballistic_m2_kg(self) -> float:
        """Cd A / m, m^2/kg."""
        return self.drag_coefficient * self.area_m2 / self.mass_kg


class ChiefOptions(SpacecraftOptions):
    """The chief: the craft whose orbit frame everything is told in."""

    orbit: OrbitOptions = Field(description="The chief's orbit at the start")


class DeputyOptions(SpacecraftOptions):
    """The deputy: the craft whose state relative to the chief is estimated."""

    relative: RelativeOptions | None = Field(
        default=None, description="Where it starts relative to the chief; give this or orbit"
    )
    orbit: OrbitOptions | None = Field(default=None, description="Its own orbit at the start; give this or relative")

    @model_validator(mode="after")
    def _one_start(self) -> DeputyOptions:
        if (self.relative is None) == (self.orbit is None):
            raise ValueError("give exactly one of relative and orbit")
        return self


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

    zonals: Literal[0, 2, 3, 4] = Field(
        default=4, description="Highest zonal harmonic: 0 (point mass), 2 (J2), 3 (J2, J3) or 4 (J2 to J4; default)"
    )
    drag: Literal["none", "exponential"] = Field(
        default="exponential", description="Drag: none, or in an exponential atmosphere (default)"
    )
    atmosphere: AtmosphereOptions = Field(
        default=AtmosphereOptions(), description="The exponential atmosphere; without drag it has no effect"
    )


def _higher(a_km: float, surface_km: float) -> str:
    if a_km >= surface_km:
        return "raise a_km or lower e"
    return f"a_km counts from the centre: for an altitude of {a_km:.12g} km write {a_km + surface_km:.12g}"


class ConstantsOptions(Options):
    """The Earth's constants; stored with the results."""

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


def _in_metres(value: float, of_the_earth: float, factor: float) -> float:
    """Return a value that is not the Earth's in kilometres."""
    if abs(factor * value / of_the_earth - 1) < _NEARLY_THE_EARTHS:
        raise ValueError(f"{value:.12g} is the Earth's in kilometres; write {factor * value:.12g}")
    return value


_NEARLY_THE_EARTHS = 0.01


class DispersionsOptions(Options):
    """What differs between runs; each draws from its own stream, so adding one leaves the others as they were."""

    relative_position: PositionDispersion | None = Field(
        default=None, description="Offset of the deputy's position at the start, RTN; default: none"
    )
    relative_velocity: VelocityDispersion | None = Field(
        default=None, description="Offset of the deputy's relative velocity at the start, RTN; default: none"
    )
    chief_ballistic: FactorDispersion | None = Field(
        default=None, description="Factor on the chief's Cd A / m; default: none"
    )
    deputy_ballistic: FactorDispersion | None = Field(
        default=None, description="Factor on the deputy's Cd A / m; default: none"
    )
    density: FactorDispersion | None = Field(
        default=None, description="Factor on the density of the air, the same for both craft; default: none"
    )


class TruthOptions(Options):
    """What really happens: the two spacecraft, the forces on them and what varies between runs."""

    chief: ChiefOptions = Field(description="The chief: its orbit and what drag needs to know of it")
    deputy: DeputyOptions = Field(description="The deputy: where it starts and what drag needs to know of it")
    forces: ForcesOptions = Field(default=ForcesOptions(), description="Gravity and drag; default: J2 to J4 and drag")
    dispersions: DispersionsOptions = Field(
        default=DispersionsOptions(), description="What differs between runs; default: all runs fly the same truth"
    )
    constants: ConstantsOptions = Field(default=ConstantsOptions(), description="The Earth's constants")
    manoeuvres: dict[ManoeuvreName, ManoeuvreOptions] = Field(
        default={}, description="Manoeuvres of both craft, by names of your choice; default: none"
    )
    execution_errors: ExecutionErrors = Field(
        default=ExecutionErrors(),
        description="How badly manoeuvres are carried out, unless one has errors of its own; default: perfectly",
    )

    @field_validator("manoeuvres")
    @classmethod
    def _in_order_of_time(cls, manoeuvres: dict[str, ManoeuvreOptions]) -> dict[str, ManoeuvreOptions]:
        # The order in the file means nothing, and sums over manoeuvres must round alike whatever it is.
        return dict(sorted(manoeuvres.items(), key=lambda item: (item[1].time_s, item[0])))

    @property
    def field_extent(self) -> FieldExtent | None:
        """How much of the Earth's gravity field there is; None where no force model makes the truth."""
        return FieldExtent(self.forces.zonals)

    @property
    def is_dispersed(self) -> bool:
        """Whether the runs fly different truths."""
        varied = any(getattr(self.dispersions, name) is not None for name in type(self.dispersions).model_fields)
        return varied or any((each.errors or self.execution_errors).any for each in self.manoeuvres.values())

    @model_validator(mode="after")
    def _fits_together(self) -> TruthOptions:
        problems = [*self._low_orbits(), *self._idle_dispersions(), *self._simultaneous()]
        if problems:
            raise ValidationError.from_exception_data(type(self).__name__, problems)
        return self

    def _low_orbits(self) -> list[InitErrorDetails]:
        surface_km = self.constants.radius_m / 1e3
        lows = [
            _problem(
                (craft, "orbit"),
                f"the perigee is {orbit.a_km * (1 - orbit.e):.6g} km from the Earth's centre, below the surface at "
                f"{surface_km:.6g} km; {_higher(orbit.a_km, surface_km)}",
            )
            for craft, orbit in (("chief", self.chief.orbit), ("deputy", self.deputy.orbit))
            if orbit is not None and orbit.a_km * (1 - orbit.e) <= surface_km
        ]
        if self.deputy.relative is None or lows:
            return lows
        mu = self.constants.mu_m3_s2
        elements = elements_from_state(eci_from_rtn(self.chief.orbit.state(mu), self.deputy.relative.rtn), mu)
        a, e = float(elements.semi_major_axis_m), float(elements.eccentricity)
        if e < 1 and a * (1 - e) > self.constants.radius_m:
            return []
        fate = f"with its perigee {a * (1 - e) / 1e3:.6g} km from the Earth's centre" if e < 1 else "that escapes"
        return [_problem(("deputy", "relative"), f"puts the deputy on an orbit {fate}; start it nearer to the chief")]

    def _idle_dispersions(self) -> list[InitErrorDetails]:
        if self.forces.drag != "none":
            return []
        return [
            _problem(("dispersions", name), "has no effect without drag; leave it out or set forces.drag")
            for name in ("chief_ballistic", "deputy_ballistic", "density")
            if getattr(self.dispersions, name) is not None
        ]

    def _simultaneous(self) -> list[InitErrorDetails]:
        return [
            _problem(
                ("manoeuvres", later),
                f"begins while {earlier!r} of the same craft is under way, at {self.manoeuvres[later].time_s:g} s; "
                "add the two up, or move one",
            )
            for later, earlier in overlaps(self.manoeuvres)
        ]


def _problem(place: tuple[str, ...], sentence: str) -> InitErrorDetails:
    """Return an error of one key, as pydantic reports errors of several keys from one check."""
    kind = PydanticCustomError("value_error", "{error}", {"error": sentence})
    return InitErrorDetails(type=kind, loc=place, input=None)
