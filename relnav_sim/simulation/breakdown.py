"""An exception as a result tells it: the reason with file and line, the epoch, and the traceback for the log."""

from __future__ import annotations

import traceback
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from relnav_sim.printable import message_of, printable

LONGEST_REASON = 400
LONGEST_PLACE = 80
LONGEST_TRACEBACK = 20_000


@dataclass(frozen=True)
class Breakdown:
    """Why a filter or a block has ended.

    Attributes:
        reason: In words, with the type of the exception and the line that raised it.
        epoch: The epoch at which it ended; -1 where it is not known.
        traceback: How it came to that, for the log; empty where there was no exception.
    """

    reason: str
    epoch: int = -1
    traceback: str = ""


def breakdown(error: BaseException, epoch: int, packages: Collection[str] = ("relnav_sim",)) -> Breakdown:
    """Return what is told of an exception.

    Args:
        error: The exception.
        epoch: The epoch at which it was raised; -1 where it is not known.
        packages: Whose code is to blame: the line told is the last one in it.
    """
    place, told = _place(error, packages), error
    if isinstance(error, SystemError) and error.__cause__ is not None:
        told = error.__cause__  # what was raised while compiled code was called, as by a recursion without end
    reason = message_of(told, LONGEST_REASON) + (f" ({place})" if place else "")
    return Breakdown(reason, epoch, _traceback(error))


def _place(error: BaseException, packages: Collection[str]) -> str:
    place = ""
    for frame, line in traceback.walk_tb(error.__traceback__):
        if str(frame.f_globals.get("__name__")).partition(".")[0] in packages:
            place = f"{printable(Path(frame.f_code.co_filename).name, LONGEST_PLACE)}:{line}"
    return place


def _traceback(error: BaseException) -> str:
    """Return the traceback, every line printable; the middle of a very long one is left out."""
    text = "".join(traceback.format_exception(error))
    half = LONGEST_TRACEBACK // 2
    if len(text) > LONGEST_TRACEBACK:
        text = f"{text[:half]}\n[...]\n{text[-half:]}"
    lines = []
    for line in text.split("\n"):
        words = line.lstrip(" ")
        lines.append(line[: len(line) - len(words)] + printable(words, LONGEST_TRACEBACK))
    return "\n".join(lines)
