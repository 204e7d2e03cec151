"""Python processes that take no module from the working folder: a `random.py` that lies there is the user's own."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

VARIABLE = "PYTHONSAFEPATH"


@contextmanager
def safe_path() -> Iterator[None]:
    """Let Python processes that start meanwhile leave the working folder out of their path; PYTHONPATH holds."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before


def working_folder_last() -> None:
    """Move the working folder from the head of the path to its end, as `python -m` and `python -c` put it there.

    What is found nowhere else is still found, as relnav in its own source folder.
    """
    if not sys.flags.safe_path and sys.path and sys.path[0] in ("", os.getcwd()):
        sys.path.append(sys.path.pop(0))
