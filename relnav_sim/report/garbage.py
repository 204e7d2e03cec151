"""Garbage collection while a report is made: its figures make objects by the million, few of them garbage in cycles."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

_MORE_OBJECTS = 100_000  # Python itself looks after 700, or 2000, which takes a tenth of a report's time


@contextmanager
def collected_rarely() -> Iterator[None]:
    """Let Python look for dead cycles only after many new objects, some 20 MB; also a decorator.

    Example:
        >>> import gc
        >>> with collected_rarely():
        ...     gc.get_threshold()[0]
        100000
    """
    before = gc.get_threshold()
    gc.set_threshold(_MORE_OBJECTS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
