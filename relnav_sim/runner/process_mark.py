"""What tells this process from others, and whether a process that left its mark is still there."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any


def process_mark() -> dict[str, Any]:
    """Return the machine, the number and the start of this process; numbers are given again, starts are not."""
    return {"host": platform.node(), "pid": os.getpid(), "pid_start": _start(os.getpid())}


def is_alive(mark: Mapping[str, Any]) -> bool | None:
    """Return whether a process is still there; None where it is on another machine, so that nobody here knows."""
    if mark.get("host") != platform.node():
        return None
    pid = mark.get("pid")
    if not isinstance(pid, int) or isinstance(pid, bool) or pid <= 0:
        return False
    try:
        os.kill(pid, 0)
    except PermissionError:
        pass  # it is of another user
    except (OSError, OverflowError):
        return False
    return mark.get("pid_start") in (None, _start(pid))


def _start(pid: int) -> int | None:
    """Return when a process began, in ticks since the machine did; None where the system does not tell."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[19])
    return None
