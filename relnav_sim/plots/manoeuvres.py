"""When a campaign's manoeuvres begin."""

from __future__ import annotations

from typing import TYPE_CHECKING

from relnav_sim.arrays import Array
from relnav_sim.results.block import ResultsError
from relnav_sim.results.settings import case_setting

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


def manoeuvre_times(results: Results, index: int, times_s: Array) -> list[float]:
    """Return when the campaign's manoeuvres within the stored epochs begin, s, those of both craft.

    Args:
        results: An opened result.
        index: The case's number from 0.
        times_s: The stored epochs, s.

    Raises:
        ResultsError: The campaign's manoeuvres in the file are damaged.
    """
    burns = case_setting(results, index, "truth.manoeuvres", None) or {}
    try:
        found = [float(burn["time_s"]) for burn in burns.values()]
    except (AttributeError, KeyError, TypeError, ValueError):
        raise ResultsError("the result's truth.manoeuvres are damaged") from None
    return sorted(time for time in found if times_s[0] <= time <= times_s[-1])
