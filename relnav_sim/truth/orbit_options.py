"""Where a craft starts, by itself: elements, a Cartesian state, or published mean elements."""

from __future__ import annotations

from abc import abstractmethod
from math import radians, tau
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationError, ValidationInfo, field_validator, model_validator

from relnav_sim.arrays import Array
from relnav_sim.astro.earth_orientation import eme2000_from_gcrf
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.mean_elements import MeanElements
from relnav_sim.astro.orbits import Elements, elements_from_state, state_from_elements
from relnav_sim.options import AddedLater, Options, Origin
from relnav_sim.truth.named_files import file_to_read, text_of
from relnav_sim.truth.omm_file import elements_in
from relnav_sim.truth.start_context import StartContext
from relnav_sim.truth.two_line_file import set_in

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


class MeanElementsStart(OrbitStart):
    """Mean elements that SGP4 propagates to the start."""

    is_mean: ClassVar[bool] = True

    @property
    @abstractmethod
    def mean(self) -> MeanElements:
        """The mean elements."""

    @property
    def own_epoch(self) -> Epoch | None:
        """The epoch of the mean elements."""
        return self.mean.epoch

    def state(self, context: StartContext) -> Array:
        """Return position and velocity (6,), ECI, m and m/s, by SGP4."""
        return self.mean.state(context.epoch or self.mean.epoch)


class TleOptions(MeanElementsStart):
    """A two-line element set, by itself or in a file; the run starts at `truth.epoch`, or else at the set's own epoch.

    SGP4 and its elements are good to about 1 km, and to a few days: for nominal orbits only.
    """

    file: Annotated[str | None, Origin("lines")] = Field(
        default=None, description="File of two-line elements, relative to the campaign's; give this or lines"
    )
    name: Annotated[str | None, Origin("lines")] = Field(
        default=None, description="Which set of the file: the line above it, or its catalogue number; default: the only"
    )
    lines: tuple[str, str] | None = Field(
        default=None,
        validate_default=True,
        description="Line 1 and line 2, in quotes; give this or file. Results have them filled in from the file",
    )

    @field_validator("lines", mode="after")
    @classmethod
    def _readable(cls, lines: tuple[str, str] | None, info: ValidationInfo) -> tuple[str, str] | None:
        file = file_to_read("lines", lines, info)
        if file is not None:
            lines = set_in(text_of(file, info), info.data.get("name"), file)
        assert lines is not None
        MeanElements.from_lines(*lines)
        return lines

    @property
    def mean(self) -> MeanElements:
        """The mean elements of the two lines."""
        assert self.lines is not None
        return MeanElements.from_lines(*self.lines)


class OmmElementsOptions(Options):
    """Mean elements for SGP4, in the axes TEME."""

    epoch: str = Field(description="Their epoch, with its time scale, as 2026-07-21T07:12:11.644128 UTC")
    mean_motion_rev_day: float = Field(gt=0, lt=18, description="Mean motion, revolutions a day")
    e: float = Field(ge=0, lt=1, description="Mean eccentricity")
    i_deg: float = Field(ge=0, le=180, description="Mean inclination, deg")
    raan_deg: float = Field(description="Right ascension of the ascending node, deg")
    argp_deg: float = Field(description="Argument of perigee, deg")
    mean_anomaly_deg: float = Field(description="Mean anomaly, deg")
    bstar: float = Field(default=0.0, description="Drag term B*, 1 / Earth radii; default 0")

    @field_validator("epoch")
    @classmethod
    def _known_instant(cls, epoch: str) -> str:
        Epoch.parse(epoch)
        return epoch

    @property
    def mean(self) -> MeanElements:
        """The same in SI units."""
        return MeanElements(
            epoch=Epoch.parse(self.epoch),
            mean_motion_rad_s=self.mean_motion_rev_day * tau / 86400,
            eccentricity=self.e,
            inclination_rad=radians(self.i_deg),
            raan_rad=radians(self.raan_deg),
            argument_of_perigee_rad=radians(self.argp_deg),
            mean_anomaly_rad=radians(self.mean_anomaly_deg),
            bstar=self.bstar,
        )


class OmmOptions(MeanElementsStart):
    """Mean elements as an OMM gives them; the run starts at `truth.epoch`, or else at the elements' own epoch."""

    file: Annotated[str | None, Origin("elements")] = Field(
        default=None, description="OMM, keyword = value or XML, relative to the campaign's file; give this or elements"
    )
    elements: OmmElementsOptions | None = Field(
        default=None,
        validate_default=True,
        description="The elements; give this or file. Results have them filled in from the file",
    )

    @field_validator("elements", mode="after")
    @classmethod
    def _readable(cls, elements: OmmElementsOptions | None, info: ValidationInfo) -> OmmElementsOptions | None:
        file = file_to_read("elements", elements, info)
        if file is not None:
            try:
                elements = OmmElementsOptions.model_validate(elements_in(text_of(file, info), file))
            except ValidationError as error:
                first = error.errors()[0]
                raise ValueError(f"{file}: {first['loc'][0]}: {first['msg']}") from None
        return elements

    @property
    def mean(self) -> MeanElements:
        """The mean elements."""
        assert self.elements is not None
        return self.elements.mean


def one_of_two(name: str, value: object, other: str, other_value: object) -> None:
    """Refuse two values that mean the same, or none.

    Raises:
        ValueError: Both are given, or neither.
    """
    if (value is None) == (other_value is None):
        raise ValueError(f"give exactly one of {name} and {other}")


def _in_metres(in_m: Vector | None, in_km: Vector | None) -> Array:
    return np.array(in_m) if in_m is not None else 1e3 * np.array(in_km)
