"""How the level of a column scatters from run to run of one setting, and what a test sees that knows the setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.bank import Paper
from replication.inverse.consistency import columns_of
from replication.inverse.levels import apart

RUNS = 20


def column_scatter(paper: Paper, u: Array, seed: int) -> dict[str, Array]:
    """Return the standard deviation of each column's level among single runs of settings u (n, unknowns), (n,).

    A level is the mean of the logarithms of a column's sizes.
    """
    flown = paper.flown(u, [[seed, 9, row] for row in range(len(u))], RUNS)
    papers = flown.reshape(-1, flown.shape[2])
    return {
        name: apart(paper.numbers, places, papers)[0].reshape(len(u), RUNS).std(axis=1, ddof=1)
        for name, places in columns_of(paper.numbers).items()
    }


def power_if_known(
    scatter: Mapping[str, Array], factors: Sequence[float], false_alarm: float
) -> dict[str, dict[str, float]]:
    """Return how often a test calls a column times a factor inconsistent that knows the setting, by column and factor.

    It compares the level of every column with that of the setting, each for itself, and shares its false alarms among
    the columns (Bonferroni). Levels are normal.

    Args:
        scatter: Standard deviations of the levels in some settings, (n,), by column; the power is the mean over them.
        factors: Of the forgeries.
        false_alarm: Rate of false alarms of all columns together.
    """
    from scipy.stats import norm

    limit = norm.ppf(1 - false_alarm / 2 / len(scatter))

    def called(spread: Array, factor: float) -> float:
        off = abs(np.log(factor)) / spread
        return float(np.mean(norm.cdf(off - limit) + norm.cdf(-off - limit)))

    return {name: {f"{by:g}": called(spread, by) for by in factors} for name, spread in scatter.items()}
