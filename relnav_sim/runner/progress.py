"""Progress of a campaign: a bar with the time left on a terminal, plain lines elsewhere.

Both show the running mean over runs of each filter's position error with its interval, which shrinks as runs come in.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from relnav_sim.runner.headline import Figures
from relnav_sim.runner.tally import Tally
from relnav_sim.runner.work import Block

if TYPE_CHECKING:
    from rich.console import RenderableType

CASES_SHOWN = 6


class Progress(Protocol):
    """Told of every block that is done."""

    def advance(self, block: Block, figures: Figures) -> None:
        """Count a block, with the headline figure of its runs."""
        ...


class Silent:
    """Says nothing."""

    def advance(self, block: Block, figures: Figures) -> None:
        """Ignore the news."""


class Lines:
    """Plain lines on standard error, at most once in ten seconds, and of all cases at the end."""

    def __init__(self, tally: Tally, every_s: float = 10.0) -> None:
        self._tally = tally
        self._every_s = every_s
        self._last = time.monotonic()

    def advance(self, block: Block, figures: Figures) -> None:
        """Count, and print a line when one is due."""
        tally = self._tally
        tally.count(block, figures)
        now = time.monotonic()
        finished = tally.done == tally.total
        if not finished and now - self._last < self._every_s:
            return
        self._last = now
        rest = f"in {tally.elapsed_s:.0f} s" if finished else f"about {tally.left_s:.0f} s left"
        trouble = f"; {tally.trouble}" if tally.trouble else ""
        print(f"{tally.done} of {tally.total} runs done, {rest}{trouble}", file=sys.stderr)
        rows = tally.cases() if finished else [tally.row(block.case.id)]
        for label, _, means in rows[:CASES_SHOWN]:
            print(f"  {label}: position error {means}", file=sys.stderr)
        if len(rows) > CASES_SHOWN:
            print(f"  and {len(rows) - CASES_SHOWN} more cases", file=sys.stderr)
        sys.stderr.flush()


class Bar:
    """A bar over all runs and a row for each case under way, drawn anew by `rich` a few times a second."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally

    def advance(self, block: Block, figures: Figures) -> None:
        """Count."""
        self._tally.count(block, figures)

    def __rich__(self) -> RenderableType:
        """Return the picture of this moment."""
        from rich.console import Group
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        tally = self._tally
        left = f"{clock(tally.left_s)} left" if math.isfinite(tally.left_s) else ""
        trouble = [Text(tally.trouble, style="yellow")] if tally.trouble else []
        head = Table.grid(padding=(0, 1))
        head.add_row(
            Text("simulating", style="bold"),
            ProgressBar(total=tally.total, completed=tally.done, width=40),
            Text(f"{tally.done}/{tally.total} runs  {clock(tally.elapsed_s)}  {left}"),
        )
        rows = tally.cases_under_way()
        cases = Table.grid(padding=(0, 2))
        for label, count, means in rows[:CASES_SHOWN]:
            cases.add_row(Text(label, style="dim"), Text(count), Text(means))
        more = [Text(f"and {len(rows) - CASES_SHOWN} more cases")] if len(rows) > CASES_SHOWN else []
        return Group(head, *trouble, cases, *more)


@contextmanager
def progress_of(tally: Tally, show: bool) -> Iterator[Progress]:
    """Give what to tell of finished blocks.

    Args:
        tally: Counts them.
        show: False: say nothing.
    """
    if not show or tally.total == 0:
        yield Silent()
    elif not sys.stderr.isatty():
        yield Lines(tally)
    else:
        from rich.console import Console
        from rich.live import Live

        bar = Bar(tally)
        with Live(bar, console=Console(stderr=True), refresh_per_second=4):
            yield bar


def clock(seconds: float) -> str:
    """Return seconds as hours, minutes and seconds."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
