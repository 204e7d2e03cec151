"""What differs between the runs of a truth."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from relnav_sim.options import AddedLater, Options
from relnav_sim.truth.distributions import FactorDispersion, PositionDispersion, VelocityDispersion

NEEDED = {
    "chief_ballistic": "drag",
    "deputy_ballistic": "drag",
    "density": "drag",
    "chief_radiation": "radiation_pressure",
    "deputy_radiation": "radiation_pressure",
}
"""The force without which a dispersion has no effect."""


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
    chief_radiation: Annotated[FactorDispersion | None, AddedLater()] = Field(
        default=None, description="Factor on the chief's Cr A / m; default: none"
    )
    deputy_radiation: Annotated[FactorDispersion | None, AddedLater()] = Field(
        default=None, description="Factor on the deputy's Cr A / m; default: none"
    )
