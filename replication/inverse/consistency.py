"""Whether a column of printed numbers goes with all the others.

Each column is predicted from the other columns by what the bank teaches. How far off it is, in units of what such
columns usually are off in like papers, has a known distribution in the bank, whatever the settings (split conformal
prediction: Lei et al., J. American Statistical Association 113, 2018).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.learned import Learned
from replication.inverse.table import Number


def columns_of(numbers: Sequence[Number]) -> dict[str, Indices]:
    """Return the places of the numbers of each column, by its name."""
    names: dict[str, list[int]] = {}
    for place, number in enumerate(numbers):
        names.setdefault(f"{number.table} {number.column}", []).append(place)
    return {name: np.array(places) for name, places in names.items()}


@dataclass(frozen=True)
class ColumnCheck:
    """How well a column goes with the others.

    Attributes:
        places: Its numbers.
        others: All other numbers.
        expected: Its numbers from the others.
        precision: Inverse of the covariance of what they are off by.
        usual: Logarithm of how far off they usually are, from the others.
        calibration: Scores of papers that are what they say, in increasing order.
    """

    places: Indices
    others: Indices
    expected: Learned
    precision: Array
    usual: Learned
    calibration: Array

    @classmethod
    def learned(cls, places: Indices, seen: Array, seed: int) -> ColumnCheck:
        """Return the check of a column from the bank's features (n, numbers): three parts, each for one purpose."""
        others = np.setdiff1d(np.arange(seen.shape[1]), places)
        teach, spread, calibrate = np.split(seen, [len(seen) * 6 // 10, len(seen) * 8 // 10])
        expected = Learned.from_examples(teach[:, others], teach[:, places], seed)
        off = np.clip(spread[:, places] - expected(spread[:, others]), -3, 3)
        precision = np.linalg.inv(np.cov(off.T) + 1e-6 * np.eye(len(places)))
        distance = _distance(spread[:, places] - expected(spread[:, others]), precision)
        usual = Learned.from_examples(spread[:, others], distance[:, None], seed)
        bare = cls(places, others, expected, precision, usual, np.empty(0))
        return cls(places, others, expected, precision, usual, np.sort(bare.scores(calibrate)))

    def scores(self, seen: Array) -> Array:
        """Return how much further off the column is than usual, (n,), from features (n, numbers)."""
        distance = _distance(seen[:, self.places] - self.expected(seen[:, self.others]), self.precision)
        scores: Array = distance - self.usual(seen[:, self.others])[:, 0]
        return scores

    def p_values(self, seen: Array) -> Array:
        """Return the share of honest papers whose column is as far off or further, (n,)."""
        below = np.searchsorted(self.calibration, self.scores(seen), side="left")
        return (len(self.calibration) - below + 1) / (len(self.calibration) + 1)

    def off(self, seen: Array) -> Array:
        """Return how far each number is from what the others make expected, in standard deviations, (n, places)."""
        sigma = np.sqrt(np.diag(np.linalg.inv(self.precision)))
        difference: Array = (seen[:, self.places] - self.expected(seen[:, self.others])) / sigma
        return difference


def _distance(off: Array, precision: Array) -> Array:
    return np.log(np.einsum("ni,ij,nj->n", off, precision, off) + 1e-9) / 2


def p_value_of_paper(checks: Mapping[str, ColumnCheck], seen: Array) -> Array:
    """Return the p-value of whole papers, (n,): the smallest of their columns', times their number."""
    smallest = np.min([check.p_values(seen) for check in checks.values()], axis=0)
    return np.minimum(smallest * len(checks), 1.0)
