"""The two spacecraft of a truth: what forces need to know of them, and where they start."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from relnav_sim.arrays import Array
from relnav_sim.options import AddedLater, Options
from relnav_sim.truth.ephemeris_start import EphemerisStart
from relnav_sim.truth.mean_elements_options import OmmOptions, TleOptions
from relnav_sim.truth.orbit_options import CartesianOptions, OrbitOptions, OrbitStart
from relnav_sim.truth.relative_options import RelativeOptions, RoeOptions, ShapeOptions
from relnav_sim.truth.start_context import StartContext
from relnav_sim.wording import listed

ORBIT_STARTS = ("orbit", "cartesian", "tle", "omm", "ephemeris")
"""Keys that say where a craft starts by itself."""
RELATIVE_STARTS = ("relative", "roe", "shape")
"""Keys that say where the deputy starts, seen from the chief."""

_Cartesian = Annotated[CartesianOptions | None, AddedLater()]
_Tle = Annotated[TleOptions | None, AddedLater()]
_Omm = Annotated[OmmOptions | None, AddedLater()]
_Ephemeris = Annotated[EphemerisStart | None, AddedLater()]
_ORBIT = "its orbit at the start, as elements"
_CARTESIAN = "its position and velocity at the start"
_TLE = "a two-line element set, for SGP4"
_EPHEMERIS = "its state in a file of its orbit"
_OMM = "an OMM's mean elements, for SGP4"


class SpacecraftOptions(Options):
    """What forces need to know of a spacecraft."""

    mass_kg: float = Field(gt=0, description="Mass, kg")
    area_m2: float = Field(gt=0, description="Area that meets the air, and sunlight, m^2")
    drag_coefficient: float = Field(
        default=2.2, ge=0, description="Drag coefficient; default 2.2, the usual value in free molecular flow"
    )
    reflectivity_coefficient: Annotated[float, AddedLater()] = Field(
        default=1.3,
        ge=0,
        le=2,
        description="Coefficient of radiation pressure, Cr: 1 (absorbs all light) to 2 (reflects all); default 1.3, "
        "usual for craft with solar panels",
    )

    @property
    def ballistic_m2_kg(self) -> float:
        """Cd A / m, m^2/kg."""
        return self.drag_coefficient * self.area_m2 / self.mass_kg

    @property
    def radiation_m2_kg(self) -> float:
        """Cr A / m, m^2/kg."""
        return self.reflectivity_coefficient * self.area_m2 / self.mass_kg

    def given(self, names: tuple[str, ...]) -> str:
        """Return which one of some keys is given.

        Raises:
            ValueError: None of them, or several.
        """
        found = [name for name in names if getattr(self, name) is not None]
        if len(found) != 1:
            raise ValueError(f"give exactly one of {listed(names)}")
        return found[0]


class ChiefOptions(SpacecraftOptions):
    """The chief: the craft whose orbit frame everything is told in."""

    orbit: OrbitOptions | None = Field(default=None, description=f"The chief's start: {_ORBIT}")
    cartesian: _Cartesian = Field(default=None, description=f"The chief's start: {_CARTESIAN}")
    tle: _Tle = Field(default=None, description=f"The chief's start: {_TLE}")
    omm: _Omm = Field(default=None, description=f"The chief's start: {_OMM}")
    ephemeris: _Ephemeris = Field(default=None, description=f"The chief's start: {_EPHEMERIS}")

    @model_validator(mode="after")
    def _one_start(self) -> ChiefOptions:
        self.given(ORBIT_STARTS)
        return self

    @property
    def start_key(self) -> str:
        """The key that says where it starts."""
        return self.given(ORBIT_STARTS)

    @property
    def start(self) -> OrbitStart:
        """Where it starts."""
        start: OrbitStart = getattr(self, self.start_key)
        return start


class DeputyOptions(SpacecraftOptions):
    """The deputy: the craft whose state relative to the chief is estimated."""

    relative: RelativeOptions | None = Field(
        default=None, description="The deputy's start: its state relative to the chief"
    )
    orbit: OrbitOptions | None = Field(default=None, description=f"The deputy's start: {_ORBIT}")
    cartesian: _Cartesian = Field(default=None, description=f"The deputy's start: {_CARTESIAN}")
    tle: _Tle = Field(default=None, description=f"The deputy's start: {_TLE}")
    omm: _Omm = Field(default=None, description=f"The deputy's start: {_OMM}")
    ephemeris: _Ephemeris = Field(default=None, description=f"The deputy's start: {_EPHEMERIS}")
    roe: Annotated[RoeOptions | None, AddedLater()] = Field(
        default=None, description="The deputy's start: relative orbital elements"
    )
    shape: Annotated[ShapeOptions | None, AddedLater()] = Field(
        default=None, description="The deputy's start: a relative motion by its name, free of drift"
    )

    @model_validator(mode="after")
    def _one_start(self) -> DeputyOptions:
        self.given((*RELATIVE_STARTS, *ORBIT_STARTS))
        return self

    @property
    def start_key(self) -> str:
        """The key that says where it starts."""
        return self.given((*RELATIVE_STARTS, *ORBIT_STARTS))

    @property
    def own_start(self) -> OrbitStart | None:
        """Where it starts by itself; None where that is told from the chief."""
        return getattr(self, self.start_key) if self.start_key in ORBIT_STARTS else None

    def state(self, chief: Array, context: StartContext) -> Array | None:
        """Return its state (6,) at the start, ECI, m and m/s; None where `relative` tells it.

        Args:
            chief: The chief's state (6,), ECI, m and m/s.
            context: What the start depends on.

        Raises:
            ValueError: It has none.
        """
        if self.own_start is not None:
            return self.own_start.state(context)
        seen = self.roe or self.shape
        return None if seen is None else seen.state(chief, context)
