"""What a user demands of the filters: `requirements:` of a campaign file.

They judge a result and change no number of it, so they stand outside the campaign's hash and may be changed after the
campaign has run.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, TypeAdapter, model_validator

from relnav_sim.conventions import CONFIDENCE
from relnav_sim.options import Options

Quantity = Literal["r", "v", "x", "y", "z", "vx", "vy", "vz"]
Span = Literal["settled", "whole"]
Interpretation = Literal["ensemble", "temporal", "mixed"]

_OF_RUNS = 0.95

_QUANTITY = "Error to look at: r position, v velocity (norms), or one component in RTN; default r"
_SPAN = "settled: the steady state, t >= settle_s; whole: every epoch after the start; default settled"
_BELOW_M = "Limit of a position error, m"
_BELOW_M_S = "Limit of a velocity error, m/s"


class Requirement(Options):
    """What every requirement has."""

    filters: tuple[str, ...] | None = Field(
        default=None, min_length=1, description="Names of the filters that must meet it; default: every filter"
    )
    confidence: float = Field(
        default=CONFIDENCE,
        ge=0.5,
        lt=1,
        description="Pass or fail is said once the interval of this confidence over runs lies on one side of the "
        "limit; default 0.95, as in the rest of the report",
    )


class _WithLimit(Requirement):
    """A requirement with a limit in the unit of its quantity."""

    quantity: Quantity = Field(default="r", description=_QUANTITY)
    below_m: float | None = Field(default=None, gt=0, description=_BELOW_M)
    below_m_s: float | None = Field(default=None, gt=0, description=_BELOW_M_S)

    @model_validator(mode="after")
    def _one_limit(self) -> Self:
        given = {"below_m": self.below_m, "below_m_s": self.below_m_s}
        wanted, other = ("below_m_s", "below_m") if self.quantity.startswith("v") else ("below_m", "below_m_s")
        if given[wanted] is None or given[other] is not None:
            raise ValueError(f"the limit of {self.quantity} is {wanted}, and only that")
        return self

    @property
    def limit(self) -> float:
        """The limit, m or m/s."""
        return self.below_m if self.below_m is not None else float(self.below_m_s or 0.0)


class ErrorsRequirement(_WithLimit):
    """A share of errors lies below a limit; epochs after a failure count as errors above it."""

    kind: Literal["errors"] = Field(description="errors: a share of errors below a limit")
    interpretation: Interpretation = Field(
        default="mixed",
        description="What the share is of (ECSS-E-ST-60-10C): ensemble (of the runs, each below the limit at all "
        "times), temporal (of the time of each run, in `of_runs` of the runs) or mixed (of all epochs of all runs; "
        "default)",
    )
    share: float = Field(gt=0, lt=1, description="Share of the runs, the time or the epochs, as 0.997")
    of_runs: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="Temporal: share of the runs that must keep it; default 0.95: no number of runs shows that all do",
    )
    inside_m: float | None = Field(
        default=None, gt=0, description="Only epochs at which the true distance is at most this, m; default: all"
    )
    from_s: float = Field(
        default=0.0, ge=0, description="Only epochs from this time on, s; default 0: all but the start"
    )

    @model_validator(mode="after")
    def _runs_of_a_temporal_one(self) -> Self:
        if self.interpretation != "temporal" and self.of_runs is not None:
            raise ValueError(f"of_runs belongs to the temporal interpretation, not to {self.interpretation}")
        return self

    @property
    def runs_that_keep_it(self) -> float:
        """Temporal: share of the runs that must keep it."""
        return _OF_RUNS if self.of_runs is None else self.of_runs


class RmsRequirement(_WithLimit):
    """The root mean square over time of an error, mean over the runs that did not fail, lies below a limit."""

    kind: Literal["rms"] = Field(description="rms: the RMS below a limit")
    span: Span = Field(default="settled", description=_SPAN)


class NeesRequirement(Requirement):
    """The filter is consistent: its sigmas are right within a margin, by the mean NEES over runs and time."""

    kind: Literal["nees"] = Field(description="nees: consistency")
    block: Literal["each", "full", "position", "velocity"] = Field(
        default="each",
        description="Part of the state: full, position, velocity, or each of the three; default each, as an "
        "overconfident position can hide behind a conservative velocity",
    )
    sigma_margin: float = Field(
        default=0.1,
        gt=0,
        lt=1,
        description="How far the ratio of actual to formal sigma, sqrt(ANEES), may be from 1; default 0.1, which a "
        "review would not argue about. Without a margin no number of runs could ever show consistency",
    )
    span: Span = Field(default="settled", description=_SPAN)


class NisRequirement(Requirement):
    """The filter's innovations are consistent: their sigmas are right within a margin, by the mean NIS."""

    kind: Literal["nis"] = Field(description="nis: consistency of the innovations")
    sensor: str | None = Field(
        default=None,
        min_length=1,
        description="Name of the sensor whose measurements count; default: all of the filter's",
    )
    sigma_margin: float = Field(
        default=0.1,
        gt=0,
        lt=1,
        description="How far the ratio of true to formal sigma of the innovations, the square root of the NIS per "
        "degree of freedom, may be from 1; default 0.1",
    )
    span: Span = Field(default="settled", description=_SPAN)


class ConvergedRequirement(Requirement):
    """A share of the runs converges in time; a run that fails or never converges does not."""

    kind: Literal["converged"] = Field(description="converged: convergence in time")
    within_s: float = Field(gt=0, description="Latest time of convergence, s")
    share: float = Field(gt=0, lt=1, description="Share of the runs, as 0.95")
    below_m: Literal[1, 2, 5, 10, 20, 50, 100] | None = Field(
        default=None,
        description="Position error to stay below for `convergence_hold_s`, m; default: the campaign's `convergence_m`",
    )


class FailedRequirement(Requirement):
    """At most a share of the runs fails: estimate or covariance not finite, covariance not positive definite."""

    kind: Literal["failed"] = Field(description="failed: few failed runs")
    at_most: float = Field(gt=0, lt=1, description="Share of the runs, as 0.01")


class DivergedRequirement(Requirement):
    """At most a share of the runs diverges, failures included; docs/statistics.md has the definition."""

    kind: Literal["diverged"] = Field(description="diverged: few diverged runs")
    at_most: float = Field(gt=0, lt=1, description="Share of the runs, as 0.01")


class RecoveryRequirement(Requirement):
    """Filters that reject measurements recover in time: a share of the runs that were locked out, or diverged, is back.

    A run that fails, or diverges without a lock-out, is not; nor is one that follows a sensor's fault.
    """

    kind: Literal["recovery"] = Field(description="recovery: recovery from lock-outs in time")
    within_s: float = Field(
        gt=0, description="Longest time from the first of a lock-out's rejections to the recovery, s; docs/editing.md"
    )
    share: float = Field(gt=0, lt=1, description="Share of the runs that were locked out or diverged, as 0.99")


AnyRequirement = Annotated[
    ErrorsRequirement
    | RmsRequirement
    | NeesRequirement
    | NisRequirement
    | ConvergedRequirement
    | RecoveryRequirement
    | FailedRequirement
    | DivergedRequirement,
    Field(discriminator="kind"),
]


def stored_requirements(content: Mapping[str, Any]) -> dict[str, AnyRequirement]:
    """Return the requirements of a campaign's content as a results file carries it; none in files without any.

    Raises:
        ValueError: They are damaged.
    """
    given = content.get("requirements") or {}
    return TypeAdapter(dict[str, AnyRequirement]).validate_python(given, strict=False)
