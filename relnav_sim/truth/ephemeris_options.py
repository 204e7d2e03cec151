"""A truth that was flown, or computed elsewhere: both craft from files of their orbits."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Discriminator, Field, Tag, ValidationError, ValidationInfo, field_validator, model_validator

from relnav_sim.astro.epoch import Epoch
from relnav_sim.options import Options, Origin
from relnav_sim.truth.craft_options import SpacecraftOptions
from relnav_sim.truth.force_options import ConstantsOptions
from relnav_sim.truth.manoeuvres import ExecutionErrors, ManoeuvreOptions
from relnav_sim.truth.named_files import digest_of, in_campaign, located
from relnav_sim.truth.options import TruthOptions, problem

CRAFT = ("chief", "deputy")


class EphemerisOptions(Options):
    """The files of both orbits: CCSDS OEM, or CSV tables with the units in their headers."""

    chief: Annotated[str, Origin("chief_sha256")] = Field(
        description="File of the chief's orbit, relative to the campaign's"
    )
    deputy: Annotated[str, Origin("deputy_sha256")] = Field(
        description="File of the deputy's orbit, relative to the campaign's"
    )
    frame: Literal["EME2000", "ICRF", "GCRF", "ITRF"] | None = Field(
        default=None, description="Frame of the states; default: what the file says"
    )
    time_scale: Literal["UTC", "TAI", "GPS", "TT"] | None = Field(
        default=None, description="Scale of calendar times; default: what the file says"
    )
    velocity_frame: Literal["EME2000", "ICRF", "GCRF", "ITRF", "inertial"] | None = Field(
        default=None,
        description="What velocities are relative to: the frame (default), or inertial where ITRF velocities are those "
        "seen from inertial space",
    )
    table_epoch: str | None = Field(
        default=None, description="Epoch from which `time_s` of a CSV table counts; default: what the file says"
    )
    interpolation: Literal["LAGRANGE", "HERMITE", "LINEAR"] | None = Field(
        default=None,
        description="How states between the rows are found; default: what the file says, or else Lagrange of degree 7, "
        "or Hermite of degree 7 or 11 where that meets withheld rows better",
    )
    interpolation_degree: int | None = Field(default=None, ge=1, le=30, description="Degree of the interpolation")
    chief_sha256: str | None = Field(
        default=None,
        validate_default=True,
        description="SHA-256 of the chief's file, 64 hexadecimal digits; a file of other content is refused. Default: "
        "that of the file; results have it filled in",
    )
    deputy_sha256: str | None = Field(default=None, validate_default=True, description="The same of the deputy's file")

    @field_validator("chief", "deputy", mode="after")
    @classmethod
    def _found(cls, name: str, info: ValidationInfo) -> str:
        return str(located(name, info)) if in_campaign(info) else name

    @field_validator("chief_sha256", "deputy_sha256", mode="after")
    @classmethod
    def _same_content(cls, digest: str | None, info: ValidationInfo) -> str | None:
        assert info.field_name is not None
        name = info.data.get(info.field_name.removesuffix("_sha256"))
        if name is None or not in_campaign(info):
            return digest
        found = digest_of(Path(name))
        if digest not in (None, found):
            raise ValueError(f"the content of {name} has SHA-256 {found}: it is not the file that is meant")
        return found

    def file(self, craft: str) -> tuple[str, str | None]:
        """Return the path and the digest of a craft's file."""
        name, digest = getattr(self, craft), getattr(self, f"{craft}_sha256")
        return name, digest

    @property
    def read_as(self) -> dict[str, Any]:
        """What `load_ephemeris` is told of either file."""
        return {
            "frame": self.frame,
            "time_scale": self.time_scale,
            "velocity_frame": self.velocity_frame,
            "epoch": self.table_epoch,
            "interpolation": self.interpolation,
            "interpolation_degree": self.interpolation_degree,
        }


class EphemerisTruthOptions(Options):
    """A truth from two ephemerides: both craft fly the orbits of the files, alike in all runs."""

    ephemeris: EphemerisOptions = Field(description="The files of both orbits")
    epoch: str | None = Field(
        default=None,
        description="Calendar time of the start, with its time scale, as 2010-07-27T00:00:00 UTC; default: the first "
        "that both files cover",
    )
    chief: SpacecraftOptions | None = Field(
        default=None, description="What is known of the chief besides its orbit; default: nothing, nothing is needed"
    )
    deputy: SpacecraftOptions | None = Field(
        default=None, description="What is known of the deputy besides its orbit; default: nothing, nothing is needed"
    )
    constants: ConstantsOptions = Field(
        default=ConstantsOptions(), description="The Earth's constants that filters are told; stored with the results"
    )

    is_dispersed: ClassVar[bool] = False
    """All runs fly the orbits of the files."""
    manoeuvres: ClassVar[Mapping[str, ManoeuvreOptions]] = {}
    """None is told apart from the orbit that it is part of."""
    execution_errors: ClassVar[ExecutionErrors] = ExecutionErrors()

    @field_validator("epoch", mode="after")
    @classmethod
    def _known_instant(cls, epoch: str | None) -> str | None:
        if epoch is not None:
            Epoch.parse(epoch)
        return epoch

    @model_validator(mode="before")
    @classmethod
    def _says_it_once(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        craft = [
            (name, key)
            for name in CRAFT
            if isinstance(data.get(name), dict)
            for key in data[name]
            if key not in SpacecraftOptions.model_fields
        ]
        others = [(key,) for key in data if key in TruthOptions.model_fields and key not in cls.model_fields]
        if not craft and not others:
            return data
        sentence = "the files of truth.ephemeris say already how the craft fly; leave this out"
        problems = [problem(place, sentence) for place in (*craft, *others)]
        raise ValidationError.from_exception_data(cls.__name__, problems)


def _kind_of(data: Any) -> str:
    recorded = "ephemeris" in data if isinstance(data, dict) else isinstance(data, EphemerisTruthOptions)
    return "recorded" if recorded else "propagated"


AnyTruth = TruthOptions | EphemerisTruthOptions
TruthSection = Annotated[
    Annotated[TruthOptions, Tag("propagated")] | Annotated[EphemerisTruthOptions, Tag("recorded")],
    Discriminator(_kind_of),
]
"""The `truth:` section of a campaign: forces and start states, or files of orbits where `ephemeris` stands there."""
