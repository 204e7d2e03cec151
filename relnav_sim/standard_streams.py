"""Standard input, output and error that may be closed, full or gone: what can't be said then is not said.

A campaign must not end because nobody listens: a terminal that was closed, a pipe into `head`, a full disk behind
`2>log`. And a number below 3 must not be free, or the next data file gets it and what the program says lands in there.
"""

from __future__ import annotations

import contextlib
import io
import os
import select
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

_INPUT, _OUTPUT, _ERROR = 0, 1, 2


class PatientStream(io.RawIOBase):
    """Writes to a file descriptor until that fails, then drops what it is given.

    Args:
        descriptor: Where to write; it is not closed with the stream.

    Attributes:
        error: Why nothing is written any more; None while all is well.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__()
        self._descriptor = descriptor
        self.error: OSError | None = None

    def writable(self) -> bool:
        """Return True."""
        return True

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self._descriptor

    def isatty(self) -> bool:
        """Return whether it is a terminal."""
        return os.isatty(self._descriptor)

    def write(self, data: ReadableBuffer) -> int:
        """Write all of the data, or none where that has failed before."""
        rest = memoryview(data).cast("B")
        while self.error is None and len(rest):
            try:
                rest = rest[os.write(self._descriptor, rest) :]
            except BlockingIOError:  # whoever shares the pipe has asked not to wait for it
                select.select([], [self._descriptor], [])
            except OSError as error:
                self.error = error
        return memoryview(data).nbytes


def open_missing() -> None:
    """Open the null device in place of standard streams that are closed, also for the processes started later."""
    for descriptor in (_INPUT, _OUTPUT, _ERROR):
        try:
            os.fstat(descriptor)
        except OSError:
            opened = os.open(os.devnull, os.O_RDWR)  # the lowest free number: this one, as those below are open
            os.set_inheritable(opened, True)
    if sys.stdin is None:
        sys.stdin = os.fdopen(_INPUT, encoding="utf-8", closefd=False)


def make_patient() -> None:
    """Replace `sys.stdout` and `sys.stderr` by streams that no failed write and no character can make raise."""
    open_missing()
    sys.stdout = _patient(sys.stdout, _OUTPUT)
    sys.stderr = _patient(sys.stderr, _ERROR)


def output_error() -> OSError | None:
    """Return why standard output has not been written; None where all is well or nothing is known."""
    with contextlib.suppress(AttributeError, OSError, ValueError):
        sys.stdout.flush()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    return raw.error if isinstance(raw, PatientStream) else None


def say_last(words: str) -> None:
    """Write a sentence to standard error at once, past all buffers, from a signal's handler say."""
    with contextlib.suppress(OSError):
        os.write(_ERROR, words.encode(errors="backslashreplace"))


def _patient(stream: TextIO | None, descriptor: int) -> TextIO:
    if stream is not None and not isinstance(stream, io.TextIOWrapper):
        return stream  # whoever calls has put something else there, and sees to it
    encoding, errors, lines = "utf-8", "strict", False
    if stream is not None:
        encoding, errors, lines = (
            stream.encoding,
            stream.errors or errors,
            stream.line_buffering or stream.write_through,
        )
    return io.TextIOWrapper(
        io.BufferedWriter(PatientStream(descriptor)),
        encoding=encoding,
        errors="backslashreplace" if errors == "strict" else errors,  # for what the terminal's encoding lacks
        line_buffering=lines,
    )
