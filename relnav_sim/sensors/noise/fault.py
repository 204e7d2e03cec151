"""What faults of a sensor have in common: they begin, and may end, at the same times in every run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar, Protocol, Self

from pydantic import Field, model_validator

from relnav_sim.arrays import Array, Mask
from relnav_sim.options import Options
from relnav_sim.sensors.sensed import Sensed

Values = float | tuple[float, ...]
From = Annotated[float, Field(ge=0, description="When the fault begins, s after the start of the run")]


class FaultOptions(Options):
    """A fault of a sensor; no filter is told of it."""

    stream: ClassVar[str]

    from_s: From
    until_s: float | None = Field(
        default=None, gt=0, description="When it ends, s: from then on the sensor is sound again; default: never"
    )

    @model_validator(mode="after")
    def _ends_later(self) -> Self:
        if self.until_s is not None and self.until_s <= self.from_s:
            raise ValueError(f"the fault ends at {self.until_s:g} s, which is not after its begin at {self.from_s:g} s")
        return self

    def on(self, times_s: Array) -> Mask:
        """Return when the fault is there, (K,)."""
        begun = times_s >= self.from_s
        return begun if self.until_s is None else begun & (times_s < self.until_s)

    @property
    def per_channel(self) -> Values | None:
        """What it says of the channels, one number for all or one for each; None: it is not by channel."""
        return None


class Fault(Protocol):
    """A fault that does not add to measurements, over one block of runs; it remembers where the last chunk ended."""

    def seen(self, truth: Sensed) -> Sensed:
        """Return the truth as the faulty sensor meets it."""
        ...

    def reported(self, z: Array, times_s: Array) -> Array:
        """Return what it reports, (runs, K, m), of what it reads."""
        ...


def faults_of(parts: Sequence[Options]) -> tuple[Fault, ...]:
    """Return the faults among the parts of a noise that do not add, for one block of runs."""
    made = (getattr(part, "fault", None) for part in parts)
    return tuple(make() for make in made if make is not None)
