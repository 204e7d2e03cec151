"""The `truth:` section of a campaign."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, TypeVar

from pydantic import Field, StringConstraints, ValidationError, ValidationInfo, field_validator, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from relnav_sim.arrays import Array
from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.astro.frames import eci_from_rtn
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.line_of_sight import ARCSEC
from relnav_sim.astro.orbits import Elements, elements_from_state
from relnav_sim.named_files import located
from relnav_sim.options import AddedLater, Options
from relnav_sim.truth.craft_options import RELATIVE_STARTS, ChiefOptions, DeputyOptions
from relnav_sim.truth.dispersion_options import NEEDED, DispersionsOptions
from relnav_sim.truth.epoch_text import EpochText
from relnav_sim.truth.force_options import ConstantsOptions, ForcesOptions
from relnav_sim.truth.manoeuvres import ExecutionErrors, ManoeuvreOptions, overlaps
from relnav_sim.truth.start_context import StartContext

Arcseconds = Annotated[float, Field(ge=-2, le=2)]
ManoeuvreName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]


class EarthOrientationOptions(Options):
    """What only observation tells about the Earth's rotation, as the IERS publishes it; constant over a run."""

    ut1_utc_s: float = Field(default=0.0, ge=-1, le=1, description="UT1 - UTC at the epoch, s; default 0")
    polar_motion_arcsec: tuple[Arcseconds, Arcseconds] = Field(
        default=(0.0, 0.0), description="Coordinates x and y of the pole, arcsec; default 0"
    )

    @property
    def orientation(self) -> EarthOrientation:
        """The same in SI units."""
        x, y = self.polar_motion_arcsec
        return EarthOrientation(self.ut1_utc_s, (x * ARCSEC, y * ARCSEC))


_Craft = TypeVar("_Craft", ChiefOptions, DeputyOptions)


class TruthOptions(Options):
    """What really happens: the two spacecraft, the forces on them and what varies between runs."""

    epoch: Annotated[EpochText | None, AddedLater()] = Field(
        default=None,
        description="Calendar time of the start, with its time scale (UTC, TAI, GPS or TT), as "
        "2010-07-27T00:00:00 UTC; default: none, or that of mean elements or of a recorded state",
    )
    earth_orientation: Annotated[EarthOrientationOptions | None, AddedLater()] = Field(
        default=None,
        description="How the Earth is turned, beyond what theory tells; UT1 - UTC and polar motion are 0 without it",
    )
    chief: ChiefOptions = Field(description="The chief: where it starts and what forces need to know of it")
    deputy: DeputyOptions = Field(description="The deputy: where it starts and what forces need to know of it")
    forces: ForcesOptions = Field(
        default=ForcesOptions(), description="Gravity, drag and other forces; default: J2 to J4 and drag"
    )
    dispersions: DispersionsOptions = Field(
        default=DispersionsOptions(), description="What differs between runs; default: all runs fly the same truth"
    )
    constants: ConstantsOptions = Field(
        default=ConstantsOptions(), validate_default=True, description="The Earth's constants"
    )
    manoeuvres: dict[ManoeuvreName, ManoeuvreOptions] = Field(
        default={}, description="Manoeuvres of both craft, by names of your choice; default: none"
    )
    execution_errors: ExecutionErrors = Field(
        default=ExecutionErrors(),
        description="How badly manoeuvres are carried out, unless one has errors of its own; default: perfectly",
    )

    @field_validator("chief", "deputy", mode="after")
    @classmethod
    def _state_read(cls, craft: _Craft, info: ValidationInfo) -> _Craft:
        """Fill in a start from a recorded orbit, so that nothing later depends on the file."""
        if craft.ephemeris is None or craft.ephemeris.state_read is not None:
            return craft
        given, chief = info.data.get("epoch"), info.data.get("chief")
        epoch = chief.start.own_epoch if given is None and chief is not None else given and Epoch.parse(given)
        turned = info.data.get("earth_orientation")
        orientation = EarthOrientation() if turned is None else turned.orientation
        start = craft.ephemeris.read(located(craft.ephemeris.file, info), epoch, orientation)
        return craft.model_copy(update={"ephemeris": start})

    @field_validator("constants", mode="after")
    @classmethod
    def _of_the_field(cls, constants: ConstantsOptions, info: ValidationInfo) -> ConstantsOptions:
        forces: ForcesOptions | None = info.data.get("forces")
        return constants if forces is None or forces.gravity is None else constants.of_field(forces.gravity.field)

    @field_validator("manoeuvres")
    @classmethod
    def _in_order_of_time(cls, manoeuvres: dict[str, ManoeuvreOptions]) -> dict[str, ManoeuvreOptions]:
        # The order in the file means nothing, and sums over manoeuvres must round alike whatever it is.
        return dict(sorted(manoeuvres.items(), key=lambda item: (item[1].time_s, item[0])))

    @property
    def field_extent(self) -> FieldExtent | None:
        """How much of the Earth's gravity field there is; None where no force model makes the truth."""
        gravity = self.forces.gravity
        if gravity is None:
            return FieldExtent(self.forces.highest_zonal)
        return FieldExtent(gravity.degree, gravity.order or 0, gravity.model)

    @property
    def is_dispersed(self) -> bool:
        """Whether the runs fly different truths."""
        varied = any(getattr(self.dispersions, name) is not None for name in type(self.dispersions).model_fields)
        return varied or any((each.errors or self.execution_errors).any for each in self.manoeuvres.values())

    @property
    def start_epoch(self) -> Epoch | None:
        """When the run starts: `epoch`, or else that of the chief's or the deputy's mean elements or recorded state."""
        if self.epoch is not None:
            return Epoch.parse(self.epoch)
        starts = (self.chief.start, self.deputy.own_start)
        return next((each.own_epoch for each in starts if each is not None and each.own_epoch is not None), None)

    @property
    def start_context(self) -> StartContext:
        """What the start states depend on."""
        values, highest = self.constants, self.forces.highest_zonal
        zonals = [j if n <= highest else 0.0 for n, j in ((2, values.j2), (3, values.j3), (4, values.j4))]
        gravity = Gravity(values.mu_m3_s2, values.radius_m, *zonals)
        return StartContext(gravity, values.radius_m, self.start_epoch, self.orientation)

    @property
    def orientation(self) -> EarthOrientation:
        """What is known of the Earth's rotation."""
        return EarthOrientation() if self.earth_orientation is None else self.earth_orientation.orientation

    @property
    def chief_state(self) -> Array:
        """The chief's nominal state at the start (6,), ECI, m and m/s."""
        return self.chief.start.state(self.start_context)

    @property
    def chief_elements(self) -> Elements:
        """The chief's nominal osculating elements at the start."""
        return self.chief.start.osculating(self.start_context)

    @property
    def deputy_state(self) -> Array | None:
        """The deputy's nominal state at the start (6,), ECI, m and m/s; None where `relative` tells it."""
        return self.deputy.state(self.chief_state, self.start_context)

    @model_validator(mode="after")
    def _fits_together(self) -> TruthOptions:
        problems = [*self._starts(), *self._wrong_epoch(), *self._idle_dispersions(), *self._simultaneous()]
        if problems:
            raise ValidationError.from_exception_data(type(self).__name__, problems)
        return self

    def _starts(self) -> list[InitErrorDetails]:
        """Return what is wrong with the start states: that there is none, no ellipse, or one through the Earth."""
        own = self.deputy.own_start
        lows = list(self._wrong_orbit("chief", lambda: self.chief_elements))
        if own is not None:
            lows += self._wrong_orbit("deputy", lambda: own.osculating(self.start_context))
        elif not lows:
            lows += self._wrong_orbit("deputy", self._seen_from_the_chief)
        return lows

    def _seen_from_the_chief(self) -> Elements:
        state = self.deputy_state
        if state is None:
            assert self.deputy.relative is not None
            state = eci_from_rtn(self.chief_state, self.deputy.relative.rtn)
        return elements_from_state(state, self.constants.mu_m3_s2)

    def _wrong_orbit(self, craft: str, osculating: Callable[[], Elements]) -> Iterator[InitErrorDetails]:
        key = self.chief.start_key if craft == "chief" else self.deputy.start_key
        try:
            elements = osculating()
        except ValueError as error:
            yield problem((craft, key), str(error))
            return
        a, e = float(elements.semi_major_axis_m), float(elements.eccentricity)
        perigee_km, surface_km = a * (1 - e) / 1e3, self.constants.radius_m / 1e3
        if e < 1 and perigee_km > surface_km:
            return
        if key in RELATIVE_STARTS:
            fate = f"with its perigee {perigee_km:.6g} km from the Earth's centre" if e < 1 else "that escapes"
            yield problem((craft, key), f"puts the deputy on an orbit {fate}; start it nearer to the chief")
        elif e < 1:
            yield problem(
                (craft, key),
                f"the perigee is {perigee_km:.6g} km from the Earth's centre, below the surface at {surface_km:.6g} km"
                f"{self._higher(craft, surface_km)}",
            )
        else:
            yield problem((craft, key), f"the eccentricity is {e:.6g}: the orbit escapes; check position and velocity")

    def _higher(self, craft: str, surface_km: float) -> str:
        orbit = self.chief.orbit if craft == "chief" else self.deputy.orbit
        if orbit is None or orbit.a_km is None:
            return ""
        if orbit.a_km >= surface_km:
            return "; raise a_km or lower e"
        return (
            f"; a_km counts from the centre: for an altitude of {orbit.a_km:.12g} km write altitude_km: "
            f"{orbit.a_km:.12g}, or a_km: {orbit.a_km + surface_km:.12g}"
        )

    def _wrong_epoch(self) -> list[InitErrorDetails]:
        """Return that forces have no epoch, or one at which nobody knows how the Earth was turned."""
        force, epoch = self.forces.needs_epoch, self.start_epoch
        if force is None:
            return []
        if epoch is None:
            sentence = "depends on the calendar; give the start's as truth.epoch, for example 2010-07-27T00:00:00 UTC"
            return [problem(("forces", force), sentence)]
        try:
            self.orientation.rotation_angle(epoch)
        except ValueError as error:
            return [problem(("forces", force), str(error))]
        return []

    def _idle_dispersions(self) -> list[InitErrorDetails]:
        idle = {"drag": self.forces.drag == "none", "radiation_pressure": not self.forces.radiation_pressure}
        names = {"drag": "drag", "radiation_pressure": "radiation pressure"}
        return [
            problem(("dispersions", name), f"has no effect without {names[force]}; leave it out or set forces.{force}")
            for name, force in NEEDED.items()
            if idle[force] and getattr(self.dispersions, name) is not None
        ]

    def _simultaneous(self) -> list[InitErrorDetails]:
        return [
            problem(
                ("manoeuvres", later),
                f"begins while {earlier!r} of the same craft is under way, at {self.manoeuvres[later].time_s:g} s; "
                "add the two up, or move one",
            )
            for later, earlier in overlaps(self.manoeuvres)
        ]


def problem(place: tuple[str, ...], sentence: str) -> InitErrorDetails:
    """Return an error of one key, as pydantic reports errors of several keys from one check."""
    kind = PydanticCustomError("value_error", "{error}", {"error": sentence})
    return InitErrorDetails(type=kind, loc=place, input=None)
