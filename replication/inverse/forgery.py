"""Whether one column of a paper has been forged: a classifier that has seen honest papers and forged ones.

Where a classifier tells two kinds of papers apart by their probabilities, their ratio estimates the ratio of their
densities (Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 2009, section 14.2.4), which is the
best statistic there is. It sees the numbers and how far each column's level is from what the rest implies, which is
nearly all of the ratio where the forgery is a factor, and which a regression learns from fewer papers. How forged an
honest paper may look is calibrated on papers that the classifier has not seen (split conformal prediction: Vovk,
Gammerman and Shafer, 2005), so that the rate of false alarms does not rest on it.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.consistency import columns_of
from replication.inverse.learned import Scale
from replication.inverse.levels import Levels
from replication.inverse.table import Number, compared, rounded

SHOWN, LARGEST, HONEST, EPOCHS = 3, 3.0, 3, 12
"""How often a paper is shown forged in each way, by which factor or its inverse, how often as it is, how often all."""
WIDTHS = (256, 128)


@dataclass(frozen=True)
class ForgeryTest:
    """A test that a paper is honest.

    Attributes:
        levels: What the level of each column is compared with.
        scale: Scale of the inputs.
        network: Tells honest papers, class 0, from those with a forged column.
        calibration: Scores of honest papers that it has not seen, in increasing order.
    """

    levels: Levels
    scale: Scale
    network: Any
    calibration: Array

    @classmethod
    def learned(
        cls, numbers: Sequence[Number], near: Array, calibrating: Array, further: Array, seed: int
    ) -> ForgeryTest:
        """Return what honest papers teach.

        Args:
            numbers: What is printed.
            near: Numbers of papers like the one to be tested, (n, numbers), which teach.
            calibrating: Those of others like it, which calibrate, (c, numbers).
            further: Those of any others, which only teach, (m, numbers).
            seed: Seed of forgeries and networks.
        """
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPClassifier

        taught = np.concatenate([near, further])
        levels = Levels.learned(numbers, taught, seed)
        shown, kind = _shown(levels, taught, np.random.default_rng([seed, 8]))
        scale = Scale.of(shown[kind == 0])
        network = MLPClassifier(
            WIDTHS, batch_size=256, max_iter=EPOCHS, alpha=1e-3, random_state=seed, early_stopping=True
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # a limit on its time, not an error
            network.fit(scale.scaled(shown), kind)
        bare = cls(levels, scale, network, np.empty(0))
        return replace(bare, calibration=np.sort(bare.scores(calibrating)))

    def scores(self, papers: Array) -> Array:
        """Return how unlike an honest paper each is, (n,): the mean with what either half of the papers taught."""
        honest = np.stack([self._honest(papers, half) for half in (0, 1)])
        return np.asarray(-np.log(np.maximum(honest, 1e-30)).mean(axis=0), dtype=float)

    def _honest(self, papers: Array, half: int) -> Array:
        seen = inputs(self.levels, papers, half)
        return np.asarray(self.network.predict_proba(self.scale.scaled(seen))[:, 0], dtype=float)

    def p_values(self, papers: Array) -> Array:
        """Return the share of honest papers that look as forged or more, (n,)."""
        count = len(self.calibration)
        below = np.searchsorted(self.calibration, self.scores(papers), side="left")
        return np.asarray((count - below + 1) / (count + 1), dtype=float)


def forged(papers: Array, columns: Sequence[Indices], factors: Array) -> Array:
    """Return papers (n, numbers) with the sizes in a column of each multiplied, mean, deviation and norm in step."""
    changed = papers.copy()
    for row, (places, factor) in enumerate(zip(columns, factors, strict=True)):
        changed[row, places] *= factor
    return changed


def mixed(papers: Array, columns: Sequence[Indices], others: Array) -> Array:
    """Return papers (n, numbers) with a column of each taken from another paper."""
    changed = papers.copy()
    for row, places in enumerate(columns):
        changed[row, places] = others[row, places]
    return changed


def _shown(levels: Levels, papers: Array, generator: np.random.Generator) -> tuple[Array, Indices]:
    """Return inputs of papers (n, numbers) as they are and forged, with the kind of each: 0, or 1 + its column."""
    columns = list(columns_of(levels.numbers).values())
    shown, kind = [], []
    for half in (0, 1):
        own = papers[1 - half :: 2]  # levels are compared with what the other half has taught
        shown += [inputs(levels, own, half)] * HONEST
        kind += [np.zeros(len(own), dtype=np.int64)] * HONEST
        for _ in range(SHOWN):
            which = generator.integers(len(columns), size=len(own))
            places = [columns[k] for k in which]
            factors = LARGEST ** generator.uniform(-1, 1, len(own))
            others = own[generator.permutation(len(own))]
            shown += [inputs(levels, each, half) for each in (forged(own, places, factors), mixed(own, places, others))]
            kind += [1 + which] * 2
    return np.concatenate(shown), np.concatenate(kind)


def inputs(levels: Levels, papers: Array, half: int) -> Array:
    """Return what a network sees of papers (n, numbers), in single precision, (n, inputs).

    Those are their numbers as they are compared, how alike columns differ, which are neighbours in a table and columns
    of the same name in two tables, and how levels deviate from what a half has taught to expect.
    """
    numbers = levels.numbers
    seen = compared(rounded(papers, numbers), numbers)
    columns = list(columns_of(numbers).values())
    parts = [seen, levels.deviations(papers, half)]
    for first, second in combinations(range(len(columns)), 2):
        one, other = numbers[columns[first][0]], numbers[columns[second][0]]
        if (one.table == other.table and second == first + 1) or one.column == other.column:
            labels = {numbers[place].label: place for place in columns[second]}
            both = [(place, labels[numbers[place].label]) for place in columns[first] if numbers[place].label in labels]
            parts.append(seen[:, [a for a, _ in both]] - seen[:, [b for _, b in both]])
    return np.concatenate(parts, axis=1).astype(np.float32)
