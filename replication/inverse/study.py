"""What a bank says of settings, and how that holds on papers whose settings are known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.bank import Bank, Paper
from replication.inverse.checks import FALSE_ALARM, FORGERIES, PAPERS, coverage, power, power_by_kind
from replication.inverse.consistency import TAUGHT, Consistency
from replication.inverse.forgery import ForgeryTest
from replication.inverse.inference import Inference, features, interval
from replication.inverse.local import like_papers, neighbours
from replication.inverse.pairs import pulling
from replication.inverse.prior import dividing_choices, kinds
from replication.inverse.refinement import nearest
from replication.inverse.scatter import column_scatter, power_if_known

HELD_OUT = 0.09
"""Share of papers that nothing is learned from."""
LEVEL = 0.90
NEIGHBOURS, FURTHER = 7, 10_000
"""Neighbours flown for each near paper, and papers of the bank, that teach what a forgery is."""


def studied(paper: Paper, bank: Bank, rounds: int, each: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Return the settings inferred from the printed numbers, how its columns go together, and the checks of both.

    Args:
        paper: The paper.
        bank: Its bank.
        rounds: Rounds in which papers like the printed one are searched.
        each: How many papers a round flies.
        say: Told how far it is.
    """
    taught = len(bank.u) - max(int(HELD_OUT * len(bank.u)), PAPERS)
    say(f"{paper.name}: learning settings from numbers")
    inference = Inference.learned(paper, bank.u[:taught], bank.numbers[:taught], bank.seed)
    held = np.linspace(taught, len(bank.u) - 1, PAPERS).astype(int)
    covered = coverage(paper, inference, paper.effective(bank.u)[held], bank.numbers[held])
    if not len(paper.printed):
        return {"checks": {"coverage": covered}}
    u, alike = like_papers(paper, bank, rounds, each, bank.seed, say)
    order = np.random.default_rng([bank.seed, 12]).permutation(len(alike))
    alike, kind = alike[order], kinds(paper.unknowns, u[order])
    kept = len(alike) - max(int(HELD_OUT * len(alike)), 1)
    nearby = Consistency.learned(paper.numbers, features(paper, alike[:kept]), kind[:kept], bank.seed)
    near = int(TAUGHT * kept)
    say(f"{paper.name}: papers that teach what a forgery is")
    teaching = neighbours(paper, u[order][:near], NEIGHBOURS * near, bank.seed), _further(paper, bank, u)
    test = ForgeryTest.learned(paper.numbers, alike[:near], alike[near:kept], np.concatenate(teaching), bank.seed)
    say(f"{paper.name}: pairs of numbers")
    seen, printed = features(paper, bank.numbers), features(paper, paper.printed[None])[0]
    pairs = pulling(paper.numbers, seen[:taught], printed, seen[held])
    say(f"{paper.name}: checking on synthetic papers")
    scatter = column_scatter(paper, bank.u[nearest(paper, bank, paper.printed)[:PAPERS]], bank.seed)
    return {
        "pairs": pairs,
        "inferred": {
            "settings": _inferred(paper, inference),
            "p_value": float(test.p_values(paper.printed[None])[0]),
            "columns": _columns(paper, nearby),
        },
        "checks": {
            "coverage": covered,
            "forged": power(test, alike[kept:])
            | {
                "kinds": power_by_kind(test, alike[kept:], dividing_choices(paper.unknowns, u[order][kept:])),
                "scatter": {name: float(np.exp(np.median(spread))) for name, spread in scatter.items()},
                "known_settings": power_if_known(scatter, FORGERIES, FALSE_ALARM),
            },
        },
    }


def _further(paper: Paper, bank: Bank, u: Array) -> Array:
    """Return the numbers of the bank's next papers after the settings u (n, unknowns), (`FURTHER`, numbers)."""
    found = {row.tobytes() for row in u}
    order = nearest(paper, bank, paper.printed)
    return bank.numbers[[row for row in order if bank.u[row].tobytes() not in found][:FURTHER]]


def _inferred(paper: Paper, inference: Inference) -> list[dict[str, Any]]:
    """Return what is inferred of each unknown from the printed numbers."""
    draws = inference.posterior(features(paper, paper.printed[None])[0])
    low, high = interval(draws, LEVEL)
    inferred: list[dict[str, Any]] = []
    for place, unknown in enumerate(paper.unknowns):
        if unknown.choices:
            drawn = unknown.law(draws[:, place]).astype(int)
            shares = {name: float(np.mean(drawn == k)) for k, name in enumerate(unknown.choices)}
            inferred.append({"name": unknown.name, "unit": "", "choices": shares})
        else:
            ends = unknown.law(np.array([low[place], high[place]]))
            inferred.append({"name": unknown.name, "unit": unknown.unit, "interval": [float(end) for end in ends]})
    return inferred


def _columns(paper: Paper, consistency: Consistency) -> list[dict[str, Any]]:
    """Return how the printed columns go together, and which of their numbers are furthest from what others imply."""
    seen = features(paper, paper.printed[None])
    pulls = []
    for (name, places), p in zip(consistency.columns.items(), consistency.p_values(seen)[0], strict=True):
        mean, sigma = consistency.expected(seen[0], places)
        off = (seen[0, places] - mean) / sigma
        furthest = [
            {"number": paper.numbers[places[k]].name, "deviations": float(off[k])} for k in np.argsort(-np.abs(off))[:3]
        ]
        pulls.append({"column": name, "p_value": float(p), "furthest": furthest})
    return pulls
