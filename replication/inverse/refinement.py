"""The setting that comes nearest to a paper's printed numbers, by flying settings that get better.

Differential evolution (Storn and Price, J. Global Optimization 11, 1997) from the bank's nearest settings on.
Every setting flies with the same noise, so that two of them differ by what they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from replication.inverse.bank import Bank, Paper
from replication.inverse.table import compared

RUNS = 4
POPULATION = 120
CHECK_RUNS = 40
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
        generations: How many there were.
        flown: How many settings were flown.
    """

    u: Array
    mean: Array
    scatter: Array
    residual: Array
    generations: int
    flown: int


def misfit(paper: Paper, numbers: Array, printed: Array, counted: Mask) -> Array:
    """Return how badly settings give printed numbers, (n,), from their runs (n, runs, numbers): -2 log likelihood."""
    scale = compared(numbers, paper.numbers)
    target = compared(printed, paper.numbers)
    digits = np.array([number.digit for number in paper.numbers])
    rounding = (
        np.abs(compared(printed + digits / 2, paper.numbers) - compared(printed - digits / 2, paper.numbers)) / 3.5
    )
    sigma = np.sqrt(scale.var(axis=1, ddof=1) * (1 + 1 / numbers.shape[1]) + rounding**2 + 0.03**2)
    residual = (target - scale.mean(axis=1)) / sigma
    each = (FREEDOM + 1) * np.log1p(residual**2 / FREEDOM) + 2 * np.log(sigma)
    total: Array = np.where(np.isfinite(each), each, 1e3)[:, counted].sum(axis=1)
    return total


def best_fit(
    paper: Paper,
    bank: Bank,
    printed: Array,
    counted: Mask,
    generations: int,
    seed: int,
    say: Callable[[str], None],
    fixed: Callable[[Array], Array] = lambda u: u,
) -> Fit:
    """Return the setting that fits best.

    Args:
        paper: The paper.
        bank: Where the search starts.
        printed: The printed numbers, (numbers,).
        counted: Which of them count.
        generations: How many times the settings are improved.
        seed: Seed of the search and of the noise.
        say: Told how far it is.
        fixed: Moves uniform numbers (n, unknowns) to where a condition holds.
    """
    from scipy.optimize import differential_evolution

    distance = compared(bank.numbers, paper.numbers) - compared(printed, paper.numbers)
    spread = np.abs(distance).sum(axis=1, where=counted)
    start = fixed(bank.u[np.argsort(spread, kind="stable")[:POPULATION]])

    def of(u: Array) -> Array:
        settings = fixed(np.atleast_2d(u.T))
        seeds = [[seed, 2]] * len(settings)
        return misfit(paper, paper.flown(settings, seeds, RUNS), printed, counted)

    done = [0]

    def after(intermediate_result: Any) -> None:
        done[0] += 1
        if done[0] % 20 == 0:
            say(f"{paper.name}: generation {done[0]} of {generations}, misfit {intermediate_result.fun:.1f}")

    found = differential_evolution(
        of,
        [(0.0, 1.0 - 1e-9)] * len(paper.unknowns),
        init=np.clip(start, 0, 1 - 1e-9),
        maxiter=generations,
        vectorized=True,
        updating="deferred",
        polish=False,
        strategy="currenttobest1bin",
        mutation=(0.3, 0.9),
        recombination=0.5,
        tol=0.0,
        callback=after,
        seed=np.random.default_rng([seed, 3]),
    )
    u = fixed(found.x[None])[0]
    numbers = paper.flown(u[None], [[seed, 4]], CHECK_RUNS)[0]
    mean, scatter = numbers.mean(axis=0), numbers.std(axis=0, ddof=1)
    digits = np.array([number.digit for number in paper.numbers])
    sigma = np.sqrt(scatter**2 * (1 + 1 / CHECK_RUNS) + digits**2 / 12)
    return Fit(u, mean, scatter, (printed - mean) / sigma, int(found.nit), POPULATION * (int(found.nit) + 1))
