"""Where a craft starts by published mean elements: a two-line element set or an OMM."""

from __future__ import annotations

from abc import abstractmethod
from math import radians, tau
from typing import Annotated, ClassVar

from pydantic import Field, ValidationError, ValidationInfo, field_validator

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.mean_elements import MeanElements
from relnav_sim.named_files import file_to_read, text_of
from relnav_sim.options import Options, Origin
from relnav_sim.recorded.omm_file import elements_in
from relnav_sim.recorded.two_line_file import set_in
from relnav_sim.truth.epoch_text import EpochText
from relnav_sim.truth.orbit_options import OrbitStart
from relnav_sim.truth.start_context import StartContext


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
    name: Annotated[str | int | None, Origin("lines")] = Field(
        default=None, description="Which set of the file: the line above it, or its catalogue number; default: the only"
    )
    lines: tuple[str, str] | None = Field(
        default=None,
        validate_default=True,
        description="Line 1 and line 2, in quotes; give this or file. Results have them filled in from the file",
    )

    @field_validator("name", mode="after")
    @classmethod
    def _as_text(cls, name: str | int | None) -> str | None:
        return None if name is None else str(name)

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

    epoch: EpochText = Field(description="Their epoch, with its time scale, as 2026-07-21T07:12:11.644128 UTC")
    mean_motion_rev_day: float = Field(gt=0, lt=18, description="Mean motion, revolutions a day")
    e: float = Field(ge=0, lt=1, description="Mean eccentricity")
    i_deg: float = Field(ge=0, le=180, description="Mean inclination, deg")
    raan_deg: float = Field(description="Right ascension of the ascending node, deg")
    argp_deg: float = Field(description="Argument of perigee, deg")
    mean_anomaly_deg: float = Field(description="Mean anomaly, deg")
    bstar: float = Field(default=0.0, description="Drag term B*, 1 / Earth radii; default 0")

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
