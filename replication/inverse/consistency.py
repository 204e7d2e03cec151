"""Whether a column of printed numbers goes with all the others.

The density of papers is a mixture of normal ones (Dempster, Laird and Rubin, J. Royal Statistical Society B 39(1),
1977), fitted to each kind of paper for itself, which gives the density of a column when the others are known. How
improbable a column may be is calibrated on papers that the density was not learned from (split conformal prediction:
Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, 2005), so that the rate of false alarms does not
rest on the mixture.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.learned import Scale
from replication.inverse.table import Number

COMPONENTS, EACH = 2, 250
"""Components for a kind of paper, one for so many papers at most."""
RIDGE = 1e-3
"""What is added to variances: the square of three hundredths of the spread among papers."""
TAUGHT = 0.75


def columns_of(numbers: Sequence[Number]) -> dict[str, Indices]:
    """Return the places of the numbers of each column, by its name."""
    names: dict[str, list[int]] = {}
    for place, number in enumerate(numbers):
        names.setdefault(f"{number.table} {number.column}", []).append(place)
    return {name: np.array(places) for name, places in names.items()}


@dataclass(frozen=True)
class Consistency:
    """How well each column goes with the others.

    Attributes:
        columns: Places of each column's numbers.
        scale: Scale of the numbers.
        weights: Of the mixture's components, (c,).
        means: Their means, (c, numbers).
        covariances: Their covariances, (c, numbers, numbers).
        calibration: Scores of papers that are what they say, in increasing order, (papers, columns).
    """

    columns: Mapping[str, Indices]
    scale: Scale
    weights: Array
    means: Array
    covariances: Array
    calibration: Array

    @classmethod
    def learned(cls, numbers: Sequence[Number], seen: Array, kinds: Indices, seed: int) -> Consistency:
        """Return what papers teach, from their features (n, numbers) and kinds (n,)."""
        from sklearn.mixture import GaussianMixture

        taught = int(TAUGHT * len(seen))
        scale = Scale.of(seen[:taught])
        scaled = scale.scaled(seen[:taught])
        weights, means, covariances = [], [], []
        for kind in np.unique(kinds[:taught]):
            own = scaled[kinds[:taught] == kind]
            count = int(np.clip(len(own) // EACH, 1, COMPONENTS))
            mixture = GaussianMixture(count, reg_covar=RIDGE, max_iter=60, random_state=seed, init_params="k-means++")
            mixture.fit(own)
            weights.append(mixture.weights_ * len(own) / taught)
            means.append(mixture.means_)
            covariances.append(mixture.covariances_)
        weight, mean, covariance = map(np.concatenate, (weights, means, covariances))
        columns = columns_of(numbers)
        bare = cls(columns, scale, weight, mean, covariance, np.empty((0, len(columns))))
        return replace(bare, calibration=np.sort(bare.scores(seen[taught:]), axis=0))

    def scores(self, seen: Array) -> Array:
        """Return how improbable each column is when the others are known, (n, columns), from features (n, numbers)."""
        scaled = self.scale.scaled(seen)
        every = np.arange(seen.shape[1])
        whole = self._log_density(scaled, every)
        others = [self._log_density(scaled, np.setdiff1d(every, places)) for places in self.columns.values()]
        return np.stack([other - whole for other in others], axis=1)

    def p_values(self, seen: Array) -> Array:
        """Return the share of honest papers whose column is as improbable or more, (n, columns)."""
        count = len(self.calibration)
        scores = self.scores(seen)
        below = np.stack(
            [np.searchsorted(self.calibration[:, c], scores[:, c], side="left") for c in range(scores.shape[1])], axis=1
        )
        return np.asarray((count - below + 1) / (count + 1), dtype=float)

    def expected(self, seen: Array, places: Indices) -> tuple[Array, Array]:
        """Return mean and standard deviation of some numbers of one paper (numbers,) when the others are known.

        They are those of the component that fits the others best, on the scale of `table.compared`.
        """
        scaled = self.scale.scaled(seen[None])
        others = np.setdiff1d(np.arange(len(seen)), places)
        best = int(np.argmax(self._by_component(scaled, others)[:, 0]))
        mean, P = self.means[best], self.covariances[best]
        gain = np.linalg.solve(P[np.ix_(others, others)], P[np.ix_(others, places)]).T
        middle = mean[places] + gain @ (scaled[0, others] - mean[others])
        variance = np.diag(P[np.ix_(places, places)] - gain @ P[np.ix_(others, places)])
        width = self.scale.width[places]
        return middle * width + self.scale.middle[places], np.sqrt(variance) * width

    def _by_component(self, scaled: Array, places: Indices) -> Array:
        """Return the logarithm of weight times density of some numbers by component, (components, n)."""
        found = []
        for weight, mean, P in zip(self.weights, self.means, self.covariances, strict=True):
            L = np.linalg.cholesky(P[np.ix_(places, places)])
            white = np.linalg.solve(L, (scaled[:, places] - mean[places]).T)
            found.append(np.log(weight) - (white**2).sum(axis=0) / 2 - np.log(np.diag(L) * np.sqrt(2 * np.pi)).sum())
        return np.array(found)

    def _log_density(self, scaled: Array, places: Indices) -> Array:
        each = self._by_component(scaled, places)
        return np.asarray(np.logaddexp.reduce(each, axis=0), dtype=float)
