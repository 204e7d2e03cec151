"""Printed numbers, and claims, that go together least of all pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from replication.inverse.claims import wilson
from replication.inverse.table import Number

NEAREST = 200
ALONE = 0.05
"""A number is acceptable alone where at least this share of papers is as far out on one of the two sides."""
UNLIKELY = 0.02
ROWS, WORST = 10, 500


def pair_p_values(seen: Array, paper: Array) -> tuple[Array, Array]:
    """Return how probable each pair of a paper's numbers is where each alone is acceptable, else 1.

    Of the papers whose first number is nearest, the share is taken in which the second is as far out on its side,
    twice; the same the other way round; and the larger counts.

    Args:
        seen: Features of papers, (n, numbers).
        paper: Those of the paper, (numbers,).

    Returns:
        The p-values, (numbers, numbers), and how many standard deviations (from the middle 68 %) the second is off its
        median where the first is near, the smaller of both ways.
    """
    count = len(paper)
    alone = _tail(seen, paper) >= ALONE
    p, off = np.ones((count, count)), np.zeros((count, count))
    for first in np.flatnonzero(alone):
        near = seen[np.argpartition(np.abs(seen[:, first] - paper[first]), NEAREST)[:NEAREST]]
        p[first] = _tail(near, paper)
        low, middle, high = np.quantile(near, (0.16, 0.5, 0.84), axis=0)
        off[first] = (paper - middle) / np.maximum((high - low) / 2, 1e-3)
    p[:, ~alone] = 1.0
    np.fill_diagonal(p, 1.0)
    return np.maximum(p, p.T), np.minimum(np.abs(off), np.abs(off).T)


def _tail(seen: Array, paper: Array) -> Array:
    """Return twice the share of papers that are as far out on the same side, (numbers,)."""
    below, above = (1 + (seen <= paper).sum(axis=0)), (1 + (seen >= paper).sum(axis=0))
    return np.asarray(np.minimum(2 * np.minimum(below, above) / (len(seen) + 1), 1.0), dtype=float)


def pulling(numbers: Sequence[Number], seen: Array, paper: Array, honest: Array) -> dict[str, Any]:
    """Return the least compatible pairs, one for each pair of columns, and how many there are in honest papers too.

    Args:
        numbers: What is printed.
        seen: Features of papers, (n, numbers).
        paper: Those of the printed one, (numbers,).
        honest: Those of papers that are what they say, not among the others, (papers, numbers).
    """
    p, off = pair_p_values(seen, paper)
    found: dict[tuple[str, ...], dict[str, Any]] = {}
    pairs = sorted(combinations(range(len(paper)), 2), key=lambda pair: (p[pair], -off[pair]))[:WORST]
    for first, second in pairs:
        columns = tuple(sorted(f"{numbers[k].table} {numbers[k].column}" for k in (first, second)))
        if columns not in found:
            names = {"first": numbers[first].name, "second": numbers[second].name}
            found[columns] = names | {"p_value": float(p[first, second]), "deviations": float(off[first, second])}
    others = [_unlikely(pair_p_values(seen, each)[0]) for each in honest]
    return {
        "limit": UNLIKELY,
        "count": _unlikely(p),
        "honest": [float(each) for each in np.quantile(others, (0.5, 0.95))],
        "pairs": list(found.values())[:ROWS],
    }


def _unlikely(p: Array) -> int:
    return int(np.sum(np.triu(p <= UNLIKELY, 1)))


def claims_together(by_claim: Mapping[str, Mask]) -> list[dict[str, Any]]:
    """Return how often two claims hold together, the least compatible first: the share of where the rarer one holds."""
    pairs: list[dict[str, Any]] = []
    for first, second in combinations((name for name, mask in by_claim.items() if mask.any()), 2):
        a, b = by_claim[first], by_claim[second]
        rarer, both = int(min(a.sum(), b.sum())), int((a & b).sum())
        pairs.append({"claims": [first, second], "share": both / rarer, "interval": list(wilson(both, rarer))})
    return sorted(pairs, key=lambda pair: float(pair["share"]))[:ROWS]
