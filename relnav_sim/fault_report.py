"""What the program says of an exception that nobody expected: one line, and a file for those who mend it."""

from __future__ import annotations

import contextlib
import platform
import shlex
import sys
import tempfile
import traceback

from relnav_sim import __version__
from relnav_sim.printable import message_of
from relnav_sim.standard_streams import say_last

UNEXPECTED = 70
"""Exit code: EX_SOFTWARE of sysexits.h."""
WHERE_TO_REPORT = "the issue tracker of the repository that you have relnav from"


def tell_fault(error: BaseException) -> int:
    """Say that relnav itself has failed and keep the traceback in a file; return the exit code."""
    lines = [
        f"relnav {__version__}, Python {platform.python_version()}, {platform.platform()}\n{shlex.join(sys.argv)}\n\n",
        *traceback.format_exception(error),
    ]
    text = "".join(lines)
    kept = "what follows"
    with contextlib.suppress(OSError):
        with tempfile.NamedTemporaryFile(
            "w", prefix="relnav-fault-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as file:
            file.write(text)
        kept = file.name
    say_last(
        f"relnav: unexpected {message_of(error)}; this is a fault of relnav, please report it in {WHERE_TO_REPORT}, "
        f"with {kept}\n"
    )
    if kept == "what follows":
        say_last(text)
    return UNEXPECTED
