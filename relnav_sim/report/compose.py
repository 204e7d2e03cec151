"""From an opened result to a report as data: words, tables and drawn figures."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from relnav_sim.plots.axes import Axes
from relnav_sim.plots.commands import reproduce_commands
from relnav_sim.report import campaign_facts, html
from relnav_sim.report.attempts import attempted
from relnav_sim.report.case_section import budget_table, compose_case, rank_cases
from relnav_sim.report.curves import embedded, points_of
from relnav_sim.report.decision import decision_section
from relnav_sim.report.drawing import FigureFolder, within
from relnav_sim.report.error_budget import MOST_BUDGETS, budget_title
from relnav_sim.report.evidence import decided
from relnav_sim.report.opened import Opened
from relnav_sim.report.overview import over_in_words, overview_table
from relnav_sim.report.page import CaseSection, DecisionSection, Page, RegretSection, ScenarioSection
from relnav_sim.report.pictures import FIGURES_OF_A_CASE, overall_pictures
from relnav_sim.report.processes import shared_out
from relnav_sim.report.ranking import Ranking
from relnav_sim.report.regret import regret_section
from relnav_sim.report.requirements import in_sentences, judgements, requirements_table
from relnav_sim.report.reservations import Background
from relnav_sim.report.scenario import limitations, scenario_picture
from relnav_sim.report.summary import summarise
from relnav_sim.report.tables import Table
from relnav_sim.report.told import told_table
from relnav_sim.results.stopping import stopping_in_words
from relnav_sim.statistics.requirements import Judgement
from relnav_sim.wording import short_labels

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

MOST_FIGURES = 100
MANY_CASES = 50
"""Of more cases a page shows only those closely that are asked for."""
_LARGEST_HTML = 4_700_000
_WORTH_A_PROCESS = 12  # cases times filters, about 4 s of drawing: less than that, starting a process takes longer
_RANKED_AT_ONCE = 100  # cases

_READING = (
    "Error is estimate minus truth. Mean and std are taken over the time of each run, as in Table 2 of Shi et al. "
    "(2025); a table shows their means over runs. The rows r and v are those of the error's size.",
    "RMS is taken over the time of each run, then averaged over runs.",
    "Intervals are 95 % intervals over runs (Student's, or Hall's of 1992 for skewed samples, whichever reaches "
    "farther), because epochs of one run are correlated and runs are not.",
    "Filters of a campaign share their random numbers. They are compared run by run (sign-flip test), and verdicts and "
    "intervals of differences hold at 95 % for all pairs of a case together (Holm 1979); cases are not adjusted for "
    "each other.",
    "ANEES is the squared error in units of the filter's own covariance, per dimension: 1 for a consistent filter, "
    "more where it is overconfident, less where it is conservative.",
    "Filters that a legend joins, as kf = ekf, have the same numbers in every run, to six digits.",
    "NIS is the squared innovation in units of its own covariance: on average the measurement's dimension.",
    "CPU time is measured while blocks of runs are filtered together; it depends on the machine. Operations and bytes "
    "are those of one epoch of one run by the filter's formula, without what its models compute and with all the "
    "iterations that it may take.",
)
_NO_SUMMARY = "The summary could not be made; the reason stands below."
_WHOLE_SPAN = "The tables over the whole span are in tables/*.csv only, to keep this page small."


def compose(
    results: Results,
    figure_folder: FigureFolder,
    axes: Axes,
    most_figures: int = MOST_FIGURES,
    workers: int = 2,
    shown: Sequence[int] | None = None,
) -> Page:
    """Return the report of an opened result, its figures drawn into a folder.

    Args:
        results: An opened result.
        figure_folder: Where the figures' files go.
        axes: The axes of tables and figures.
        most_figures: How many figures to draw; the first case always gets its own.
        workers: Processes that make the cases of a large campaign.
        shown: Numbers from 0 of the cases to show closely; default: all, of more than `MANY_CASES` the first.
    """
    closely = _closely(results, shown)
    parts = _cases(results, closely, figure_folder, axes, most_figures, workers)
    # Stressed cases have sections of their own; what is said of all cases is said of the others.
    rankings = _rankings(results, {ranking.case.index: ranking for ranking, _ in parts}, axes, workers)
    regret = regret_section(results, figure_folder)
    sections_so_far = [replace(section, pictures=()) for _, section in parts]
    page = _without_pictures(results, rankings, axes, sections_so_far, regret)
    scenario = _scenario(results, rankings, closely, figure_folder)
    page = replace(page, scenario=None if scenario is None else replace(scenario, picture=None))
    left = _LARGEST_HTML - len(html.render(page).encode())
    if scenario is not None and scenario.picture is not None:
        (drawn,), left = within([scenario.picture], left)
        scenario = replace(scenario, picture=drawn)
    top, left = within(overall_pictures(results, rankings, figure_folder), left)
    if regret is not None:
        pictures, left = within(regret.pictures, left)
        regret = replace(regret, pictures=pictures)
    sections = []
    for _, section in parts:
        pictures, left = within(section.pictures, left)
        sections.append(replace(section, pictures=pictures))
    summary = page.summary if regret is None else (*page.summary, *regret.sentences)
    return replace(page, summary=summary, pictures=top, regret=regret, cases=tuple(sections), scenario=scenario)


def _scenario(
    results: Results, rankings: Sequence[Ranking], closely: Sequence[int], figure_folder: FigureFolder
) -> ScenarioSection | None:
    """Return the scenario of the first case that is shown closely and has runs."""
    case = next((ranking.case for ranking in rankings if ranking.case.filters and ranking.case.index in closely), None)
    if case is None:
        return None
    missing: list[str] = []
    told = None
    if results.replay is None:
        told = attempted("The table of what filters are told", partial(told_table, results, case.index), missing)
    said = attempted("The list of limitations", partial(limitations, results), missing) or ()
    return ScenarioSection(scenario_picture(results, case, figure_folder), told, (*said, *missing))


def _closely(results: Results, shown: Sequence[int] | None) -> list[int]:
    """Return the numbers of the cases to show closely."""
    if shown is not None:
        return sorted(set(shown))
    return list(range(len(results.headers)) if len(results.headers) <= MANY_CASES else range(1))


def _rankings(results: Results, known: Mapping[int, Ranking], axes: Axes, workers: int) -> list[Ranking]:
    """Return the rankings of the nominal cases, those that are not known by several processes at once."""
    left = [index for index in results.nominal if index not in known]
    found = dict(known)
    if left:
        parts = [left[first : first + _RANKED_AT_ONCE] for first in range(0, len(left), _RANKED_AT_ONCE)]
        opened = Opened(results)
        made = shared_out(rank_cases, [(opened, part, axes) for part in parts], workers)
        found |= {ranking.case.index: ranking for part in made for ranking in part}
    return [found[index] for index in results.nominal]


def _cases(
    results: Results, closely: Sequence[int], figure_folder: FigureFolder, axes: Axes, most_figures: int, workers: int
) -> list[tuple[Ranking, CaseSection]]:
    drawn: list[bool] = []
    figures_left = most_figures
    for index in closely:
        figures_left -= FIGURES_OF_A_CASE + len(results.headers[index].filters)
        drawn.append(not drawn or (not results.headers[index].stress and figures_left >= 0 and drawn[-1]))
    chart = points_of(len(closely), len(results.filters))
    budgeted = len(closely) <= MOST_BUDGETS
    opened = Opened(results)
    todo = [
        (opened, index, axes, figure_folder, draw_it, *chart, budgeted)
        for index, draw_it in zip(closely, drawn, strict=True)
    ]
    worth_it = len(todo) * len(results.filters) >= _WORTH_A_PROCESS
    return shared_out(compose_case, todo, workers if worth_it else 1)


def _without_pictures(
    results: Results,
    rankings: Sequence[Ranking],
    axes: Axes,
    sections: Sequence[CaseSection],
    regret: RegretSection | None,
) -> Page:
    missing: list[str] = []
    judged = attempted("The judgement of the requirements", partial(judgements, results), missing) or ()
    geometry = attempted("What the geometry explains", partial(campaign_facts.geometry, results), missing)
    summary = attempted("The summary", lambda: (*summarise(rankings), *in_sentences(judged)), missing)
    shared = attempted("The look at the truth's gravity field", partial(campaign_facts.shared_field, results), missing)
    decision = attempted(
        "The decision",
        lambda: _decision(results, rankings, judged, regret, sections, bool(shared)),
        missing,
    )
    version = results.provenance.versions.get("relnav", "")
    finished = campaign_facts.shown_time(results.provenance.finished)
    return Page(
        name=str(results.campaign_content.get("title") or results.campaign_name),
        document=campaign_facts.document_facts(results),
        facts=campaign_facts.headline_facts(results),
        summary=(
            *(geometry or ()),
            *(summary or (_NO_SUMMARY,)),
            *(shared or ()),
            *campaign_facts.leakage(results),
            *_stopped(results),
            *_not_shown(results, sections),
        ),
        all_cases=len(results.headers),
        overview=attempted("The overview", partial(overview_table, rankings), missing),
        requirements=attempted("The table of requirements", partial(requirements_table, results, judged), missing)
        if judged
        else None,
        pictures=(),
        cases=tuple(sections),
        commands=reproduce_commands(results, axes),
        settings=campaign_facts.provenance_facts(results),
        filters=attempted("The table of filters", partial(campaign_facts.filters_table, results), missing),
        all_settings=attempted("The table of settings", partial(campaign_facts.settings_table, results), missing),
        campaign_text=results.campaign_text,
        reading=(*_READING, _WHOLE_SPAN) if any(section.file_tables for section in sections) else _READING,
        footer=f"Written by relnav from {results.path.name}, computed with relnav {version} on {finished}.",
        curves=embedded([section.curves for section in sections], results.filters),
        filter_names=results.filters,
        missing=tuple(missing),
        decision=decision,
    )


def _decision(
    results: Results,
    rankings: Sequence[Ranking],
    judged: Sequence[Judgement],
    regret: RegretSection | None,
    sections: Sequence[CaseSection],
    shared: bool,
) -> DecisionSection | None:
    """Return the decision; None where no case has a run, or the measurements are recorded and one filter read them."""
    decision = decided(results, rankings, judged)
    if decision is None:
        return None
    case_of = {ranking.case.index: ranking.case for ranking in rankings}
    cases = [case_of[case.index] for case, _ in decision.cases]
    budget_case, budget = _budget_of(sections, decision.overall.chosen)
    known = Background(
        labels=dict(zip([case.index for case in cases], short_labels([case.label for case in cases]), strict=True)),
        over=over_in_words(cases),
        judged=tuple(judged),
        under_stress=_under_stress(results, decision.overall.chosen),
        regrets=regret.by_case if regret is not None else {},
        budget=budget,
        budget_case=budget_case,
        waiting=tuple(dict.fromkeys(name for ranking in rankings for name in ranking.case.waiting)),
        shared_field=shared,
        replayed=results.replay is not None,
    )
    return decision_section(decision, known)


def _under_stress(results: Results, chosen: str | None) -> dict[str, tuple[Judgement, ...]]:
    """Return the requirements of the filter chosen under each stress, by the stress and, of several cases, its case."""
    if chosen is None:
        return {}
    several = len(results.nominal) > 1
    return {
        f"{stress}, case {case}" if several else stress: judgements(results, [index], chosen)
        for case in results.nominal
        for stress, index in results.stressed(case).items()
    }


def _budget_of(sections: Sequence[CaseSection], chosen: str | None) -> tuple[int, Table | None]:
    """Return the error budget that a decision cites, of its filter where there is one, with its case; the first."""
    found = [(section.index, table) for section in sections if (table := budget_table(section))]
    own = [each for each in found if chosen is not None and each[1].title == budget_title(chosen)]
    return next(iter((*own, *found)), (0, None))


def _not_shown(results: Results, sections: Sequence[CaseSection]) -> tuple[str, ...]:
    left, count = len(results.headers) - len(sections), len(results.headers)
    if not left:
        return ()
    closely = f"{len(sections)} of {count} cases {'is' if len(sections) == 1 else 'are'} shown closely"
    ask = f"relnav report {shlex.quote(results.path.name)} --case CASE shows others with their tables and figures"
    return (f"{closely}; {ask}. The overview, tables/overview.csv, holds the values of all {count}.",)


def _stopped(results: Results) -> tuple[str, ...]:
    return (f"Stopping rule {stopping_in_words(results.stopping)}.",) if results.stopping else ()
