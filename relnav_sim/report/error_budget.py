"""The error budget in a report: of the leading filter of a case, from the campaign that the result holds."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.plots.budget import BudgetCurves
from relnav_sim.plots.data import errors_of, rms_over_runs
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.report.tables import Column, Row, Table, Words
from relnav_sim.results.block import RefusedError

if TYPE_CHECKING:
    from relnav_sim.budget import Budget
    from relnav_sim.results.read import Results

MOST_BUDGETS = 20
"""Of so many cases that are shown closely, each gets its budget; of more, none does."""
MOST_EPOCHS = 50_000
"""Of a run whose budget is made for a report: it holds some 7 kB an epoch."""


@dataclass(frozen=True)
class BudgetSection:
    """The error budget of one filter of a case.

    Attributes:
        tables: By source, and at the end of each phase.
        curves: What its figure draws.
        note: How it compares with the runs.
    """

    tables: tuple[Table, ...]
    curves: BudgetCurves
    note: str


def budget_title(filter: str) -> str:
    """Return the title of the table of a filter's budget by source."""
    return f"Error budget of {filter}"


def budget_section(results: Results, case: CaseFacts, ranked: Sequence[str]) -> BudgetSection | str:
    """Return the error budget of the best filter of a case that has one; else in a sentence why there is none.

    Args:
        results: An opened result.
        case: The case.
        ranked: Its filters, the best first.
    """
    from relnav_sim.budget import budgeted_filters, error_budget
    from relnav_sim.budget.verdict import in_words, squares_of, verdict
    from relnav_sim.results.stored_campaign import stored_campaign

    if results.headers[case.index].stress:
        return "No error budget: the case is under a stress."
    try:
        campaign = stored_campaign(results)
    except RefusedError as error:
        return f"No error budget: {str(error).removeprefix(f'{results.path}: ')}."
    config = campaign.cases[case.index].config
    if config.clock.epochs > MOST_EPOCHS:
        command = f"relnav budget CAMPAIGN --case {case.index} --result {shlex.quote(results.path.name)}"
        return f"No error budget of this case, because a run has more than {MOST_EPOCHS} epochs; it is: {command}"
    known = budgeted_filters(config)
    name = next((name for name in ranked if name in known), None)
    if name is None:
        return "No error budget: the gain of every filter depends on the measurements."
    try:
        budget = error_budget(campaign, case.index, name)
    except ValueError as error:
        return f"No error budget: {error}."
    squares = squares_of(results, results.headers[case.index].id, name)
    found = verdict(budget, squares, config.statistics.settle_s)
    words = "too few runs to compare with" if found is None else in_words(found, budget)
    note = f"Error budget of {name}: {words}."
    if budget.not_covered:
        note += f" Not in it: {'; '.join(budget.not_covered)}."
    return BudgetSection(_tables(budget, case), budget_curves(budget, _actual(results, case, name)), note)


def actual_sigma(result: Path, case_id: str, filter: str) -> tuple[Array, Array] | None:
    """Return the times (K,) and the RMS position error over the runs of a filter in a result, s and m; None: no run."""
    from relnav_sim.plots.facts import case_facts
    from relnav_sim.results.read import open_results

    with open_results(result) as results:
        facts = case_facts(results, case_id)
        return _actual(results, facts, filter) if filter in facts.names else None


def _actual(results: Results, case: CaseFacts, filter: str) -> tuple[Array, Array]:
    errors = errors_of(results, case, case.filter(filter), np.arange(len(case.times_s)))
    return case.times_s, rms_over_runs(errors[..., :3])


def budget_curves(budget: Budget, actual: tuple[Array, Array] | None = None) -> BudgetCurves:
    """Return what the figure of a budget draws.

    Args:
        budget: The budget.
        actual: Times and RMS position error of a Monte Carlo to draw beside it, s and m.
    """
    fixed = np.asarray(budget.means.any(axis=(1, 2)))
    position = budget.variance[:, :, :3].sum(axis=2)
    sources = enumerate(budget.sources)
    areas = {name: position[place] for place, name in sources if not fixed[place] and (position[place] >= 0).all()}
    areas["the same in every run"] = np.square(budget.means.sum(axis=0)[:, :3]).sum(axis=1)
    ends = [float(budget.times_s[phase.epoch]) for phase in budget.phases[:-1]]
    formal = budget.formal[:, :3].sum(axis=1)
    kept = {name: area for name, area in areas.items() if area.any()}
    return BudgetCurves(budget.filter, budget.times_s, kept, formal, actual, ends)


def _tables(budget: Budget, case: CaseFacts) -> tuple[Table, Table]:
    from relnav_sim.budget.table import budget_rows, phase_rows

    by_source = Table(
        name=f"case_{case.index:03d}_budget",
        title=budget_title(budget.filter),
        caption="Linear covariance analysis along the nominal truth. "
        f"Sigmas from {case.settle_s:g} s on, and at the end. "
        "Share: of the position's variance. Halved: by how much the position sigma falls when the source is half as "
        "large. Per unit: by how much it grows for each unit of the source's sigma. Formal: the sigma that the "
        "filter itself predicts.",
        corner="source",
        columns=(
            Column("sigma", "position [m]", numeric=False),
            Column("at the end", "position [m]", numeric=False),
            Column("sigma", "velocity [m/s]", numeric=False, opens_group=True),
            Column("at the end", "velocity [m/s]", numeric=False),
            Column("share", numeric=False, opens_group=True),
            Column("halved", numeric=False),
            Column("per unit", numeric=False),
        ),
        rows=_rows(budget_rows(budget, case.settle_s)),
    )
    by_phase = Table(
        name=f"case_{case.index:03d}_budget_phases",
        title=f"Error budget of {budget.filter} by phase",
        caption="Position sigma of each source at the end of each phase, m. -: below a thousandth of the total.",
        corner="source",
        columns=tuple(
            Column(f"{phase.ends}, {budget.times_s[phase.epoch]:g} s", numeric=False) for phase in budget.phases
        ),
        rows=_rows(phase_rows(budget)),
    )
    return by_source, by_phase


def _rows(rows: Sequence[tuple[str, ...]]) -> tuple[Row, ...]:
    return tuple(Row(name, tuple(Words(cell) for cell in cells), opens_block=name == "total") for name, *cells in rows)
