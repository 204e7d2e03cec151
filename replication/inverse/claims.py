"""A claim over a bank: how probable it is before the numbers are seen, and what it takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from replication.inverse.table import Number

LEVEL = 0.90
TELLING = 0.7
"""A condition is told where at most this share of the prior meets it."""
RARE, USUAL = 0.025, 0.05
ENOUGH = 20
"""Settings that a claim must hold in before anything is said of them."""


@dataclass(frozen=True)
class Quantity:
    """A setting, or a ratio of settings, of which conditions are told.

    Attributes:
        words: What it is.
        unit: Its unit.
        values: Its value in each of the bank's settings, (n,).
        choices: Names of its values, if it has any.
    """

    words: str
    unit: str
    values: Array
    choices: tuple[str, ...] = ()


def wilson(hits: float, count: float) -> tuple[float, float]:
    """Return the 95 % interval of a share (Wilson, J. American Statistical Association 22, 1927)."""
    if count <= 0:
        return 0.0, 1.0
    z, share = 1.959964, hits / count
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def judged(holds: Mask, quantities: Sequence[Quantity], numbers: Sequence[Number], met: Mask) -> dict[str, Any]:
    """Return what is told of a claim.

    Args:
        holds: Whether it holds in each of the bank's settings, (n,).
        quantities: What conditions are told of.
        numbers: The printed numbers.
        met: Whether each setting gives each printed number roughly, (n, numbers).
    """
    hits, count = int(holds.sum()), len(holds)
    low, high = wilson(hits, count)
    found: dict[str, Any] = {"probability": hits / count, "interval": [low, high]}
    found |= {"settings": [], "choices": [], "conflicts": []}
    if hits < ENOUGH:
        return found
    tried = [_condition(quantity, holds) for quantity in quantities]
    chance = 3 * len(quantities)  # a condition is the best of three sides and of all quantities
    telling = [
        each
        for each in sorted(tried, key=lambda each: float(each["prior"]))
        if each["prior"] <= TELLING and chance * _by_chance(each, hits) < 0.001
    ]
    found["settings"] = [each for each in telling if "interval" in each][:5]
    found["choices"] = [each for each in telling if "choices" in each]
    before, after = met.mean(axis=0), met[holds].mean(axis=0)
    against = [
        place for place in np.argsort(after / np.maximum(before, 1e-9)) if after[place] < RARE <= USUAL <= before[place]
    ]
    found["conflicts"] = [
        f"{numbers[place].name}: the printed value comes out in {100 * after[place]:.1f} % of settings with the "
        f"claim, and in {100 * before[place]:.1f} % of all"
        for place in against[:4]
    ]
    return found


def _by_chance(condition: Mapping[str, Any], hits: int) -> float:
    """Return how probable it is that as many settings meet a condition that has nothing to do with the claim."""
    from scipy.stats import binom

    level = 0.99 if "choices" in condition else LEVEL
    return float(binom.sf(np.ceil(level * hits) - 1, hits, condition["prior"]))


def _condition(quantity: Quantity, holds: Mask) -> dict[str, Any]:
    """Return a condition that settings with a claim meet, and which share of the prior does.

    Of choices it has all that occur in a hundredth of these settings or more; of numbers the interval of 90 % of them.
    """
    own, told = quantity.values[holds], {"name": quantity.words, "unit": quantity.unit}
    if quantity.choices:
        kept = [c for c in range(len(quantity.choices)) if np.mean(own == c) > 0.01]
        share = float(np.isin(quantity.values, kept).mean())
        excluded = [choice for c, choice in enumerate(quantity.choices) if c not in kept]
        return told | {"choices": [quantity.choices[c] for c in kept], "excluded": excluded, "prior": share}
    tail = (1 - LEVEL) / 2
    intervals = [np.quantile(own, pair) for pair in ((tail, 1 - tail), (0.0, LEVEL), (1 - LEVEL, 1.0))]
    shares = [float(np.mean((quantity.values >= low) & (quantity.values <= high))) for low, high in intervals]
    best = int(np.argmin(shares))
    side = ("between", "at most", "at least")[best]
    return told | {"interval": [float(end) for end in intervals[best]], "side": side, "prior": shares[best]}


def roughly_met(found: Array, printed: Array, numbers: Sequence[Number]) -> Mask:
    """Return which of the bank's numbers (n, numbers) are the printed ones roughly: sizes within a factor of two.

    A signed number is met within a factor of two with its sign, or within three of its last digits.
    """
    signed = np.array([number.signed for number in numbers])
    digits = np.array([number.digit for number in numbers])
    ratio = np.where(printed == 0, 0.0, found / np.where(printed == 0, 1.0, printed))
    close = (ratio >= 0.5) & (ratio <= 2.0)
    near: Mask = np.where(signed, close | (np.abs(found - printed) <= 3 * digits), close)
    return near
