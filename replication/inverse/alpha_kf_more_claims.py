"""A8 to A12 of Shi et al. (2025): absolute errors, outliers, a slow wave and the formal covariance."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Mask
from replication.inverse.alpha_kf import AlphaKf
from replication.inverse.alpha_kf_flight import ALPHAS
from replication.inverse.alpha_kf_numbers import FILTERS, NUMBERS
from replication.inverse.alpha_kf_outcomes import OUTCOMES
from replication.inverse.bank import Bank

RUNS, DEVIATIONS = 20, 2.0
ABSOLUTE = {
    "A8": (2, [f"table_2 {name} r mean" for name in FILTERS]),
    "A9": (3, [f"table_3 alpha_kf {quantity} mean" for quantity in "rv"]),
}
PERIOD_S, SMALL = 3500.0, 0.5
_PLACE = {name: place for place, name in enumerate(OUTCOMES)}


def holds_besides(outcomes: Array, best_alphas: tuple[float, ...]) -> dict[str, Mask]:
    """Return in which settings the claims without printed numbers hold by the outcomes of one run, (n, outcomes).

    A10: the share of outliers is least at one of `best_alphas`, for position and velocity. A11: the wave of each filter
    has a period of 3500 s within a tenth. A12: each formal sigma falls to a half.
    """

    def of(name: str) -> Array:
        column: Array = outcomes[:, _PLACE[name]]
        return column

    fewest = [
        _least_at([of(f"share of outliers of {quantity}, alpha={alpha:g}") for alpha in ALPHAS], best_alphas)
        for quantity in "rv"
    ]
    periods = [np.abs(of(f"period of the wave, {name}") - PERIOD_S) <= PERIOD_S / 10 for name in FILTERS]
    small = [of(f"formal sigma after 100 s over the first, {name}") <= SMALL for name in FILTERS]
    return {name: np.all(parts, axis=0) for name, parts in (("A10", fewest), ("A11", periods), ("A12", small))}


def _least_at(shares: list[Array], best_alphas: tuple[float, ...]) -> Mask:
    """Return whether one of some alphas has fewer outliers than all others."""
    best = [share for alpha, share in zip(ALPHAS, shares, strict=True) if alpha in best_alphas]
    rest = [share for alpha, share in zip(ALPHAS, shares, strict=True) if alpha not in best_alphas]
    return np.asarray(np.min(best, axis=0) < np.min(rest, axis=0))


def absolute(bank: Bank, printed: Array) -> dict[str, Mask]:
    """Return in which of the bank's settings the printed errors lie among those of single runs.

    That is within two standard deviations of the mean over runs. Settings whose one run is within a factor of two of
    each of them are flown again, `RUNS` times; no other comes near.
    """
    places = {number.name: place for place, number in enumerate(NUMBERS)}
    held = {}
    for claim, (table, names) in ABSOLUTE.items():
        wanted = [places[name] for name in names]
        ratio = bank.numbers[:, wanted] / printed[wanted]
        rows = np.flatnonzero(((ratio >= 0.5) & (ratio <= 2)).all(axis=1))
        paper = AlphaKf((table,))
        own = [[number.name for number in paper.numbers].index(name) for name in names]
        runs = paper.flown(bank.u[rows], [[bank.seed, int(row), 2] for row in rows], RUNS)[:, :, own]
        near = np.abs(printed[wanted] - runs.mean(axis=1)) <= DEVIATIONS * runs.std(axis=1, ddof=1)
        held[claim] = np.zeros(len(bank.u), dtype=bool)
        held[claim][rows] = near.all(axis=1)
    return held
