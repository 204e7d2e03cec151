"""Manoeuvres as a campaign plans them, and how badly they are carried out."""

from __future__ import annotations

from itertools import combinations
from typing import Literal

import numpy as np
from pydantic import Field, model_validator

from relnav_sim.arrays import Array
from relnav_sim.options import Options

Vector = tuple[float, float, float]

_AXES = "in the RTN axes (radial, along-track, normal) of the craft's own orbit"


class ExecutionErrors(Options):
    """How far a manoeuvre misses its plan, drawn anew for each manoeuvre and run."""

    magnitude_sigma_percent: float = Field(
        default=0.0, ge=0, le=30, description="Standard deviation of the thrust's size, percent of it; default 0"
    )
    direction_sigma_deg: float = Field(
        default=0.0,
        ge=0,
        le=30,
        description="Standard deviation of its direction about each of the two axes across it, deg; default 0",
    )
    timing_sigma_s: float = Field(
        default=0.0, ge=0, description="Standard deviation of its start, s; a burn keeps its duration; default 0"
    )

    @property
    def any(self) -> bool:
        """Whether anything varies."""
        return any((self.magnitude_sigma_percent, self.direction_sigma_deg, self.timing_sigma_s))


class ManoeuvreOptions(Options):
    """A change of velocity at one instant or, with a duration, a burn of constant acceleration."""

    craft: Literal["chief", "deputy"] = Field(default="deputy", description="The craft that thrusts; default: deputy")
    time_s: float = Field(gt=0, description="When it happens or begins, s after the start of the run")
    duration_s: float | None = Field(
        default=None, gt=0, description="How long the burn lasts, s; default: none, an impulse"
    )
    delta_v_m_s: Vector | None = Field(
        default=None,
        description=f"Change of velocity, m/s, {_AXES}; of a burn: the acceleration times the duration, the axes "
        "turning with the orbit meanwhile",
    )
    acceleration_m_s2: Vector | None = Field(
        default=None, description=f"Acceleration of a burn, m/s^2, {_AXES}; give this or delta_v_m_s"
    )
    errors: ExecutionErrors | None = Field(
        default=None, description="How badly it is carried out; default: as `execution_errors` says for all"
    )

    @model_validator(mode="after")
    def _one_form(self) -> ManoeuvreOptions:
        if self.duration_s is None and self.acceleration_m_s2 is not None:
            raise ValueError("acceleration_m_s2 needs a duration_s; an impulse has a delta_v_m_s")
        if (self.delta_v_m_s is None) == (self.acceleration_m_s2 is None):
            raise ValueError("give exactly one of delta_v_m_s and acceleration_m_s2")
        if not any(self.delta_v_m_s or self.acceleration_m_s2 or ()):
            raise ValueError("the thrust is zero: leave the manoeuvre out")
        return self

    @property
    def delta_v(self) -> Array:
        """The planned change of velocity (3,), m/s."""
        if self.acceleration_m_s2 is not None:
            return np.array(self.acceleration_m_s2) * (self.duration_s or 0.0)
        return np.array(self.delta_v_m_s)

    @property
    def end_s(self) -> float:
        """When it is planned to be over, s."""
        return self.time_s + (self.duration_s or 0.0)


def overlaps(manoeuvres: dict[str, ManoeuvreOptions]) -> list[tuple[str, str]]:
    """Return the pairs of manoeuvres of the same craft that are planned to happen at the same time, later one first."""
    ordered = sorted(manoeuvres.items(), key=lambda item: item[1].time_s)
    return [
        (later, earlier)
        for (earlier, first), (later, second) in combinations(ordered, 2)
        if first.craft == second.craft and (second.time_s < first.end_s or second.time_s == first.time_s)
    ]
