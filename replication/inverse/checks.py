"""Checks of the inference on papers whose settings are known: coverage, and power against a forged column."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.bank import Paper
from replication.inverse.consistency import columns_of
from replication.inverse.forgery import ForgeryTest, forged, mixed
from replication.inverse.inference import Inference, features, interval
from replication.inverse.prior import Unknown

PAPERS = 50
LEVEL = 0.90
FALSE_ALARM = 0.05
FORGERIES = (0.33, 0.5, 0.67, 0.8, 1.25, 1.5, 2.0, 3.0)
_NAMES = [f"{by:g}" for by in FORGERIES]


def coverage(paper: Paper, inference: Inference, known: Array, numbers: Array) -> dict[str, Any]:
    """Return how often intervals contain the known settings of synthetic papers held out of the bank.

    Args:
        paper: Whose tables they are.
        inference: What was learned from the bank.
        known: Their settings as they act, (papers, unknowns).
        numbers: Their numbers, (papers, numbers).
    """
    from scipy.stats import binom

    seen = features(paper, numbers)
    inside = np.empty(known.shape, dtype=bool)
    narrower = np.empty(inside.shape)
    for row in range(len(known)):
        draws = inference.posterior(seen[row])
        low, high = interval(draws, LEVEL)
        inside[row] = (known[row] >= low) & (known[row] <= high)
        narrower[row] = high - low
        for place, unknown in enumerate(paper.unknowns):
            if unknown.choices:
                inside[row, place], narrower[row, place] = _credible(unknown, draws[:, place], known[row, place])
    count = len(known)
    least = int(binom.ppf(0.025 / len(paper.unknowns), count, LEVEL))
    contained, width = inside.sum(axis=0), narrower.mean(axis=0)
    table = [
        {"unknown": unknown.name, "contained": int(contained[place]), "width": float(width[place])}
        for place, unknown in enumerate(paper.unknowns)
    ]
    return {
        "papers": count,
        "level": LEVEL,
        "contained": float(inside.mean()),
        "least_allowed": least,
        "passed": bool(contained.min() >= least),
        "unknowns": table,
    }


def _credible(unknown: Unknown, draws: Array, known: float) -> tuple[bool, float]:
    """Return whether the fewest choices that have `LEVEL` of the draws contain the known one, and their share."""
    drawn, own = unknown.law(draws).astype(int), int(unknown.law(np.array([known]))[0])
    counts = np.bincount(drawn, minlength=len(unknown.choices))
    order = np.argsort(-counts, kind="stable")
    needed = int(np.searchsorted(np.cumsum(counts[order]), LEVEL * len(draws))) + 1
    return own in order[:needed], needed / len(unknown.choices)


def power(test: ForgeryTest, numbers: Array) -> dict[str, Any]:
    """Return how often a synthetic paper with one forged column is called inconsistent, and one without.

    A column is forged by a factor, or is that of another paper.

    Args:
        test: What honest papers have taught.
        numbers: Numbers of papers held out of the bank, (papers, numbers).
    """

    def called(papers: Array) -> float:
        return float(np.mean(test.p_values(papers) <= FALSE_ALARM))

    rows = []
    for name, places in columns_of(test.levels.numbers).items():
        each = [places] * len(numbers)
        found = {
            name: called(forged(numbers, each, np.full(len(numbers), by)))
            for name, by in zip(_NAMES, FORGERIES, strict=True)
        }
        other = mixed(numbers, each, np.roll(numbers, 1, axis=0))
        rows.append({"column": name, "called_inconsistent": found, "of_another_paper": called(other)})
    return {
        "papers": len(numbers),
        "nominal_false_alarm": FALSE_ALARM,
        "false_alarm": called(numbers),
        "columns": rows,
    }


def power_by_kind(test: ForgeryTest, numbers: Array, kinds: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Return the power, the mean over columns, for papers of each kind.

    Args:
        test: What honest papers have taught.
        numbers: Numbers of papers held out of the bank, (papers, numbers).
        kinds: Whether each paper is of a kind, (papers,), by the kind's name; kinds without a paper are left out.
    """
    rows = []
    for name, own in kinds.items():
        if own.any():
            found = power(test, numbers[own])
            columns = found.pop("columns")
            called = {by: float(np.mean([row["called_inconsistent"][by] for row in columns])) for by in _NAMES}
            other = float(np.mean([row["of_another_paper"] for row in columns]))
            rows.append(found | {"kind": name, "called_inconsistent": called, "of_another_paper": other})
    return rows
