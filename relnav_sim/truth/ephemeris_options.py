"""A truth that was flown, or computed elsewhere: both craft from files of their orbits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from pydantic import Discriminator, Field, Tag, ValidationError, model_validator

from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.options import Options
from relnav_sim.truth.craft_options import SpacecraftOptions
from relnav_sim.truth.ephemeris_files import EphemerisOptions
from relnav_sim.truth.epoch_text import EpochText
from relnav_sim.truth.flown_orbits import first_instant
from relnav_sim.truth.force_options import ConstantsOptions
from relnav_sim.truth.manoeuvres import ExecutionErrors, ManoeuvreOptions
from relnav_sim.truth.options import EarthOrientationOptions, TruthOptions, problem
from relnav_sim.truth.thrust import CRAFT


class EphemerisTruthOptions(Options):
    """A truth from two ephemerides: both craft fly the orbits of the files, alike in all runs."""

    ephemeris: EphemerisOptions = Field(description="The files of both orbits")
    epoch: EpochText | None = Field(
        default=None,
        description="Calendar time of the start, with its time scale, as 2010-07-27T00:00:00 UTC; default: the first "
        "that both files cover",
    )
    earth_orientation: EarthOrientationOptions | None = Field(
        default=None,
        description="How the Earth is turned, beyond what theory tells, for orbits in ITRF; UT1 - UTC and polar motion "
        "are 0 without it",
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

    field_extent: ClassVar[FieldExtent | None] = None
    """The orbits tell nothing of the field."""
    is_dispersed: ClassVar[bool] = False
    """All runs fly the orbits of the files."""
    manoeuvres: ClassVar[Mapping[str, ManoeuvreOptions]] = {}
    """None is told apart from the orbit that it is part of."""
    execution_errors: ClassVar[ExecutionErrors] = ExecutionErrors()

    @property
    def orientation(self) -> EarthOrientation:
        """What is known of the Earth's rotation."""
        return EarthOrientation() if self.earth_orientation is None else self.earth_orientation.orientation

    @property
    def start_epoch(self) -> Epoch:
        """When the run starts: `epoch`, or the first instant that both files cover.

        Raises:
            EphemerisError: A file can't be read or used, or they cover no instant together.
        """
        return first_instant(self.ephemeris) if self.epoch is None else Epoch.parse(self.epoch)

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
            return _with_tuples(data)
        sentence = "the files of truth.ephemeris say already how the craft fly; leave this out"
        problems = [problem(place, sentence) for place in (*craft, *others)]
        raise ValidationError.from_exception_data(cls.__name__, problems)


def _with_tuples(data: Any) -> Any:
    """Return data of a file with tuples for lists: strict models, once they have plain data, take no list for one."""
    if isinstance(data, dict):
        return {key: _with_tuples(value) for key, value in data.items()}
    return tuple(map(_with_tuples, data)) if isinstance(data, list) else data


def _kind_of(data: Any) -> str:
    recorded = "ephemeris" in data if isinstance(data, dict) else isinstance(data, EphemerisTruthOptions)
    return "recorded" if recorded else "propagated"


AnyTruth = TruthOptions | EphemerisTruthOptions
TruthSection = Annotated[
    Annotated[TruthOptions, Tag("propagated")] | Annotated[EphemerisTruthOptions, Tag("recorded")],
    Discriminator(_kind_of),
]
"""The `truth:` section of a campaign: forces and start states, or files of orbits where `ephemeris` stands there."""
