"""What is found of a paper: its claims by the bank, and its best setting."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from replication.inverse import alpha_kf_claims
from replication.inverse.bank import Bank, Paper
from replication.inverse.findings import table_rows
from replication.inverse.prior import values
from replication.inverse.refinement import Fit, best_fit

FAR = 4.0
CLAIMS = {"alpha_kf": alpha_kf_claims.findings}


def judged_paper(paper: Paper, bank: Bank, generations: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Return bank, claims, sentences and tables of a paper as the file of findings has them."""
    found = CLAIMS[paper.name](bank, paper.printed)
    found["bank"] = {
        "campaigns": len(bank.u),
        "cpu_hours": bank.cpu_s / 3600,
        "seed": bank.seed,
        "digest": bank.digest,
        "unknowns": [{"name": each.name, "unit": each.unit, "words": each.words} for each in paper.unknowns],
    }
    if len(paper.numbers):
        fit = best_fit(paper, bank, paper.printed, np.ones(len(paper.numbers), dtype=bool), generations, bank.seed, say)
        found["tables"] = table_rows(paper, fit)
        found["best"] = _best(paper, fit)
    return found


def _best(paper: Paper, fit: Fit) -> dict[str, Any]:
    """Return the best setting and the numbers that are furthest from it."""
    order = np.argsort(-np.abs(fit.residual), kind="stable")
    far = [
        {"number": paper.numbers[place].name, "residual": float(fit.residual[place])}
        for place in order
        if abs(fit.residual[place]) > FAR
    ]
    told = []
    for unknown, value in zip(
        paper.unknowns, values(paper.unknowns, paper.effective(fit.u[None])).values(), strict=True
    ):
        number = float(value[0])
        told.append(
            {
                "name": unknown.name,
                "unit": unknown.unit,
                "value": unknown.choices[int(number)] if unknown.choices else number,
            }
        )
    return {
        "settings": told,
        "within_two": float(np.mean(np.abs(fit.residual) <= 2)),
        "beyond_four": len(far),
        "furthest": far[:12],
        "flown": fit.flown,
    }
