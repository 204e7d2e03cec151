"""What stands with a figure, for eyes and screen readers: its caption, and its alternative text with what matters.

Each kind of figure has its words in its own file; here is what they share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from relnav_sim.plots.data import drawn_step
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.filter_facts import FilterFacts

BOUND_NOTE = (
    "The posterior Cramér-Rao bound (PCRB), where stored, is one on the root mean square over runs, which is above the "
    "mean drawn here."
)
NO_ERROR = "Empty: every run failed; there is no error to draw."


@dataclass(frozen=True)
class FigureWords:
    """The words of one figure.

    Attributes:
        caption: What it shows and how to read it.
        alt: What someone who can't see it must know.
    """

    caption: str
    alt: str


def thinned(case: CaseFacts) -> list[str]:
    """Return a sentence where a figure over time draws fewer epochs than are stored."""
    step = drawn_step(len(case.times_s))
    return [f"One stored epoch in {step} is drawn."] if step > 1 else []


def left_out(filters: Sequence[FilterFacts]) -> list[str]:
    """Return a sentence on the runs that no figure draws."""
    failed = [f"{item.name} {item.failed} of {len(item.runs)}" for item in filters if item.failed]
    return [f"Failed runs are left out ({', '.join(failed)})."] if failed else []
