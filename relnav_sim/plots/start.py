"""How long the start of a run takes to look at."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.plots.data import errors_of, rms_over_runs
from relnav_sim.plots.facts import CaseFacts

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

_FEWEST_EPOCHS = 10
_CLOSE = 2.0


def start_span(results: Results, case: CaseFacts) -> float:
    """Return a round time by which every filter's RMS over runs has come within twice its final level, s.

    At least ten stored epochs, at most the whole run. A filter that never settles does not count.
    """
    times = case.times_s
    last = 0.0
    for item in case.filters:
        if not item.completed:
            continue
        for part in (slice(0, 3), slice(3, 6)):
            found = rms_over_runs(errors_of(results, case, item, np.arange(len(times)))[..., part])
            late = found[len(found) // 2 :]
            if not np.isfinite(late).any():
                continue
            far = np.flatnonzero(found > _CLOSE * np.nanmedian(late))
            if far.size and far[-1] < len(times) // 2:
                last = max(last, float(times[far[-1]]))
    least = float(times[min(_FEWEST_EPOCHS, len(times) - 1)])
    return min(_round_up(max(1.5 * last, least)), float(times[-1]))


def _round_up(value: float) -> float:
    if value <= 0:
        return value
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 1.5, 2, 3, 4, 5, 6, 8, 10) if step * power >= value * (1 - 1e-9))
