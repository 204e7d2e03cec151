"""What is wrong with a file of orbits, as one sentence that says where."""

from __future__ import annotations

from relnav_sim.printable import printable


class EphemerisError(ValueError):
    """A file of orbits that can't be used: one sentence, with ``file:line:`` before it where a line is to blame."""


def at_line(path: str, line: int, sentence: str) -> EphemerisError:
    """Return the error that a line of a file causes; lines count from 1."""
    return EphemerisError(printable(f"{path}:{line}: {sentence}"))
