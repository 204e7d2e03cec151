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
MOVED = 0.3
"""Share of the settings that a neighbour does not have in common with another paper."""


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
        moved = _moved(u, each, np.random.default_rng([seed, 5, done]), share=1.0)
        seeds = [[seed, 6, done, n] for n in range(each)]
        flown = paper.flown(moved, seeds, 1)[:, 0]
        u, numbers = np.concatenate([u, moved]), np.concatenate([numbers, flown])
        kept = _nearest(paper, numbers, target, each)
        u, numbers = u[kept], numbers[kept]
        say(f"{paper.name}: round {done + 1} of {rounds} towards papers like the printed one")
    return u, numbers


def neighbours(paper: Paper, u: Array, count: int, seed: int) -> Array:
    """Return the numbers of papers, (count, numbers), each of which has some settings between those of u (n, unknowns).

    Args:
        paper: The paper.
        u: Uniform numbers of settings.
        count: How many are flown.
        seed: Seed of moves and noise.
    """
    moved = _moved(u, count, np.random.default_rng([seed, 10]), share=MOVED)
    blocks = [range(first, min(first + paper.block, count)) for first in range(0, count, paper.block)]
    return np.concatenate([paper.flown(moved[own], [[seed, 11, n] for n in own], 1)[:, 0] for own in blocks])


def _moved(u: Array, count: int, generator: np.random.Generator, share: float) -> Array:
    """Return settings (count, unknowns) out of u (n, unknowns), a share of them moved along the way between two."""
    from_, first, second = generator.integers(len(u), size=(3, count))
    step = STEP * (u[first] - u[second])
    moved = np.abs(u[from_] + np.where(generator.random(step.shape) < share, step, 0.0)) % 2  # reflected at 0 and 1
    return np.clip(np.where(moved > 1, 2 - moved, moved), 0, 1 - 1e-9)


def _nearest(paper: Paper, numbers: Array, target: Array, count: int) -> Indices:
    distance = np.abs(compared(numbers, paper.numbers) - target).sum(axis=1)
    return np.argsort(distance, kind="stable")[:count]
