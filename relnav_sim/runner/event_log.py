"""The log of a campaign: a line of JSON for all that happens, added at the end; a torn line costs only itself."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

NAME = "log.jsonl"
"""The log in the folder of shards, which `relnav status` reads."""


class EventLog:
    """A file that lines are added to, never changed; a context manager.

    A line is written in one piece. Where that fails, as on a full disk, the campaign goes on.

    Args:
        path: The file; it need not exist.

    Attributes:
        error: Why a line could not be written; None while all is well.

    Raises:
        OSError: It can't be opened for writing.
    """

    def __init__(self, path: Path) -> None:
        self.error: OSError | None = None
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o666)
        self._torn = _ends_torn(self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._file)

    def write(self, event: Mapping[str, Any]) -> None:
        """Add a line."""
        line = f"{json.dumps(_plain(event), ensure_ascii=False)}\n".encode(errors="backslashreplace")
        try:
            written = os.write(self._file, b"\n" + line if self._torn else line)
            self._torn = written < len(line)
        except OSError as error:
            self.error, self._torn = error, True


def read_events(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the events of a log in order; lines that are torn or no events are passed over.

    Raises:
        OSError: The file can't be read.
    """
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            try:
                event = json.loads(line)
            except (ValueError, RecursionError):
                continue
            if isinstance(event, dict) and isinstance(event.get("event"), str) and _moment(event.get("time")):
                yield event


def now() -> str:
    """Return this moment, UTC, ISO 8601."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _moment(text: Any) -> bool:
    try:
        return datetime.fromisoformat(text).tzinfo is not None
    except (TypeError, ValueError):
        return False


def _ends_torn(file: int) -> bool:
    """Return whether the last line has no end: whoever wrote it was killed, or the disk was full."""
    try:
        size = os.fstat(file).st_size
        return size > 0 and os.pread(file, 1, size - 1) != b"\n"
    except OSError:  # a pipe
        return False


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: numbers rounded, none where they are not finite."""
    if isinstance(value, float):
        return round(value, 3) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value
