"""Progress of a campaign: a bar with the time left on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Progress(Protocol):
    """Told of every block that is done."""

    def advance(self, runs: int) -> None:
        """Count runs (of one case each) as done."""
        ...


class Silent:
    """Says nothing."""

    def advance(self, runs: int) -> None:
        """Ignore the news."""


class Lines:
    """Plain lines on standard error, at most one in ten seconds and one at the end."""

    def __init__(self, total: int, every_s: float = 10.0) -> None:
        self._total, self._done = total, 0
        self._every_s = every_s
        self._began = self._last = time.monotonic()

    def advance(self, runs: int) -> None:
        """Count, and print a line when one is due."""
        self._done += runs
        now = time.monotonic()
        if self._done < self._total and now - self._last < self._every_s:
            return
        self._last = now
        left = (now - self._began) / self._done * (self._total - self._done)
        rest = f", about {left:.0f} s left" if self._done < self._total else f" in {now - self._began:.0f} s"
        print(f"{self._done} of {self._total} runs done{rest}", file=sys.stderr, flush=True)


@contextmanager
def progress_of(total: int, show: bool) -> Iterator[Progress]:
    """Give what to tell of finished runs.

    Args:
        total: Runs to compute, over all cases; work that is done already does not count.
        show: False: say nothing.
    """
    if not show or total == 0:
        yield Silent()
    elif not sys.stderr.isatty():
        yield Lines(total)
    else:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
        from rich.progress import Progress as Bar

        columns = (
            TextColumn("[bold]{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("runs"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
        )
        with Bar(*columns, console=Console(stderr=True)) as bar:
            task = bar.add_task("simulating", total=total)

            class OnBar:
                def advance(self, runs: int) -> None:
                    bar.advance(task, runs)

            yield OnBar()
