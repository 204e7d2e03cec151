"""Worker processes that do not outlive who started them."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time

from relnav_sim.safe_path import VARIABLE

PARENT_CHECKED_EVERY_S = 0.25
PR_SET_PDEATHSIG = 1


def end_with_parent(parent: int) -> None:
    """Make this process end when its parent does, also while compiled code leaves no other thread a turn."""
    os.environ.pop(VARIABLE, None)  # it is for the start of this process, not for those that a filter starts
    if not _killed_with_parent():
        threading.Thread(target=_watch, args=(parent,), name="relnav-parent-watch", daemon=True).start()
    if os.getppid() != parent:  # it was gone before anyone watched
        os._exit(1)


def _killed_with_parent() -> bool:
    """Ask Linux for a SIGKILL at the parent's end; return whether it was granted."""
    if sys.platform != "linux":
        return False
    try:
        return bool(ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0) == 0)
    except (OSError, AttributeError):
        return False


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_CHECKED_EVERY_S)
    os._exit(1)
