"""Papers that are like a printed one: settings whose numbers come near it, found in rounds.

Population Monte Carlo (Beaumont, Cornuet, Marin and Robert, Biometrika 96(4), 2009) without its weights: what is wanted
are papers on which the check of columns is sharp, not a posterior.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from relnav_sim.arrays import Array, Indices
from replication.inverse.bank import Bank, Paper
from replication.inverse.table import compared

STEP = 0.5
"""Size of a move over the distance between two settings that are near already."""


def like_papers(
    paper: Paper, bank: Bank, rounds: int, each: int, seed: int, say: Callable[[str], None]
) -> tuple[Array, Array]:
    """Return the uniform numbers and the numbers of settings like the printed paper, (n, unknowns) and (n, numbers).

    Args:
        paper: The paper.
        bank: Where the search starts; its nearest tenth.
        rounds: How often settings move.
        each: How many are flown in a round, and kept in the end.
        seed: Seed of moves and noise.
        say: Told how far it is.
    """
    target = compared(paper.printed, paper.numbers)
    u, numbers = bank.u, bank.numbers
    start = _nearest(paper, numbers, target, max(len(u) // 10, 10))
    u, numbers = u[start], numbers[start]
    for done in range(rounds):
        generator = np.random.default_rng([seed, 5, done])
        from_, first, second = generator.integers(len(u), size=(3, each))
        moved = u[from_] + STEP * (u[first] - u[second])
        moved = np.abs(moved) % 2  # reflected at 0 and 1
        moved = np.clip(np.where(moved > 1, 2 - moved, moved), 0, 1 - 1e-9)
        seeds = [[seed, 6, done, n] for n in range(each)]
        flown = paper.flown(moved, seeds, 1)[:, 0]
        u, numbers = np.concatenate([u, moved]), np.concatenate([numbers, flown])
        kept = _nearest(paper, numbers, target, each)
        u, numbers = u[kept], numbers[kept]
        say(f"{paper.name}: round {done + 1} of {rounds} towards papers like the printed one")
    return u, numbers


def _nearest(paper: Paper, numbers: Array, target: Array, count: int) -> Indices:
    distance = np.abs(compared(numbers, paper.numbers) - target).sum(axis=1)
    return np.argsort(distance, kind="stable")[:count]
