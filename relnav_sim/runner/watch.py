"""Watches over tasks while they are computed: what is running, what went wrong, what takes too long, how long to go.

It writes the log and says what a user should know; nothing that is computed depends on it.
"""

from __future__ import annotations

import platform
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from relnav_sim.results.failure_kinds import KILLED, TIMEOUT
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.event_log import EventLog, now
from relnav_sim.runner.executors.interface import Ended, Fault, Say
from relnav_sim.runner.process_mark import process_mark
from relnav_sim.runner.time_left import TimeLeft

HERE = "here"
BEAT_EVERY_S = 60.0
ETA_EVERY_S, ETA_EACH_S, ETA_SHARE = 1.0, 0.01, 0.02
"""The time left is found out at most so often: the more seldom the more is running, and in this share of the time."""
SLOW_TIMES, SLOW_AT_LEAST_S = 5.0, 60.0
"""A task is called slow after so many times what its like have taken, and after so long at least."""
UNKNOWN_TIMES = 20.0
"""The same where nothing like it has been computed: plans are good to a factor of two, machines are older."""
PLACES_FORGOTTEN_S = 120.0

_TOLD = {Fault.KILLED: KILLED, Fault.TOO_LONG: TIMEOUT}
_FAULTS = {
    Fault.KILLED: "a worker process on {host} died while it computed {what}",
    Fault.LOST: "a worker on {host} is gone, with {what}",
    Fault.TOO_LONG: "{what} took too long on {host}",
    Fault.NO_MEMORY: "not enough memory on {host} for {what}",
}


class Observer(Protocol):
    """Told by a pool of what becomes of its tasks."""

    def began(self, task: Task, host: str) -> None:
        """Take note of a task that a host begins."""
        ...

    def ended(self, ended: Ended, failures: int | None) -> None:
        """Take note of what came of a task.

        Args:
            ended: The task.
            failures: Failed runs of filters in it; None: it comes up again, whole or in pieces.
        """
        ...

    def look(self) -> None:
        """Look whether something is to be said; called every moment."""
        ...

    def discarded(self) -> None:
        """Forget what is running: it has been ended without news."""
        ...


class Unwatched:
    """Takes note of nothing."""

    def began(self, task: Task, host: str) -> None:
        """Ignore it."""

    def ended(self, ended: Ended, failures: int | None) -> None:
        """Ignore it."""

    def look(self) -> None:
        """Do nothing."""

    def discarded(self) -> None:
        """Do nothing."""


@dataclass
class Counts:
    """What has become of a campaign's tasks in this session.

    Attributes:
        total: Pairs of a run and a filter that are to be computed.
        done: Those that are done, failed ones too.
        failures: Failed runs of filters.
        kinds: The same by kind.
        retries: Tasks that came up again, whole or in pieces.
        missing: Runs of filters that were given up for want of memory or of a worker.
    """

    total: int = 0
    done: int = 0
    failures: int = 0
    kinds: Counter[str] = field(default_factory=Counter)
    retries: int = 0
    missing: int = 0


@dataclass
class _Running:
    """A task that is being computed, where, since when, and whether it has been called slow."""

    task: Task
    host: str
    since: float
    expected_s: float
    is_told: bool = False

    @property
    def elapsed_s(self) -> float:
        return time.monotonic() - self.since


class Watch:
    """Watches over the tasks of one or several campaigns.

    Args:
        say: Told what a user should know, a sentence at a time.
        detail: Told of every task that is done, a sentence at a time.
        like: Under which name the costs of a filter are gathered, by its own name; default: that.
    """

    def __init__(
        self,
        say: Say = lambda sentence: None,
        detail: Say | None = None,
        like: Callable[[str], str] = str,
    ) -> None:
        self._logs: dict[Path, Sequence[EventLog]] = {}
        self._say = say
        self._detail = detail
        self._time_left = TimeLeft(like)
        self._running: dict[Path, _Running] = {}
        self._counts: dict[Path, Counts] = {}
        self._places = 0.0
        self._looked = self._beaten = time.monotonic()
        self._eta: tuple[float, float] | None = None
        self._eta_took_s = 0.0
        self._log_failed = False

    @contextmanager
    def logging(self, folder: Path, logs: Sequence[Path]) -> Iterator[None]:
        """Write what happens to the tasks of a folder.

        Args:
            folder: The folder.
            logs: Files to write to.

        Raises:
            OSError: A log can't be opened for writing.
        """
        with ExitStack() as opened:
            self._logs[folder] = [opened.enter_context(EventLog(path)) for path in logs]
            try:
                yield
            finally:
                del self._logs[folder]

    def expect(self, tasks: Sequence[Task]) -> None:
        """Take note of tasks that are to be computed, before they are."""
        self._time_left.expect(tasks)
        for task in tasks:
            self.counts(task.folder).total += _pairs(task)

    def spare(self, tasks: Sequence[Task]) -> None:
        """Take note that tasks that were expected need not be computed."""
        for task in tasks:
            self._time_left.took(task, None)
            self.counts(task.folder).total -= _pairs(task)

    def begin(self, folder: Path, **told: Any) -> None:
        """Write that a command begins to compute a campaign."""
        counts = self.counts(folder)
        mark = process_mark()
        eta_s = self._time_left.left_s([], told.get("workers", 1))
        self._write(folder, "begin", **told, **mark, total=counts.total, eta_s=eta_s)

    def end(self, folder: Path, state: str, reason: str = "") -> None:
        """Write how a command has ended."""
        counts = self.counts(folder)
        self._write(folder, "end", state=state, reason=reason, **_told(counts), kinds=counts.kinds)

    def counts(self, folder: Path) -> Counts:
        """Return what has become of the tasks of a campaign."""
        return self._counts.setdefault(folder, Counts())

    def began(self, task: Task, host: str) -> None:
        """Take note of a task that a host begins."""
        host = platform.node() if host == HERE else host
        running = _Running(task, host, time.monotonic(), self._time_left.expected_s(task))
        self._running[task.path] = running
        self._write(task.folder, "start", **_named(task), host=host, expected_s=running.expected_s)

    def ended(self, ended: Ended, failures: int | None) -> None:
        """Take note of what came of a task, see `Observer.ended`."""
        task, counts = ended.task, self.counts(ended.task.folder)
        running = self._running.pop(task.path)
        seconds = running.elapsed_s
        about = {**_named(task), "host": running.host}
        if ended.fault is not None:
            self._tell_fault(ended, running, again=failures is None)
        if failures is None:
            counts.retries += 1
            self._write(
                task.folder, "retry", **about, seconds=seconds, fault=ended.fault, reason=ended.reason, **_told(counts)
            )
            return
        outcome = ended.outcome
        kinds = outcome.kinds if outcome else {_TOLD[ended.fault]: failures} if ended.fault in _TOLD else {}
        self._time_left.took(task, outcome.seconds if outcome else None)
        new = [kind for kind in kinds if kind not in counts.kinds]
        counts.done += _pairs(task)
        counts.failures += failures
        counts.kinds.update(kinds)
        counts.missing += _pairs(task) if outcome is None and not failures else 0
        for kind in new:
            self._say(f"failed: {kinds[kind]} of {_in_words(task)}: {kind}; more of this kind are only counted")
        if self._detail is not None:
            at = f", {failures} failed" if failures else ""
            self._detail(f"done in {outcome.seconds if outcome else seconds:.1f} s: {_in_words(task)}{at}")
        self._write(
            task.folder,
            "done",
            **about,
            seconds=outcome.seconds if outcome else seconds,
            memory_mb=outcome.memory_bytes / 1e6 if outcome else None,
            failed=failures,
            kinds=kinds,
            **({} if outcome else {"fault": ended.fault, "reason": ended.reason}),
            **_told(counts),
            eta_s=self.left_s,
        )

    def look(self) -> None:
        """Say which tasks take far longer than their like, and write a sign of life now and then."""
        moment = time.monotonic()
        elapsed_s, self._looked = moment - self._looked, moment
        forgotten = (self._places - len(self._running)) * min(elapsed_s / PLACES_FORGOTTEN_S, 1.0)
        self._places = max(len(self._running), self._places - forgotten)
        for running in self._running.values():
            if not running.is_told and running.elapsed_s > SLOW_AT_LEAST_S:
                self._tell_slow(running)
        if moment - self._beaten >= BEAT_EVERY_S:
            self._beaten = moment
            for folder, counts in self._counts.items():
                self._write(folder, "beat", running=len(self._running), **_told(counts), eta_s=self.left_s)

    def discarded(self) -> None:
        """Forget what is running."""
        self._running.clear()

    def message(self, sentence: str) -> None:
        """Tell the user something, and write it."""
        self._say(sentence)
        for folder in self._counts:
            self._write(folder, "message", text=sentence)

    @property
    def left_s(self) -> float:
        """Seconds to go, by the plan's costs corrected by those measured; of one moment to the next the same.

        It looks at all that is running and all cases that are left, so that after each block it would cost more than
        all else that a block does.
        """
        every_s = max(min(ETA_EACH_S * len(self._running), ETA_EVERY_S), self._eta_took_s / ETA_SHARE)
        if self._eta is None or time.monotonic() - self._eta[0] >= every_s:
            begin = time.process_time()
            running = [(running.task, running.elapsed_s) for running in self._running.values()]
            places = max(self._places, len(running))
            self._eta = (time.monotonic(), self._time_left.left_s(running, places))
            self._eta_took_s = time.process_time() - begin
        return self._eta[1]

    def trouble_in_words(self) -> str:
        """Return what has gone wrong so far; empty where nothing has."""
        counts = self._counts.values()
        found = {
            "failed": sum(each.failures for each in counts),
            "tried again": sum(each.retries for each in counts),
            "given up": sum(each.missing for each in counts),
            "slow": sum(running.is_told for running in self._running.values()),
        }
        return ", ".join(f"{count} {what}" for what, count in found.items() if count)

    def _tell_fault(self, ended: Ended, running: _Running, again: bool) -> None:
        if (sentence := _FAULTS.get(ended.fault) if ended.fault else None) is None:
            return
        after = f" after {running.elapsed_s:.0f} s"
        then = "; computed again" if again else f"; given up: {ended.reason}"
        self._say(sentence.format(host=running.host, what=_in_words(ended.task)) + after + then)

    def _tell_slow(self, running: _Running) -> None:
        expected_s = self._time_left.expected_s(running.task)
        is_measured = self._time_left.is_measured(running.task)
        if running.elapsed_s < expected_s * (SLOW_TIMES if is_measured else UNKNOWN_TIMES):
            return
        running.is_told = True
        of_like = "took" if is_measured else "should take by the plan"
        self._say(
            f"slow: {_in_words(running.task)} on {running.host} is at it for {running.elapsed_s:.0f} s; its like "
            f"{of_like} {expected_s:.3g} s. It may hang: --timeout-s {max(10 * expected_s, 60):.0f} would end it"
        )
        self._write(
            running.task.folder,
            "slow",
            **_named(running.task),
            host=running.host,
            seconds=running.elapsed_s,
            expected_s=expected_s,
        )

    def _write(self, folder: Path, event: str, **told: Any) -> None:
        told = {key: value.value if isinstance(value, Fault) else value for key, value in told.items()}
        for log in self._logs.get(folder, ()):
            log.write({"time": now(), "event": event, **told})
            if log.error is not None and not self._log_failed:
                self._log_failed = True
                self._say(f"warning: the log can't be written any more: {log.error.strerror}; the campaign goes on")


def _pairs(task: Task) -> int:
    return 0 if isinstance(task, BoundTask) else len(task.runs) * len(task.case.config.filters)


def _told(counts: Counts) -> dict[str, int]:
    return {
        "done": counts.done,
        "total": counts.total,
        "failures": counts.failures,
        "retries": counts.retries,
        "missing": counts.missing,
    }


def _named(task: Task) -> dict[str, Any]:
    filters = list(task.case.config.filters)
    if isinstance(task, BoundTask):
        return {"block": task.path.stem, "case": task.case.label, "runs": None, "filters": filters}
    runs = [task.runs[0], task.runs[-1]]
    return {
        "block": task.path.stem,
        "case": task.case.label,
        "case_index": task.case_index,
        "runs": runs,
        "filters": filters,
    }


def _in_words(task: Task) -> str:
    if isinstance(task, BoundTask):
        return f"the Cramér-Rao bound of case {task.case.label}"
    names = list(task.case.config.filters)
    filters = ", ".join(names) if len(names) <= 3 else f"{len(names)} filters"
    runs = f"run {task.runs[0]}" if len(task.runs) == 1 else f"runs {task.runs[0]} to {task.runs[-1]}"
    return f"case {task.case.label}, {runs}, {filters}"
