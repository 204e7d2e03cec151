"""The files of recorded orbits that a campaign names."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationInfo, field_validator

from relnav_sim.named_files import digest_of, in_campaign, located
from relnav_sim.options import Options, Origin
from relnav_sim.recorded.stated import Stated


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
    def stated(self) -> Stated:
        """What is stated of either file."""
        return Stated(
            frame=self.frame,
            time_scale=self.time_scale,
            velocity_frame=self.velocity_frame,
            epoch=self.table_epoch,
            interpolation=self.interpolation,
            interpolation_degree=self.interpolation_degree,
        )
