"""The sections of a campaign file that belong to no other layer, and one validated case."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, SerializeAsAny, WithJsonSchema, field_validator, model_validator

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.options import AddedLater, OfReports, Options
from relnav_sim.sensors import SensorOptions
from relnav_sim.truth import TruthSection

LARGEST_SEED = 2**63 - 1
MATTERS_PERCENT = 1.0
MOST_RUNS = 1_000_000

Vector = tuple[float, float, float]
Positive = Annotated[float, Field(gt=0)]


def _on_every_axis(value: object) -> object:
    """Return one number as three, so that both spellings mean (and hash as) the same."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (value,) * 3
    return tuple(value) if isinstance(value, list) else value


_SIGMA = {"type": "number", "exclusiveMinimum": 0}
Sigmas = Annotated[
    tuple[Positive, Positive, Positive],
    BeforeValidator(_on_every_axis),
    WithJsonSchema({"anyOf": [_SIGMA, {"type": "array", "prefixItems": [_SIGMA] * 3, "minItems": 3, "maxItems": 3}]}),
]


def exact(value: float) -> Fraction:
    """Return the decimal number as written: 0.2 is one fifth, not the double nearest to it."""
    return Fraction(repr(value))


class Clock(Options):
    """When things happen: every run starts at 0 and steps evenly to the end."""

    duration_s: float = Field(gt=0, description="Length of a run, s; a whole number of steps")
    step_s: float = Field(gt=0, description="Time between epochs, s: the filters predict and update once a step")
    store_every_s: float = Field(
        gt=0,
        description="Time between stored points of the error series, s; a whole number of steps. Statistics use "
        "every epoch whatever is stored",
    )
    store_covariance: Annotated[bool, AddedLater()] = Field(
        default=False,
        description="Whether the formal covariance of position and velocity is stored whole at the stored points, with "
        "its correlations; default false: its sigmas only. It more than doubles the stored series, by 84 bytes for "
        "each run, filter and point",
    )

    @property
    def epochs(self) -> int:
        """Number of epochs, the start included: duration / step + 1."""
        return round(exact(self.duration_s) / exact(self.step_s)) + 1

    @property
    def store_every(self) -> int:
        """Every how many epochs one is stored."""
        return round(exact(self.store_every_s) / exact(self.step_s))

    @property
    def stored(self) -> int:
        """Number of stored epochs, the start included."""
        return (self.epochs - 1) // self.store_every + 1


class FirstFixStart(Options):
    """Every filter starts at the position that the first measurement gives; needs a sensor that gives one by itself."""

    kind: Literal["first_fix"] = Field(
        default="first_fix", description="Start at the position that the first measurement gives"
    )
    velocity_m_s: Vector = Field(
        default=(0.0, 0.0, 0.0),
        description="Relative velocity assumed at the start, m/s, RTN (radial, along-track, normal); "
        "default 0, as Shi et al. (2025) start",
    )
    velocity_sigma_m_s: Sigmas = Field(
        default=(1.0, 1.0, 1.0),
        description="Its standard deviation, m/s, one number or one for each axis; default 1, "
        "large against relative orbital motion of some km",
    )


class DispersedStart(Options):
    """Every filter starts at the true state plus a random error of the given size, drawn anew in each run."""

    kind: Literal["dispersed"] = Field(description="Start at the truth plus a random error")
    position_sigma_m: Sigmas = Field(
        description="Standard deviation of the position error, m, RTN, one number or one for each axis; "
        "also the filters' initial covariance"
    )
    velocity_sigma_m_s: Sigmas = Field(
        description="Standard deviation of the velocity error, m/s, RTN, one number or one for each axis; "
        "also the filters' initial covariance"
    )


class GivenStart(Options):
    """Every filter starts at the same given state in all runs."""

    kind: Literal["given"] = Field(description="Start at a given state")
    position_m: Vector = Field(description="Relative position, m, RTN (radial, along-track, normal)")
    velocity_m_s: Vector = Field(description="Relative velocity, m/s, RTN")
    position_sigma_m: Sigmas = Field(
        description="Standard deviation of the position in the filters' initial covariance, m, RTN"
    )
    velocity_sigma_m_s: Sigmas = Field(
        description="Standard deviation of the velocity in the filters' initial covariance, m/s, RTN"
    )


StartOptions = Annotated[FirstFixStart | DispersedStart | GivenStart, Field(discriminator="kind")]


class StatisticsOptions(Options):
    """Over which epochs the metrics of the report are taken."""

    settle_s: float = Field(
        default=500.0,
        ge=0,
        description="The steady state begins at this time, s; default 500, about a twelfth of a low orbit's period",
    )
    convergence_m: float = Field(
        default=10.0,
        gt=0,
        description="A run has converged once its position error stays below this, m; default 10",
    )
    convergence_hold_s: float = Field(
        default=50.0, ge=0, description="... for this long, s; default 50, so that a lucky crossing does not count"
    )
    whiteness: Annotated[bool, AddedLater()] = Field(
        default=False,
        description="Whether the residuals of each channel are tested for correlation; default false: it costs "
        "one more prediction of each measurement",
    )
    matters_percent: Annotated[float, OfReports()] = Field(
        default=MATTERS_PERCENT,
        gt=0,
        lt=100,
        description="Equivalence margin of the report's decision: a difference in position RMS below this does not "
        "matter, percent; default 1. Changes no result",
    )


class StopOptions(Options):
    """When a campaign has run enough: looked at after fixed numbers of runs only, in run order."""

    metric: Literal["r_rms_m", "v_rms_m_s", "settled_r_rms_m", "settled_v_rms_m_s"] = Field(
        description="The metric of each run: rms of the position (r) or velocity (v) error over the whole run or "
        "after `settle_s`"
    )
    filter: str | None = Field(default=None, description="Name of the filter to look at; default: all of them")
    half_width: float = Field(
        gt=0,
        description="Stop once the 95 % interval of the metric's mean over the runs that did not fail reaches no "
        "farther than this to each side, in the metric's unit, in every case",
    )
    at: tuple[Annotated[int, Field(ge=2)], ...] = Field(
        min_length=1, description="Numbers of runs to look after, ascending; `runs` is the last look in any case"
    )

    @field_validator("at")
    @classmethod
    def _ascending(cls, at: tuple[int, ...]) -> tuple[int, ...]:
        if any(later <= earlier for earlier, later in pairwise(at)):
            raise ValueError("the numbers of runs must ascend")
        return at


TuneObjective = Literal["position", "velocity", "consistency", "both", "in_band"]
TuneSpan = Literal["settled", "whole"]


class TuneOptions(Options):
    """How `relnav tune` searches the free numbers of the filters; a campaign's own run does not look at it."""

    filters: tuple[str, ...] = Field(
        default=(),
        description="Names of the filters to tune; default: all that have a free number. `--filter` takes its place",
    )
    objective: TuneObjective = Field(
        default="both",
        description="What is made small: position or velocity (RMS error over the span, mean over runs, geometric mean "
        "over cases), consistency (squared log of the mean ANEES, mean over cases), both (log of the position RMS + "
        "`weight` x consistency) or in_band (position among the candidates whose mean ANEES lies in `anees_band` in "
        "every case); default both: by the error alone, any process noise that is small enough is as good",
    )
    weight: float = Field(
        default=0.25,
        gt=0,
        description="Objective both: weight of consistency; default 0.25, with which an ANEES of 2 or 1/2 counts as "
        "much as 12 % of position error",
    )
    anees_band: tuple[float, float] | None = Field(
        default=None,
        description="Objective in_band: least and greatest mean ANEES of each case; default: the 95 % chi-square band "
        "of as many independent errors as there are runs, [0.76, 1.27] for 20 runs",
    )
    span: TuneSpan = Field(
        default="settled", description="settled (after `settle_s`; default) or whole (from the first epoch)"
    )
    budget: int = Field(
        default=25, ge=5, le=1000, description="Most candidates tried for each filter, the same for all; default 25"
    )
    runs: int = Field(
        default=20,
        ge=2,
        le=10_000,
        description="Runs of each case for every candidate; default 20: fewer hardly cost less, computed as one",
    )
    check_runs: int = Field(
        default=30,
        ge=0,
        le=10_000,
        description="Further runs, on yet another seed, on which start and tuned filter are compared; default 30, 0: "
        "no check",
    )
    free: dict[str, tuple[float, float] | None] = Field(
        default={},
        description="Numbers to search, by path (filters.ekf.alpha), each with its range [low, high], or nothing for "
        "the range that the filter declares. A filter named here has these free and no others; default: what "
        "`relnav show filter` lists",
    )

    @model_validator(mode="after")
    def _band_in_order(self) -> TuneOptions:
        if self.anees_band is not None and not 0 < self.anees_band[0] < self.anees_band[1]:
            raise ValueError("anees_band must be two numbers above 0, the smaller one first")
        return self


class Untold(Options):
    """What happens in a stressed case and no filter is told of: its truth, its sensors, its error at the start."""

    truth: TruthSection
    sensors: dict[str, SerializeAsAny[SensorOptions]]
    start: StartOptions


class CaseConfig(Options):
    """One point of a campaign's grid: everything that a run needs but its number and the seed.

    Its sections are what filters are told of. What is simulated is `flown`, which is the same but in a stressed case.
    """

    name: str = Field(description="The campaign's name")
    clock: Clock
    truth: TruthSection
    sensors: dict[str, SerializeAsAny[SensorOptions]]
    start: StartOptions = FirstFixStart()
    filters: dict[str, SerializeAsAny[FilterEntry]]
    statistics: StatisticsOptions = StatisticsOptions()
    untold: Untold | None = Field(
        default=None, exclude=True, description="What is simulated instead in a stressed case; no part of its identity"
    )

    @property
    def flown(self) -> CaseConfig:
        """The case with what really happens in place of what filters are told of."""
        if self.untold is None:
            return self
        parts = {name: getattr(self.untold, name) for name in type(self.untold).model_fields}
        return self.model_copy(update={**parts, "untold": None})

    @property
    def told(self) -> CaseConfig:
        """The case as filters are told of it, and as if that were all that happens."""
        return self.model_copy(update={"untold": None})
