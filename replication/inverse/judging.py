"""What is found of a paper: its claims by the bank, and its best setting."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse import alpha_kf_claims, mf_upf, mf_upf_learned, two_step
from replication.inverse.bank import Bank, Paper
from replication.inverse.findings import table_rows
from replication.inverse.misfit import distance
from replication.inverse.prior import Unknown, values
from replication.inverse.refinement import HONEST, Fit, best_fits, honest_residuals, places_of
from replication.inverse.synthetic import searched

FAR = 4.0
CLAIMS = {
    "alpha_kf": alpha_kf_claims.findings,
    "mf_upf": mf_upf.findings,
    "mf_upf_learned": mf_upf_learned.findings,
    "two_step_kf": two_step.findings,
}


def judged_paper(paper: Paper, bank: Bank, batches: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Return bank, claims, sentences and tables of a paper as the file of findings has them."""
    found = CLAIMS[paper.name](bank, paper.printed)
    found["bank"] = bank_summary(paper, bank)
    found["tables"] = {}
    if len(paper.printed):
        fits = best_fits(paper, bank, paper.printed, batches, bank.seed, say, list(paper.tables))
        found["tables"] = table_rows(paper, fits)
        honest = distance(honest_residuals(paper, bank, paper.printed, HONEST, bank.seed))
        found["best"] = {
            name: best_of(paper.tables.get(name, paper), fit, honest[:, places_of(paper, name)])
            for name, fit in fits.items()
        }
        found["searched"] = searched(paper, bank, batches, say)
    return found


def bank_summary(paper: Paper, bank: Bank) -> dict[str, Any]:
    """Return what a bank is: its size and cost, its prior, and between which values 90 % of its numbers lie."""
    low, middle, high = np.quantile(bank.numbers, (0.05, 0.5, 0.95), axis=0)
    return {
        "campaigns": len(bank.u),
        "cpu_hours": bank.cpu_s / 3600,
        "seed": bank.seed,
        "digest": bank.digest,
        "unknowns": [_prior(unknown) for unknown in paper.unknowns],
        "numbers": [
            {"name": number.name, "quantiles": [float(low[k]), float(middle[k]), float(high[k])]}
            for k, number in enumerate(paper.numbers)
        ],
    }


def _prior(unknown: Unknown) -> dict[str, Any]:
    """Return an unknown with its prior: the share of each choice, or the 0, 5, 50, 95 and 100 % quantiles."""
    told: dict[str, Any] = {"name": unknown.name, "unit": unknown.unit, "words": unknown.words}
    drawn = unknown.law((np.arange(1200) + 0.5) / 1200)
    if unknown.choices:
        return told | {"choices": {name: float(np.mean(drawn == k)) for k, name in enumerate(unknown.choices)}}
    return told | {"quantiles": [float(end) for end in np.quantile(drawn, (0, 0.05, 0.5, 0.95, 1))]}


def best_of(paper: Paper, fit: Fit, honest: Array) -> dict[str, Any]:
    """Return a best setting, the numbers furthest from it, and its distance beside that of honest papers.

    Args:
        paper: The paper, or one of its tables.
        fit: The setting.
        honest: Distances of honest papers, number by number, (papers, numbers).
    """
    order = np.argsort(-np.abs(fit.residual), kind="stable")
    far = [
        {"number": paper.numbers[place].name, "residual": float(fit.residual[place])}
        for place in order
        if abs(fit.residual[place]) > FAR
    ]
    found = values(paper.unknowns, paper.effective(fit.u[None])).values()
    told = [
        unknown.choices[int(value[0])] if unknown.choices else float(value[0])
        for unknown, value in zip(paper.unknowns, found, strict=True)
    ]
    return {
        "settings": told,
        "numbers": len(paper.numbers),
        "within_two": float(np.mean(np.abs(fit.residual) <= 2)),
        "beyond_four": len(far),
        "furthest": far[:12],
        "distance": fit.distance,
        "honest": [float(each) for each in np.quantile(honest.sum(axis=1), (0.5, 0.95))],
        "flown": fit.flown,
        "misfit": list(fit.misfit),
    }
