"""The settings behind printed numbers: approximate Bayesian computation with learned summaries.

The posterior mean of each unknown, learned from the bank, is its summary (Fearnhead and Prangle, J. Royal Statistical
Society B 74(3), 2012). The bank's settings whose summary is nearest to that of the printed numbers are its posterior,
moved along a line fitted to them (Beaumont, Zhang and Balding, Genetics 162(4), 2002). One fit answers for any paper
of the same tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.bank import Paper
from replication.inverse.learned import Learned
from replication.inverse.prior import Unknown
from replication.inverse.table import compared, rounded

NEAREST = 400


def features(paper: Paper, numbers: Array) -> Array:
    """Return what is learned from: printed numbers on the scale on which they are compared, (n, numbers)."""
    return compared(rounded(numbers, paper.numbers), paper.numbers)


@dataclass(frozen=True)
class Inference:
    """What the bank says of the settings behind any printed numbers.

    Attributes:
        unknowns: What is inferred.
        effective: Uniform numbers of the bank's settings, as they act, (n, unknowns).
        summary: Learned from numbers: the mean of each.
        summaries: That of the bank's, (n, unknowns).
    """

    unknowns: Sequence[Unknown]
    effective: Array
    summary: Learned
    summaries: Array

    @classmethod
    def learned(cls, paper: Paper, u: Array, numbers: Array, seed: int) -> Inference:
        """Return what settings u (n, unknowns) and their numbers (n, numbers) teach.

        One half of them teaches the summaries, and the other half is what posteriors are made of.
        """
        effective, seen = paper.effective(u), features(paper, numbers)
        half = len(u) // 2
        summary = Learned.from_examples(seen[:half], effective[:half], seed)
        return cls(paper.unknowns, effective[half:], summary, summary(seen[half:]))

    def posterior(self, seen: Array) -> Array:
        """Return draws of each unknown's posterior as uniform numbers, (draws, unknowns), from features (numbers,).

        Each column is for itself: a row is not a joint draw.
        """
        own = self.summary(seen[None])[0]
        count = min(NEAREST, len(self.effective))
        draws = np.empty((count, len(self.unknowns)))
        for place, unknown in enumerate(self.unknowns):
            distance = self.summaries[:, place] - own[place]
            nearest = np.argsort(np.abs(distance), kind="stable")[:count]
            value, x = self.effective[nearest, place], distance[nearest]
            if not unknown.choices:
                spread = np.var(x)
                slope = np.cov(x, value)[0, 1] / spread if spread > 0 else 0.0
                value = np.clip(value - slope * x, 0.0, 1.0)
            draws[:, place] = value
        return draws


def interval(draws: Array, level: float) -> tuple[Array, Array]:
    """Return the ends of the central interval of each column of draws (n, q)."""
    low, high = np.quantile(draws, ((1 - level) / 2, (1 + level) / 2), axis=0)
    return low, high
