"""A part of a report that can't be made costs only itself: the page and the terminal say why it is missing."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from relnav_sim.printable import message_of
from relnav_sim.results.block import ResultsError

Part = TypeVar("Part")


def attempted(what: str, make: Callable[[], Part], missing: list[str]) -> Part | None:
    """Return what a function makes; None where it fails, with a sentence about that added to ``missing``.

    Args:
        what: The part, as the subject of the sentence.
        make: Makes it.
        missing: Gets the sentence.

    Raises:
        ResultsError: The result itself is damaged.
        OSError: The report can't be written.
    """
    try:
        return make()
    except (ResultsError, OSError):
        raise
    except Exception as error:  # whatever it is: the other parts of the report are worth having
        missing.append(f"{what} could not be made: {message_of(error)}")
        return None
