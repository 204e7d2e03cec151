"""Ctrl-C, SIGTERM and a closed terminal: a prompt end with a sentence, whatever the program is doing then."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from relnav_sim.standard_streams import say_last

LONGEST_END_S = 1.2
"""After this the process ends without tidying up; worker processes follow by themselves, files are whole anyway."""


class Interrupted(KeyboardInterrupt):
    """A signal that asks for the end.

    Attributes:
        number: The signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def ending_promptly(sentence: str, last: Callable[[int], object] = lambda code: None) -> Iterator[None]:
    """Turn Ctrl-C, SIGTERM and SIGHUP into the end of the process, with exit code 130, 143 or 129.

    Args:
        sentence: What to say then: how to go on later.
        last: Called with the exit code where the process has to end without tidying up.
    """
    said = threading.Event()
    # The processes that watch over shared resources clean up in silence after workers that were stopped.
    sys.warnoptions.append("ignore:resource_tracker:UserWarning")

    def last_words() -> None:
        if not said.is_set():
            said.set()
            show_cursor = "\x1b[?25h" if sys.stderr.isatty() else ""
            say_last(f"{show_cursor}relnav: {sentence}\n")

    def end_now(code: int) -> None:
        last_words()
        last(code)
        os._exit(code)

    def ask(number: int, frame: FrameType | None) -> None:
        code = 128 + number
        for signum in before:
            signal.signal(signum, lambda *_: end_now(code))
        timer = threading.Timer(LONGEST_END_S, end_now, (code,))
        timer.daemon = True
        timer.start()
        # What an object under destruction has to say about the interruption helps nobody.
        sys.unraisablehook = lambda unraisable: None
        raise Interrupted(number)

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    # A signal that the caller has had ignored, as shells do for jobs in the background and nohup does, stays ignored.
    before = {number: handler for number, handler in before.items() if handler is not signal.SIG_IGN}
    for number in before:
        signal.signal(number, ask)
    try:
        yield
    except Interrupted as interrupted:
        last_words()
        # The handlers stay as they are now: a second signal ends the process at once, as the timer does in any case.
        before.clear()
        raise SystemExit(128 + interrupted.number) from None
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
