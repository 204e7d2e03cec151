"""Code of other packages, filters most of all, kept from taking the process with it or changing it for the others.

Whatever it raises is its own failure, except what a signal raises: that is the end that somebody has asked for. What it
changes of the process - folder, mask of new files, environment, signals, how NumPy and Python warn, print and collect
garbage - is as before when it returns. What it changes inside other modules, and files that it closes, are not.
"""

from __future__ import annotations

import contextlib
import gc
import io
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

import numpy as np

_SIGNALS = tuple(number for number in signal.valid_signals() if number < 32)  # beyond are the real-time ones


class Containment:
    """A context for foreign code; an exception that leaves it is kept instead of raised.

    Attributes:
        error: What the code has raised; None where it came to its end.
    """

    error: BaseException | None = None

    def __enter__(self) -> Containment:
        """Note how the process is."""
        self._undo = contextlib.ExitStack()
        self._asked: BaseException | None = None
        for kept in (_folder, _new_files, _environment, _interpreter, _streams):
            self._undo.callback(kept())
        self._undo.enter_context(warnings.catch_warnings())
        self._undo.enter_context(np.errstate())
        self._undo.enter_context(np.printoptions())
        if threading.current_thread() is threading.main_thread():  # the only one that signals reach
            self._undo.callback(self._signals())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> bool:
        """Put the process back; keep the exception, unless a signal has asked for the end, even if it was hidden."""
        self._undo.close()
        if self._asked is not None:
            if error is not self._asked:
                raise self._asked
            return False
        self.error = error
        return True

    def _signals(self) -> Callable[[], None]:
        """Take note of what the handlers of signals raise meanwhile."""
        before = {number: signal.getsignal(number) for number in _SIGNALS}
        own = {number: self._noting(handler) for number, handler in before.items() if callable(handler)}
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        for number, handler in own.items():
            signal.signal(number, handler)

        def back() -> None:
            if self._asked is not None:  # then the handlers are those of a process that ends
                return
            for number, handler in before.items():
                if handler is not None and signal.getsignal(number) is not handler:
                    signal.signal(number, handler)
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)

        return back

    def _noting(self, handler: Callable[[int, FrameType | None], Any]) -> Callable[[int, FrameType | None], Any]:
        def noting(number: int, frame: FrameType | None) -> Any:
            try:
                return handler(number, frame)
            except BaseException as error:
                self._asked = error
                raise

        return noting


def _folder() -> Callable[[], None]:
    try:
        before = os.getcwd()
    except OSError:  # it was removed; there is no way back
        return lambda: None

    def back() -> None:
        with contextlib.suppress(OSError):
            os.chdir(before)

    return back


def _new_files() -> Callable[[], None]:
    mask = os.umask(0o077)
    os.umask(mask)
    return lambda: _ignored(os.umask(mask))


def _environment() -> Callable[[], None]:
    before = os.environ.copy()

    def back() -> None:
        if os.environ != before:
            os.environ.clear()
            os.environ.update(before)

    return back


def _interpreter() -> Callable[[], None]:
    collects, thresholds, depth = gc.isenabled(), gc.get_threshold(), sys.getrecursionlimit()

    def back() -> None:
        (gc.enable if collects else gc.disable)()
        gc.set_threshold(*thresholds)
        sys.setrecursionlimit(depth)

    return back


def _streams() -> Callable[[], None]:
    """Lead what it prints to standard error, as standard output is for answers, and give it nothing to read."""
    before = sys.stdin, sys.stdout, sys.stderr
    sys.stdin, sys.stdout = io.StringIO(), sys.stderr

    def back() -> None:
        sys.stdin, sys.stdout, sys.stderr = before

    return back


def _ignored(value: object) -> None:
    """Drop a value where a callback must return nothing."""
