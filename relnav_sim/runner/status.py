"""How a campaign stands, read from the log in its folder of shards; nobody at work there notices."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Any

from relnav_sim.runner.event_log import NAME, read_events
from relnav_sim.runner.process_mark import is_alive
from relnav_sim.runner.shard_folder import shard_folder

_HDF5 = b"\x89HDF\r\n\x1a\n"
SILENT_S = 300.0
"""A command on another machine is thought to be gone after so long without a word; it has one a minute."""


class State(StrEnum):
    """What a campaign's last command does or did."""

    RUNNING = "running"
    FINISHED = "finished"
    STOPPED = "stopped"
    """By --max-failures or --fail-fast."""
    INTERRUPTED = "interrupted"
    FAILED = "failed"
    """By an error that was told."""
    KILLED = "killed"
    """Without a word."""
    SILENT = "silent"
    """On another machine, and without a word for long."""


AT_REST = (State.RUNNING, State.FINISHED)
"""States in which nobody needs to do anything."""


@dataclass(frozen=True)
class RunningBlock:
    """A block that is being computed.

    Attributes:
        case: Label of its case.
        runs: First and last run; None for a Cramér-Rao bound.
        filters: Names of its filters.
        host: Where.
        since: Since when, ISO 8601.
        elapsed_s: For how long, s.
        expected_s: How long it should take, s; None where the log does not say.
        is_slow: Whether it takes far longer than its like.
    """

    case: str
    runs: tuple[int, int] | None
    filters: tuple[str, ...]
    host: str
    since: str
    elapsed_s: float
    expected_s: float | None
    is_slow: bool


@dataclass(frozen=True)
class Status:
    """How a campaign stands.

    Attributes:
        state: What its last command does.
        reason: Why it failed, in words.
        command: The last command.
        host: Where it runs or ran.
        pid: Its process.
        began: When it began, ISO 8601.
        last_word: When it last wrote something.
        done: Pairs of a run and a filter that are done, failed ones too.
        total: Pairs that it asks for.
        failures: Failed runs of filters.
        kinds: The same by kind.
        retries: Blocks that its last command computed again.
        missing: Runs of filters that it gave up for want of memory or of a worker.
        memory_mb: Most memory of a worker, MB; None: not known yet.
        left_s: Seconds to go; None where nobody is at work, or it is not known yet.
        running: The blocks that are being computed.
    """

    state: State
    reason: str = ""
    command: str = ""
    host: str = ""
    pid: int | None = None
    began: str = ""
    last_word: str = ""
    done: int = 0
    total: int = 0
    failures: int = 0
    kinds: Mapping[str, int] = field(default_factory=dict)
    retries: int = 0
    missing: int = 0
    memory_mb: float | None = None
    left_s: float | None = None
    running: tuple[RunningBlock, ...] = ()


def is_log(path: Path) -> bool:
    """Return whether a file is no results file, so that it can only be a log.

    Raises:
        OSError: It can't be read.
    """
    if not path.is_file() or shard_folder(path).exists():
        return False
    with open(path, "rb") as file:
        return file.read(len(_HDF5)) != _HDF5


def status_of(path: Path, moment: datetime | None = None) -> Status | None:
    """Return how a campaign or another command stands; None where there is no log, or no command in it.

    Args:
        path: The results file, which need not exist yet, or a log, see `is_log`.
        moment: The time to compare with; default: now.

    Raises:
        OSError: The log can't be read.
    """
    log = path if is_log(path) else shard_folder(path) / NAME
    if not log.exists():
        return None
    return status_from(read_events(log), moment or datetime.now(UTC))


def status_from(events: Iterable[Mapping[str, Any]], moment: datetime) -> Status | None:
    """Return how a campaign stands by the events of its log; None without any command in it.

    Args:
        events: The events in order.
        moment: The time to compare with.
    """
    begin: Mapping[str, Any] | None = None
    last: Mapping[str, Any] = {}
    end: Mapping[str, Any] | None = None
    counted: Mapping[str, Any] = {}
    foretold: tuple[datetime, float] | None = None
    running: dict[str, Mapping[str, Any]] = {}
    slow: set[str] = set()
    kinds_of: dict[str, Mapping[str, int]] = {}
    memory_mb: float | None = None
    for event in events:
        last, name, block = event, event["event"], str(event.get("block"))
        if name == "begin":
            if not event.get("found") or (begin is not None and begin.get("campaign") != event.get("campaign")):
                kinds_of = {}
            begin, end, counted = event, None, event
            running, slow, memory_mb, foretold = {}, set(), None, None
        elif name == "start":
            running[block] = event
        elif name == "slow":
            slow.add(block)
        elif name in ("done", "retry"):
            running.pop(block, None)
            slow.discard(block)
        elif name == "end":
            end = event
            running = {}
        if name == "done":
            kinds_of[block] = _counts(event.get("kinds"))
            memory_mb = max(memory_mb or 0.0, _number(event.get("memory_mb")) or 0.0)
        if "done" in event and "total" in event:
            counted = event
        if (left_s := _number(event.get("eta_s"))) is not None:
            foretold = datetime.fromisoformat(event["time"]), left_s
    if begin is None:
        return None
    state = _state(begin, end, last, moment)
    kinds = sum((Counter(each) for each in kinds_of.values()), Counter[str]())
    is_at_work = state is State.RUNNING
    left_s = None
    if is_at_work and foretold is not None:
        left_s = max(foretold[1] - (moment - foretold[0]).total_seconds(), 0.0)
    found = int(_number(begin.get("found")) or 0)
    return Status(
        state=state,
        reason=str(end.get("reason", "")) if end else "",
        command=str(begin.get("command", "")),
        host=str(begin.get("host", "")),
        pid=begin.get("pid") if isinstance(begin.get("pid"), int) else None,
        began=begin["time"],
        last_word=last["time"],
        done=found + int(_number(counted.get("done")) or 0),
        total=found + int(_number(counted.get("total")) or 0),
        failures=sum(kinds.values()),
        kinds=dict(kinds.most_common()),
        retries=int(_number(counted.get("retries")) or 0),
        missing=int(_number(counted.get("missing")) or 0),
        memory_mb=memory_mb or None,
        left_s=left_s,
        running=tuple(_running(event, block in slow, moment) for block, event in running.items()) if is_at_work else (),
    )


def _state(begin: Mapping[str, Any], end: Mapping[str, Any] | None, last: Mapping[str, Any], moment: datetime) -> State:
    if end is not None:
        told = end.get("state")
        return State(told) if told in set(State) else State.FAILED
    alive = is_alive(begin)
    if alive is None:
        silent_s = (moment - datetime.fromisoformat(last["time"])).total_seconds()
        return State.SILENT if silent_s > SILENT_S else State.RUNNING
    return State.RUNNING if alive else State.KILLED


def _running(event: Mapping[str, Any], is_slow: bool, moment: datetime) -> RunningBlock:
    runs = event.get("runs")
    return RunningBlock(
        case=str(event.get("case", "")),
        runs=(int(runs[0]), int(runs[-1])) if isinstance(runs, list) and runs else None,
        filters=tuple(map(str, event.get("filters") or ())),
        host=str(event.get("host", "")),
        since=event["time"],
        elapsed_s=max((moment - datetime.fromisoformat(event["time"])).total_seconds(), 0.0),
        expected_s=_number(event.get("expected_s")),
        is_slow=is_slow,
    )


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _counts(value: Any) -> Mapping[str, int]:
    pairs = value.items() if isinstance(value, dict) else ()
    return {str(kind): count for kind, count in pairs if isinstance(count, int)}
