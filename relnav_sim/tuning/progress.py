"""How far a search is: a bar with the time left on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from relnav_sim.runner.progress import clock

EVERY_S = 10.0

Tell = Callable[[int], None]


@contextmanager
def progress_of(total: int, show: bool, left_s: Callable[[], float]) -> Iterator[Tell]:
    """Give what to tell of candidate runs that are done.

    Args:
        total: Candidate runs in all: a run of a case by one candidate each.
        show: False: say nothing.
        left_s: Gives the seconds to go.
    """
    if not show:
        yield lambda count: None
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        words = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[left]}")
        with Progress(*words, console=Console(stderr=True)) as bar:
            task = bar.add_task("tuning", total=total, left="")
            yield lambda count: bar.update(task, advance=count, left=f"{clock(left_s())} left")
    else:
        yield _Lines(total, left_s).advance


class _Lines:
    """A line on standard error every ten seconds, and one at the end."""

    def __init__(self, total: int, left_s: Callable[[], float]) -> None:
        self._total, self._done, self._left_s = total, 0, left_s
        self._began = self._last = time.monotonic()

    def advance(self, count: int) -> None:
        self._done += count
        now = time.monotonic()
        elapsed_s = now - self._began
        if self._done >= self._total:
            print(f"{self._done} candidate runs done in {elapsed_s:.0f} s", file=sys.stderr, flush=True)
        elif now - self._last >= EVERY_S:
            self._last = now
            words = f"{self._done} of {self._total} candidate runs done, about {self._left_s():.0f} s left"
            print(words, file=sys.stderr, flush=True)
