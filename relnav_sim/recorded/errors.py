"""What is wrong with a file of orbits, as one sentence that says where."""

from __future__ import annotations

from relnav_sim.printable import printable


class EphemerisError(ValueError):
    """A file of orbits that can't be used: one sentence, with ``file:line:`` before it where a line is to blame.

    Examples:
        >>> from pathlib import Path
        >>> from relnav_sim import EphemerisError, load_ephemeris
        >>> _ = Path("wrong.csv").write_text("time_utc,x_m,y_m")
        >>> try:
        ...     load_ephemeris("wrong.csv")
        ... except EphemerisError as error:
        ...     print(error)
        wrong.csv:1: no column gives z with its unit; name it z_m or z_km
    """


def at_line(path: str, line: int, sentence: str) -> EphemerisError:
    """Return the error that a line of a file causes; lines count from 1."""
    return EphemerisError(printable(f"{path}:{line}: {sentence}"))
