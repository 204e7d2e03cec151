"""The most memory that this process has had so far."""

from __future__ import annotations

import resource
import sys

_UNIT = 1 if sys.platform == "darwin" else 1024
"""What the system counts in, bytes."""


def peak_memory() -> int:
    """Return the most physical memory that this process has had since it began, bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _UNIT
