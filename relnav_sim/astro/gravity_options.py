"""Which gravity field is meant: a model and its degree and order."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator

from relnav_sim.astro.gravity_field import SHIPPED, GravityField
from relnav_sim.named_files import digest_of, located
from relnav_sim.options import Options, Origin


class GravityOptions(Options):
    """A gravity field by spherical harmonics, turning with the Earth; its mu and radius come with it."""

    model: Annotated[str, Origin("sha256")] = Field(
        description="ggm05s (comes with relnav, to degree 60) or a `.gfc` file, relative to the campaign's"
    )
    sha256: str | None = Field(
        default=None,
        validate_default=True,
        description="SHA-256 of the file, 64 hexadecimal digits; a file of other content is refused. Default: any; "
        "results have it filled in",
    )
    degree: int = Field(ge=2, description="Largest degree")
    order: int | None = Field(
        default=None, ge=0, validate_default=True, description="Largest order, at most the degree; default: the degree"
    )

    @field_validator("model", mode="after")
    @classmethod
    def _where(cls, model: str, info: ValidationInfo) -> str:
        if model in SHIPPED or not model.lower().endswith(".gfc"):
            return model
        path = located(model, info)
        if not path.is_file():
            raise ValueError(f"there is no file {path}")
        return str(path)

    @field_validator("sha256", mode="after")
    @classmethod
    def _digest(cls, given: str | None, info: ValidationInfo) -> str | None:
        model = info.data.get("model", "")
        if not model.lower().endswith(".gfc"):
            if given is not None:
                raise ValueError(f"{model} is no file; leave the digest out")
            return None
        found = digest_of(Path(model))
        if given not in (None, found):
            raise ValueError(f"{model} is another file than this digest is of: {found}")
        return found

    @field_validator("order", mode="after")
    @classmethod
    def _up_to_the_degree(cls, order: int | None, info: ValidationInfo) -> int | None:
        degree: int | None = info.data.get("degree")
        if order is not None and degree is not None and order > degree:
            raise ValueError(f"is {order}; it must be at most the degree, {degree}")
        return degree if order is None else order

    @property
    def field(self) -> GravityField:
        """The field.

        Raises:
            ValueError: There is none of this name, or it has not that degree.
        """
        return _field(self.model, self.sha256, self.degree, self.order)


@lru_cache(maxsize=8)
def _field(model: str, digest: str | None, degree: int, order: int | None) -> GravityField:
    """Return a field; the digest is there to tell a file from what it was before."""
    return GravityField.load(model, degree, order)
