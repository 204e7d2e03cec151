"""Do a filter's errors match its covariance? A verdict on the whole state, the position and the velocity together.

A position that is overconfident can hide behind a velocity that is conservative: the ANEES of the whole state is then
near 1. So the three are looked at, and each is tested at a third of 5 % (Bonferroni), as one of three looks at the same
runs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.results import layout
from relnav_sim.statistics.intervals import Interval, mean_interval

SIGMA_MARGIN = 0.05
"""Sigmas that are right within 5 % are called right, however many runs could tell the difference."""
SIGMA_KNOWN = 0.25
"""An interval of 1 that reaches farther than 25 % from right sigmas is too few runs, not consistency."""

_CHANCE_OF_ERROR = 0.05
_HIGHEST = (1 + SIGMA_KNOWN) ** 2

ConsistencyVerdict = Literal["overconfident", "conservative", "may be consistent", "consistent"]


@dataclass(frozen=True)
class Consistency:
    """What the runs say of a filter's covariance.

    Attributes:
        verdict: The verdict. It may be consistent where the runs are too few to tell.
        block: The part of the state that it rests on, of `layout.BLOCKS`: the one farthest off, or known least.
        factor: Actual error of that part in units of its formal sigma, root of the ANEES.
        low: Lower end of its interval at the level 1 - 0.05 / 3; NaN where there is none, of one run.
        high: Upper end.
    """

    verdict: ConsistencyVerdict
    block: str
    factor: float
    low: float
    high: float


def consistency_of(anees: Array) -> Consistency | None:
    """Return the verdict on a filter in one case; None where there is no ANEES.

    A part of the state is off where the interval of its ANEES at the level 1 - 0.05 / 3 does not contain 1 and the root
    of the ANEES is more than `SIGMA_MARGIN` from 1. The filter is overconfident if a part is off above, else
    conservative if one is off below and none may be overconfident by more than `SIGMA_KNOWN`. Else it is consistent
    where the 95 % interval of each part lies within `SIGMA_KNOWN` and contains 1 or is of a root near it, and may be
    where one does not. One run tells nothing.

    Args:
        anees: Of each run, (runs, 3), in the order of `layout.BLOCKS`; NaN: the run has none.

    Examples:
        >>> import numpy as np
        >>> runs = 1 + 0.1 * np.random.default_rng(1).standard_normal((40, 3))
        >>> consistency_of(runs).verdict
        'consistent'
        >>> found = consistency_of(runs * [1.0, 1.5, 0.9])
        >>> found.verdict, found.block
        ('overconfident', 'position')
    """
    parts = [mean_interval(values) for values in anees.T]
    if not all(math.isfinite(part.estimate) and part.estimate > 0 for part in parts):
        return None
    wider = _wider(anees)
    factors = {name: math.sqrt(part.estimate) for name, part in zip(layout.BLOCKS, parts, strict=True)}
    above = {name: factors[name] for name in overconfident_parts(anees)}
    below = {name: 1 / factors[name] for name, part in zip(layout.BLOCKS, wider, strict=True) if _is_off_below(part)}
    if above:
        return _resting_on("overconfident", layout.BLOCKS.index(farthest(above)), wider)
    if below and all(part.high <= _HIGHEST for part in parts):
        return _resting_on("conservative", layout.BLOCKS.index(farthest(below)), wider)
    unknown = [place for place, part in enumerate(parts) if not _is_known(part)]
    if unknown:
        widest = max(unknown, key=lambda place: wider[place].high - wider[place].low)
        return _resting_on("may be consistent", widest, wider)
    return _resting_on("consistent", 0, wider)


def overconfident_parts(anees: Array) -> tuple[str, ...]:
    """Return the parts of the state that are off above, of `layout.BLOCKS`, each judged by itself.

    Args:
        anees: Of each run, (runs, 3); NaN: the run has none.
    """
    return tuple(name for name, part in zip(layout.BLOCKS, _wider(anees), strict=True) if _is_off_above(part))


def farthest(factors: Mapping[str, float]) -> str:
    """Return which part is farthest off; the whole state, where it is among them, stands for what is near it.

    Args:
        factors: How far each part is off, by its name of `layout.BLOCKS`.
    """
    whole, part = layout.BLOCKS[0], max(factors, key=lambda name: factors[name])
    return whole if whole in factors and factors[part] <= (1 + SIGMA_MARGIN) * factors[whole] else part


def _wider(anees: Array) -> list[Interval]:
    """Return the intervals of the parts that hold together."""
    return [mean_interval(values, 1 - _CHANCE_OF_ERROR / len(layout.BLOCKS)) for values in anees.T]


def _resting_on(verdict: ConsistencyVerdict, place: int, parts: list[Interval]) -> Consistency:
    low, factor, high = (
        float(np.sqrt(max(value, 0.0))) for value in (parts[place].low, parts[place].estimate, parts[place].high)
    )
    return Consistency(verdict, layout.BLOCKS[place], factor, low, high)


def _is_near(part: Interval) -> bool:
    return abs(math.sqrt(part.estimate) - 1) <= SIGMA_MARGIN


def _is_off_above(part: Interval) -> bool:
    """Return whether all of it is above 1; an interval without ends, of one run, does not tell."""
    return part.low > 1 and not _is_near(part)


def _is_off_below(part: Interval) -> bool:
    return part.high < 1 and not _is_near(part)


def _is_known(part: Interval) -> bool:
    within = part.low >= (1 - SIGMA_KNOWN) ** 2 and part.high <= _HIGHEST
    return within and not _is_off_above(part) and not _is_off_below(part)
