"""The setting that comes nearest to a paper's printed numbers, by flying settings that get better.

Some unknowns act on a group of numbers alone, as a filter's process noise on its columns. Many values of these are
flown at once, and each group keeps its best: so many filters are searched for the price of one. In turns with that,
random changes of all other unknowns are tried, and the best is kept if it is better (random search with decreasing
steps: Solis and Wets, Mathematics of Operations Research 6(1), 1981). Every setting flies with the same noise, so that
two of them differ by what they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Mask
from replication.inverse.bank import Bank, Paper
from replication.inverse.table import compared

RUNS = 4
TRIED = 48
STARTS = 100
CHECK_RUNS = 40
WIDE, NARROW = 0.3, 0.03
"""Steps of uniform numbers at the first and at the last turn."""
FREEDOM = 4.0
"""Degrees of freedom of the Student t by which residuals count: a number that can't be met must not decide the rest."""


@dataclass(frozen=True)
class Fit:
    """A setting and how well it gives the printed numbers.

    Attributes:
        u: Its uniform numbers, (unknowns,).
        mean: Mean of each number over runs, (numbers,).
        scatter: Standard deviation of a single run, (numbers,).
        residual: Printed less mean, in units of the scatter and of the last digit's rounding together, (numbers,).
        flown: How many settings were flown.
    """

    u: Array
    mean: Array
    scatter: Array
    residual: Array
    flown: int


def misfits(paper: Paper, numbers: Array, printed: Array) -> Array:
    """Return how badly settings give each printed number, (n, numbers), from their runs (n, runs, numbers).

    That is -2 log likelihood, on the scale on which numbers are compared.
    """
    scale = compared(numbers, paper.numbers)
    target = compared(printed, paper.numbers)
    digits = np.array([number.digit for number in paper.numbers])
    ends = compared(printed + digits / 2, paper.numbers), compared(printed - digits / 2, paper.numbers)
    rounding = np.abs(ends[0] - ends[1]) / np.sqrt(12)
    sigma = np.sqrt(scale.var(axis=1, ddof=1) * (1 + 1 / numbers.shape[1]) + rounding**2 + 0.03**2)
    residual = (target - scale.mean(axis=1)) / sigma
    each = (FREEDOM + 1) * np.log1p(residual**2 / FREEDOM) + 2 * np.log(sigma)
    return np.where(np.isfinite(each), each, 1e3)


def best_fit(paper: Paper, bank: Bank, printed: Array, turns: int, seed: int, say: Callable[[str], None]) -> Fit:
    """Return the setting that fits best.

    Args:
        paper: The paper.
        bank: Where the search starts: the settings whose numbers are nearest.
        printed: The printed numbers, (numbers,).
        turns: How many times the setting is improved.
        seed: Seed of the search and of the noise.
        say: Told how far it is.
    """
    rng = np.random.default_rng([seed, 3])

    def of(u: Array) -> Array:
        return misfits(paper, paper.flown(u, [[seed, 2]] * len(u), RUNS), printed)

    distance = np.abs(compared(bank.numbers, paper.numbers) - compared(printed, paper.numbers)).sum(axis=1)
    nearest = np.argsort(distance, kind="stable")[:STARTS]
    u = paper.apart(paper.effective(bank.u)[nearest])
    found = of(u)
    start = int(np.argmin(found.sum(axis=1)))
    best, least, flown = u[start], found[start], len(u)
    own = np.concatenate([unknowns for _, unknowns in paper.groups])
    common = np.setdiff1d(np.arange(len(best)), own)
    for turn in range(turns):
        step = WIDE * (NARROW / WIDE) ** (turn / max(turns - 1, 1))
        tried = np.repeat(best[None], TRIED, axis=0)
        tried[:, own] = _moved(tried[:, own], step, np.ones((TRIED, len(own)), dtype=bool), rng)
        found = of(tried)
        for numbers, unknowns in paper.groups:
            kept = int(np.argmin(found[:, numbers].sum(axis=1)))
            if found[kept, numbers].sum() < least[numbers].sum():
                best = best.copy()
                best[unknowns], least[numbers] = tried[kept, unknowns], found[kept, numbers]
        tried = np.repeat(best[None], TRIED, axis=0)
        tried[:, common] = _moved(tried[:, common], step, rng.random((TRIED, len(common))) < 3 / len(common), rng)
        tried = paper.apart(tried)
        found = of(tried)
        kept = int(np.argmin(found.sum(axis=1)))
        if found[kept].sum() < least.sum():
            best, least = tried[kept], found[kept]
        flown += 2 * TRIED
        say(f"{paper.name}: turn {turn + 1} of {turns}, misfit {least.sum():.1f}")
    numbers = paper.flown(best[None], [[seed, 4]], CHECK_RUNS)[0]
    mean, scatter = numbers.mean(axis=0), numbers.std(axis=0, ddof=1)
    digits = np.array([number.digit for number in paper.numbers])
    sigma = np.sqrt(scatter**2 * (1 + 1 / CHECK_RUNS) + digits**2 / 12)
    return Fit(best, mean, scatter, (printed - mean) / sigma, flown)


def _moved(u: Array, step: float, where: Mask, rng: np.random.Generator) -> Array:
    """Return uniform numbers that have moved by normal steps where they may, a fifth of them to anywhere."""
    moved = np.abs(u + step * rng.standard_normal(u.shape)) % 2  # reflected at 0 and 1
    moved = np.where(moved > 1, 2 - moved, moved)
    moved = np.where(rng.random(u.shape) < 0.2, rng.random(u.shape), moved)
    return np.clip(np.where(where, moved, u), 0, 1 - 1e-9)
