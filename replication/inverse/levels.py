"""The level of a column beside what the rest of an honest paper implies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.consistency import columns_of
from replication.inverse.learned import Learned
from replication.inverse.table import Number, compared, rounded

EPOCHS = 25


@dataclass(frozen=True)
class Levels:
    """What honest papers teach of the level of each column: the mean of the logarithms of its sizes.

    If a column is multiplied by a factor, the likelihood ratio depends on the distribution of its level given all that
    the factor leaves alone (Lehmann and Romano, Testing Statistical Hypotheses, 2005, chapter 6), which are ratios in
    the column and the other columns. Two halves of the papers teach for themselves, so that how a level deviates from
    what is expected of it can be told of papers that have taught, too (cross-fitting: Chernozhukov et al., Econometrics
    J. 21(1), 2018).

    Attributes:
        numbers: What is printed.
        expected: Learned by each half: each column's level, from the rest of a paper.
    """

    numbers: Sequence[Number]
    expected: Sequence[Sequence[Learned]]

    @classmethod
    def learned(cls, numbers: Sequence[Number], papers: Array, seed: int) -> Levels:
        """Return what honest papers (n, numbers) teach: those with an even number the first, the others the second."""
        expected = []
        for half in (papers[::2], papers[1::2]):
            pairs = [apart(numbers, places, half) for places in columns_of(numbers).values()]
            expected.append([Learned.from_examples(rest, level[:, None], seed, EPOCHS) for level, rest in pairs])
        return cls(numbers, expected)

    def deviations(self, papers: Array, half: int) -> Array:
        """Return each level less what a half has taught to expect, (n, columns), of papers (n, numbers)."""
        off = []
        for expected, places in zip(self.expected[half], columns_of(self.numbers).values(), strict=True):
            level, rest = apart(self.numbers, places, papers)
            off.append(level - expected(rest)[:, 0])
        return np.stack(off, axis=1)


def apart(numbers: Sequence[Number], places: Indices, papers: Array) -> tuple[Array, Array]:
    """Return the level of a column, (n,), and all that a factor leaves alone, (n, numbers), of papers (n, numbers).

    Both are in single precision, which networks learn from faster. Signed numbers of the column are compared with its
    level; a column without others has the mean of the logarithms of their absolute values.
    """
    printed = rounded(papers, numbers)
    rest = compared(printed, numbers)
    signed = np.array([numbers[place].signed for place in places])
    half = np.array([numbers[place].digit for place in places]) / 2
    sizes = np.log(np.maximum(np.abs(printed[:, places]), half))
    level = sizes[:, ~signed | signed.all()].mean(axis=1)
    ratios = np.arcsinh(printed[:, places] / np.exp(level)[:, None])
    rest[:, places] = np.where(signed, ratios, sizes - level[:, None])
    return level.astype(np.float32), rest.astype(np.float32)
