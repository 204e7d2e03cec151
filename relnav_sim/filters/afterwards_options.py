"""What a campaign says of estimates that need later measurements: smoothers, and starts that are fitted."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from relnav_sim.options import Options


class LagOptions(Options):
    """How late a fixed-lag smoother's estimates are."""

    lag_s: float = Field(gt=0, description="How much later its last measurement is, s; a whole number of steps")


class FixedLagOptions(Options):
    """The estimate of each epoch is that of a fixed time later: what a user has who can wait that long."""

    fixed_lag: LagOptions = Field(description="Measurements up to a fixed time later")


def _word_or_section(value: object) -> str:
    return "section" if isinstance(value, dict | FixedLagOptions) else "word"


SmootherOption = Annotated[
    Annotated[Literal["rts"], Tag("word")] | Annotated[FixedLagOptions, Tag("section")],
    Discriminator(_word_or_section),
]
"""A filter's `smoother:`: the word rts, or a section that says the lag."""


class BatchStartOptions(Options):
    """A start by batch least squares over the first measurements, by the filter's own models without process noise."""

    duration_s: float = Field(
        gt=0, description="Measurements up to this time after the start, s; a whole number of steps"
    )
