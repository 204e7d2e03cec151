"""How long a campaign has to go: the plan's costs of what is left, corrected by what the blocks have taken so far.

Counting runs would say little: one filter may cost a thousand times another, and cases have different durations.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from relnav_sim.campaign.blocks import STATISTICS_US, filter_cost_us
from relnav_sim.campaign.plan import block_seconds, bound_seconds
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.work import Block

Key = tuple[str, str]
"""Case id and filter name; a bound has no filter, but `_BOUND`."""

_BOUND = ""
_OVERDUE = 0.25
"""Share of its time so far that a task is thought to need still once it has taken longer than expected."""


@dataclass
class _Cost:
    """Planned and measured seconds of what has been computed."""

    planned_s: float = 0.0
    measured_s: float = 0.0

    def add(self, planned_s: float, measured_s: float) -> None:
        self.planned_s += planned_s
        self.measured_s += measured_s

    @property
    def ratio(self) -> float | None:
        return self.measured_s / self.planned_s if self.planned_s > 0 else None


@dataclass
class TimeLeft:
    """Estimates durations; told of tasks before they begin and when they are done.

    Attributes:
        like: Under which name the costs of a filter are gathered: candidates of a search are many, filters few.
    """

    like: Callable[[str], str] = str
    _left_s: dict[Key, float] = field(default_factory=dict)
    _plans: dict[Hashable, Mapping[Key, float]] = field(default_factory=dict)
    _of_case: dict[Key, _Cost] = field(default_factory=dict)
    _of_filter: dict[str, _Cost] = field(default_factory=dict)
    _all: _Cost = field(default_factory=_Cost)

    def expect(self, tasks: Iterable[Task]) -> None:
        """Take note of tasks that are to be computed, in addition to those before."""
        for task in tasks:
            for key, seconds in self._planned(task).items():
                self._left_s[key] = self._left_s.get(key, 0.0) + seconds

    def took(self, task: Task, seconds: float | None) -> None:
        """Count a task, or a piece of one, that is done.

        Args:
            task: The task.
            seconds: What it took its worker, s; None: not known, as it was given up.
        """
        planned = self._planned(task)
        for key, share in planned.items():
            self._left_s[key] = max(self._left_s.get(key, 0.0) - share, 0.0)
        if seconds is None:
            return
        ratio = seconds / sum(planned.values())
        for key, share in planned.items():
            self._of_case.setdefault(key, _Cost()).add(share, share * ratio)
            self._of_filter.setdefault(key[1], _Cost()).add(share, share * ratio)
            self._all.add(share, share * ratio)

    def expected_s(self, task: Task) -> float:
        """Return how long a task should take, s."""
        return sum(share * self._ratio(key) for key, share in self._planned(task).items())

    def is_measured(self, task: Task) -> bool:
        """Return whether something like it has been computed: the same case with the same filters."""
        return all(key in self._of_case for key in self._planned(task))

    def left_s(self, running: Sequence[tuple[Task, float]], places: float) -> float:
        """Return the seconds to go; infinite without a place to compute in, zero with nothing to compute.

        Args:
            running: The tasks that are being computed, with the seconds since each began.
            places: How many tasks are computed at a time.
        """
        everything = sum(seconds * self._ratio(key) for key, seconds in self._left_s.items())
        expected = [(self.expected_s(task), elapsed) for task, elapsed in running]
        rests = [max(whole - elapsed, _OVERDUE * elapsed if elapsed > whole else 0.0) for whole, elapsed in expected]
        waiting = max(everything - sum(whole for whole, _ in expected), 0.0)
        if not waiting and not rests:
            return 0.0
        return max((waiting + sum(rests)) / places if places > 0 else math.inf, *rests, 0.0)

    def _ratio(self, key: Key) -> float:
        """Return what a planned second takes, by the nearest that has been measured."""
        for cost in (self._of_case.get(key), self._of_filter.get(key[1]), self._all):
            if cost is not None and (ratio := cost.ratio) is not None:
                return ratio
        return 1.0

    def _planned(self, task: Task) -> Mapping[Key, float]:
        """Return the planned seconds of a task by case and filter; they are the same for all blocks of one kind."""
        if isinstance(task, BoundTask):
            return {(task.case.id, _BOUND): bound_seconds(task.case.config)}
        names = tuple(task.case.config.filters)
        kind = (task.folder, task.case.id, names, len(task.runs))
        if kind not in self._plans:
            self._plans[kind] = self._shares(task, names)
        return self._plans[kind]

    def _shares(self, block: Block, names: tuple[str, ...]) -> Mapping[Key, float]:
        """Return what each filter of a block costs, s; what they have in common is shared out by their own costs."""
        config = block.case.config
        costs: dict[str, float] = {}
        for name in names:
            like = self.like(name)
            costs[like] = costs.get(like, 0.0) + STATISTICS_US + filter_cost_us(config.filters[name])
        whole = block_seconds(config, names, len(block.runs))
        return {(block.case.id, like): whole * cost / sum(costs.values()) for like, cost in costs.items()}
