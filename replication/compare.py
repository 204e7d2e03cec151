"""Runs computed here beside the same runs of the committed summaries: do they agree?"""

from __future__ import annotations

import math
from dataclasses import dataclass

from replication.extract import Extract

TOLERANCE = 2e-5
"""Relative difference up to which two numbers of six digits agree."""


@dataclass(frozen=True)
class Comparison:
    """What a campaign's runs say beside the committed ones.

    Attributes:
        campaign: Name of the campaign.
        runs: Runs that both have.
        numbers: Numbers that were compared.
        differing: Those that differ.
        worst: The largest relative difference.
        where: Where that is: case, filter, column and run; empty where nothing differs.
    """

    campaign: str
    runs: int
    numbers: int
    differing: int
    worst: float
    where: str

    @property
    def agrees(self) -> bool:
        """Whether something was compared and all of it agrees."""
        return self.numbers > 0 and self.differing == 0

    def in_words(self) -> str:
        """Return the outcome as a sentence."""
        if self.numbers == 0:
            return f"{self.campaign}: nothing to compare with"
        if self.agrees:
            return f"{self.campaign}: agrees with the committed summary, {self.numbers} numbers of {self.runs} runs"
        return (
            f"{self.campaign}: DIFFERS from the committed summary in {self.differing} of {self.numbers} numbers, most, "
            f"by {100 * self.worst:.2g} %, in {self.where}"
        )


def compared(here: Extract, committed: Extract) -> Comparison:
    """Compare every number that both hold of the same case, filter, column and run.

    Args:
        here: What was computed here.
        committed: The committed summary, of the same settings.
    """
    shared = [run for run in here.runs if run in committed.runs]
    places = {run: (here.runs.index(run), committed.runs.index(run)) for run in shared}
    numbers = differing = 0
    worst, where = 0.0, ""
    for mine, theirs in zip(here.cases, committed.cases, strict=True):
        for filter, columns in mine["columns"].items():
            for column, values in columns.items():
                others = theirs["columns"].get(filter, {}).get(column)
                if others is None:
                    continue
                for run, (a, b) in places.items():
                    numbers += 1
                    apart = _apart(values[a], others[b])
                    differing += apart > TOLERANCE
                    if apart > max(worst, TOLERANCE):
                        worst, where = apart, f"case {mine['label']}, {filter}, {column}, run {run}"
    return Comparison(here.campaign, len(shared), numbers, differing, worst, where)


def _apart(one: float | None, other: float | None) -> float:
    """Return the relative difference of two numbers; None, a filter that failed, agrees with itself alone."""
    if one is None or other is None:
        return 0.0 if one is other else math.inf
    size = max(abs(one), abs(other))
    return abs(one - other) / size if size else 0.0
