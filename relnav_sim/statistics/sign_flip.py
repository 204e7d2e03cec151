"""Do paired differences have a mean of zero? The sign-flip test (Fisher 1935), and the interval that is its inverse.

Where two filters are alike, the difference of each run is as likely with the other sign, so the mean found is one of as
many equally likely ones as there are ways to flip signs. The test counts those at least as far from zero: it is exact
for every distribution of symmetric differences, however heavy its tails, at any number of runs.

Flipping the runs A makes the mean at least as large if and only if the mean over A is not positive. So both test and
interval come from the means over subsets of the runs: the interval ends at two of them in order (Hartigan 1969), and
holds zero at exactly those levels at which the test does not reject it.

All 2^n ways to flip are too many above 15 runs. A subgroup of them keeps the test exact (Hemerik and Goeman 2018): each
run is given a binary word, and a flip, also a word, takes the runs whose word has an odd number of ones in common with
it. The sums over all subsets of the subgroup are then one fast Walsh-Hadamard transform.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Integers

_BITS = 15
"""Flips are 2^15 = 32768: fewer below 15 runs, more where many pairs share the error and it takes finer p-values."""
_MOST_BITS = 18
_STEPS = 4  # p-values at hand below the finest level that is asked for
_AT_ONCE = 2**17  # subsets of all pairs that are worked on together, 1 MB: what a processor keeps at hand
_ROUNDING = 1e-13


@dataclass(frozen=True)
class SignFlips:
    """What the test says about one sample of differences.

    Attributes:
        p_value: Two-sided p-value of a mean of zero.
        flips: Number of ways to flip the signs that were looked at, flipping none included.
        lowest: The smallest means over subsets of the runs in order, as many as the widest interval asks for.
        highest: The largest, the largest first.
    """

    p_value: float
    flips: int
    lowest: Array
    highest: Array

    def limits(self, level: float) -> tuple[float, float]:
        """Return the interval of the mean at a level not below the first; NaN where too few runs can bound it."""
        place = math.floor((1 - level) / 2 * self.flips)
        if place < 1:
            return math.nan, math.nan
        return float(self.lowest[place - 1]), float(self.highest[place - 1])


def fewest_runs(alpha: float) -> int:
    """Return the number of runs below which no differences whatever reach a p-value of ``alpha``."""
    return 1 + math.ceil(-math.log2(alpha))


def sign_flips(differences: Array, level: float, family: int = 1) -> Iterator[SignFlips]:
    """Yield the test of each sample of differences.

    Args:
        differences: (pairs, runs), finite, at least one run.
        level: The lowest level at which an interval will be asked for.
        family: By how much its error may be divided among comparisons.
    """
    runs = differences.shape[1]
    finest = math.ceil(math.log2(_STEPS * family / (1 - level)))
    bits = min(runs, max(_BITS, min(finest, _MOST_BITS)))
    flips, (words, flipped) = 2**bits, _subgroup(runs, bits)
    kept = min(flips - 1, math.floor((1 - level) / 2 * flips) + 1)
    for start in range(0, len(differences), max(1, _AT_ONCE // flips)):
        part = differences[start : start + max(1, _AT_ONCE // flips)]
        signed = _transformed(_placed(part, words, flips))
        sums = (signed[:, :1] - signed[:, 1:]) / 2
        # Differences that cancel must count as a tie, however their sum is rounded.
        sums[np.abs(sums) <= _ROUNDING * np.abs(part).sum(axis=1, keepdims=True)] = 0.0
        means = sums / flipped
        lower, upper = 1 + (means <= 0).sum(axis=1), 1 + (means >= 0).sum(axis=1)
        p = np.minimum(1.0, 2 * np.minimum(lower, upper) / flips)
        means.partition([kept - 1, flips - 1 - kept], axis=1)
        lowest, highest = np.sort(means[:, :kept], axis=1), np.sort(means[:, -kept:], axis=1)[:, ::-1]
        yield from (SignFlips(float(p[i]), flips, lowest[i], highest[i]) for i in range(len(part)))


@functools.lru_cache(maxsize=16)
def _subgroup(runs: int, bits: int) -> tuple[Integers, Array]:
    """Return the word of each run, and how many runs each flip but that of none takes.

    The first runs have one bit each, so that no flip but that of none takes no run.
    """
    single = 2 ** np.arange(bits)
    others = np.setdiff1d(np.arange(1, 2**bits), single)
    rest = runs - bits
    drawn = np.random.default_rng(0).choice(others, rest, replace=rest > len(others)) if rest else others[:0]
    words = np.concatenate([single, drawn])
    flipped = (runs - _transformed(_placed(np.ones((1, runs)), words, 2**bits))[0, 1:]) / 2
    words.flags.writeable = flipped.flags.writeable = False
    return words, flipped


def _placed(values: Array, words: Integers, flips: int) -> Array:
    """Return each row with the values of the runs at their words."""
    return np.asarray([np.bincount(words, row, flips) for row in values], dtype=np.float64)


def _transformed(values: Array) -> Array:
    """Return the Walsh-Hadamard transform of each row: at u the sum of values at w with sign (-1)^(ones of u and w).

    Neighbours are paired and their sums written before their differences, which turns the bits of the places round by
    one; after as many rounds as there are bits all is in order again, and no access was far from the one before.
    """
    there, size = np.empty_like(values), values.shape[1]
    for _ in range(size.bit_length() - 1):
        np.add(values[:, ::2], values[:, 1::2], out=there[:, : size // 2])
        np.subtract(values[:, ::2], values[:, 1::2], out=there[:, size // 2 :])
        values, there = there, values
    return values
