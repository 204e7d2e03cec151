"""What the measurements of a filter's sensors can tell of the state at all, as a result holds it and says it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.printable import printable

NOT_OBSERVABLE = 0.9
"""Ratio of posterior to prior sigma above which, at the end of a run, the measurements have told next to nothing."""
_FILTERS_NAMED = 8


@dataclass(frozen=True)
class Observability:
    """What measurements tell a filter beyond its start, in the direction in which they tell least.

    Attributes:
        sensors: The sensors whose measurements they are.
        ratio: Posterior over prior sigma in the weakest direction of the relative state, at stored epochs, (times,).
        states: Names of the states: position and velocity, RTN, and the augmented ones that are estimated, (n,).
        direction: The weakest direction at the end, in sigmas of the start, (n,): of unit length over position and
            velocity; of the augmented states what goes with it.
        sigma_ratio: Posterior over prior sigma of each state by itself at the end, (n,).
        blind: Number of independent directions of position and velocity with a ratio above `NOT_OBSERVABLE` at the end.
        weakest: The weakest direction in words.
        course: The same over time: from when on, s, and the words; empty in files of earlier versions. Where several
            directions have a ratio above `NOT_OBSERVABLE` it says how many.
    """

    sensors: tuple[str, ...]
    ratio: Array
    states: tuple[str, ...]
    direction: Array
    sigma_ratio: Array
    blind: int
    weakest: str
    course: tuple[tuple[float, str], ...] = ()

    def weakest_at(self, time_s: float) -> str:
        """Return the weakest direction in words by the measurements up to a time; empty: not known, or none yet."""
        return next((words for from_s, words in reversed(self.course) if from_s <= time_s), "")

    @property
    def observable(self) -> bool:
        """Whether the measurements tell something of the whole relative state."""
        return self.blind == 0

    def agrees(self, other: Observability) -> bool:
        """Return whether both say the same, bit for bit."""
        words = [(one.sensors, one.states, one.blind, one.weakest, one.course) for one in (self, other)]
        return words[0] == words[1] and all(map(np.array_equal, self.arrays, other.arrays))

    @property
    def arrays(self) -> tuple[Array, Array, Array]:
        """Its numbers: ratio, direction and sigma_ratio."""
        return self.ratio, self.direction, self.sigma_ratio

    @property
    def untold(self) -> tuple[str, ...]:
        """The augmented states of which the measurements tell next to nothing."""
        pairs = list(zip(self.states, self.sigma_ratio, strict=True))[6:]
        return tuple(name for name, ratio in pairs if ratio > NOT_OBSERVABLE)


def course_of(stored: Iterable[Any]) -> tuple[tuple[float, str], ...]:
    """Return the weakest direction over time from plain data.

    Raises:
        ValueError: It is damaged.
    """
    course = tuple((float(from_s), printable(str(words))) for from_s, words in stored)
    times = [from_s for from_s, _ in course]
    if not np.isfinite(times).all() or sorted(set(times)) != times:
        raise ValueError("the times do not ascend")
    return course


def not_observable(found: Mapping[str, Observability]) -> list[str]:
    """Return a sentence for each set of sensors that can't observe the state, and for untold augmented states.

    Args:
        found: Of filters by name.
    """
    said: dict[str, list[str]] = {}
    for name, one in found.items():
        if sentence := _sentence(one):
            said.setdefault(sentence, []).append(name)
    return [f"{_filters(names)} {sentence}" for sentence, names in said.items()]


def _sentence(found: Observability) -> str:
    """Return what is said of a filter behind its name; nothing where all is well."""
    by = f"(sensor{'s' if len(found.sensors) > 1 else ''} {', '.join(found.sensors)})"
    if not found.observable:
        many = f"{found.blind} of 6 directions, the weakest along " if found.blind > 1 else ""
        return (
            f"{by}: not observable: {many}{found.weakest}. At the end the measurements leave "
            f"{100 * found.ratio[-1]:.0f} % of the start's sigma there, so the error says how good the start was, "
            "not how good the filter is."
        )
    if found.untold:
        states = f"state{'s' if len(found.untold) > 1 else ''} {', '.join(found.untold)}"
        return (
            f"{by}: the measurements tell next to nothing of the augmented {states} beyond the sigma at the start; "
            "mode: consider accounts for what can't be told."
        )
    return ""


def _filters(names: Sequence[str]) -> str:
    shown = ", ".join(names[:_FILTERS_NAMED])
    more = f" and {len(names) - _FILTERS_NAMED} more" if len(names) > _FILTERS_NAMED else ""
    return f"Filter{'s' if len(names) > 1 else ''} {shown}{more}"
