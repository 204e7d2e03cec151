"""The decision in a report: its sentences, their links, its other forms."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from relnav_sim import report
from relnav_sim.plots.facts import case_facts
from relnav_sim.report.decision import decision_section
from relnav_sim.report.evidence import acceptable_first, decided
from relnav_sim.report.glossary import TERMS, Definitions
from relnav_sim.report.ranking import rank
from relnav_sim.report.requirements import judgements
from relnav_sim.report.reservations import Background
from relnav_sim.report.sentences import plain
from relnav_sim.results import open_results

ResultMaker = Callable[..., Path]
pytestmark = pytest.mark.usefixtures("undrawn", "unrendered")


def _written(path: Path) -> tuple[str, str]:
    page = report.write_report(path, formats=("html", "md"), most_figures=0)
    return page.read_text(encoding="utf-8"), (page.parent / "report.md").read_text(encoding="utf-8")


def _decision(markdown: str) -> str:
    part = markdown.partition("## Decision")[2].partition("<a id=")[0]
    return re.sub(r"\]\(#\w+\)|(?<!\\)\[|\\", "", part)


def test_every_link_of_the_decision_leads_to_a_row_or_table(make_result: ResultMaker) -> None:
    requirements = {"small": {"kind": "rms", "below_m": 1.0}, "failures": {"kind": "failed", "at_most": 0.01}}
    path = make_result(
        labels=("one", "two"), filters={"good": 0.5, "bad": 1.0, "worse": 3.0}, requirements=requirements
    )
    html, markdown = _written(path)
    section = html.partition('id="the-decision"')[2].partition("</section>")[0]
    targets = re.findall(r'href="#([^"]+)"', section)
    assert len(targets) >= 5
    assert all(html.count(f'id="{target}"') == 1 for target in targets)
    linked = re.findall(r"\]\(#([\w-]+)\)", markdown.partition("## Decision")[2].partition("<a id=")[0])
    assert linked and all(f'<a id="{target}"></a>' in markdown for target in linked)


def test_of_long_tables_the_page_has_the_first_rows_and_those_it_cites(
    make_result: ResultMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("relnav_sim.report.page.MOST_ROWS", 4)
    filters = {"bad": 1.0, "worse": 3.0, "good": 0.5}
    path = make_result(labels=("one", "two"), filters=filters, requirements={"small": {"kind": "rms", "below_m": 1.0}})
    page = report.write_report(path, formats=("html", "csv"), most_figures=0)
    html = page.read_text(encoding="utf-8")
    for name in ("overview", "requirements"):
        assert len((page.parent / "tables" / f"{name}.csv").read_text(encoding="utf-8").splitlines()) == 1 + 6
        assert f"of 6 rows; all: tables/{name}.csv." in html
    overview = html.partition('<figure class="table" id="overview">')[2].partition("</tbody>")[0]
    assert overview.count("<tr") == 1 + 4
    targets = re.findall(r'href="#([^"]+)"', html.partition('id="the-decision"')[2].partition("</section>")[0])
    assert any(target.startswith("requirement") for target in targets)
    assert all(html.count(f'id="{target}"') == 1 for target in targets)


def test_the_most_accurate_overconfident_filter_is_refused_and_told_of(make_result: ResultMaker) -> None:
    anees = np.full((12, 2, 3), 9.0)
    path = make_result(filters={"sure": 0.5, "honest": 1.0}, summaries={"sure": {"anees": anees}})
    said = _decision(_written(path)[1])
    assert said.strip().startswith("Fly honest: position RMS")
    assert "sure (overconfident: errors 3.00 times the formal sigma (limit 1.5)); sure has the smallest" in said


def test_equal_filters_make_no_difference_that_matters(make_result: ResultMaker) -> None:
    same = {name: _same_rms() for name in ("a", "b")}
    said = _decision(_written(make_result(filters={"a": 1.0, "b": 1.0}, summaries=same))[1])
    assert "No difference that matters between a and b (within ±1 %): fly any of them." in said
    assert "would decide" not in said


def _same_rms() -> dict[str, np.ndarray]:
    rms = np.random.default_rng(1).uniform(0.5, 1.0, (12, 2, 8))
    return {"rms": rms, "anees": np.ones((12, 2, 3))}


def test_one_run_decides_nothing(make_result: ResultMaker) -> None:
    markdown = _written(make_result(runs=1))[1]
    assert "No decision yet: 1 run in common can't decide between 3 filters" in _decision(markdown)
    table = markdown.partition("What the decision goes by")[2].partition("Over ")[0]
    assert "| reference |" in table and "| chosen |" not in table and "acceptable, chosen" not in table


def test_of_many_filters_that_cannot_be_told_apart_the_most_accurate_are_named(make_result: ResultMaker) -> None:
    filters = {f"f{number}": 1 + number / 1000 for number in range(12, 0, -1)}
    said = _decision(_written(make_result(runs=1, filters=filters))[1])
    sizes = said.partition("between 12 filters (position RMS: ")[2].partition(")")[0]
    assert re.findall(r"f\d+", sizes) == [f"f{number}" for number in range(1, 7)]
    assert sizes.endswith(" and 6 more, none of them smaller")


def test_one_run_of_the_only_filter_decides_nothing(make_result: ResultMaker) -> None:
    said = _decision(_written(make_result(runs=1, filters={"only": 1.0}))[1])
    assert said.strip().startswith("No decision yet: one run decides nothing. only: position RMS")
    assert "Fly" not in said


def test_runs_lost_under_a_stress_are_told_though_the_regret_is_small(make_result: ResultMaker) -> None:
    outside = np.where(np.arange(12) < 7, 0.2, 0.0)
    path = make_result(
        labels=("base", "stress=noisy"),
        stresses=("noisy",),
        filters={"a": 0.5, "b": 1.0},
        requirements={"losses": {"kind": "diverged", "at_most": 0.9}},  # no filter is refused for it
        summaries={name: {"outside_late": outside} for name in "ab"},
        failed={"b": [11]},
    )
    html, markdown = _written(path)
    said = _decision(markdown)
    assert said.strip().startswith("Fly a")
    assert "Under stress a diverged in 7 of 12 runs (noisy)." in said
    assert html.count('id="case_000_stressed_rms"') == 1 and 'href="#case_000_stressed_rms"' in html


def test_the_error_budget_is_of_a_filter_that_may_be_flown(make_result: ResultMaker) -> None:
    path = make_result(filters={"sure": 0.5, "honest": 1.0}, summaries={"sure": {"anees": np.full((12, 2, 3), 9.0)}})
    with open_results(path) as results:
        ranking = rank(case_facts(results, 0, "rtn"))
    assert [standing.name for standing in ranking.standings] == ["sure", "honest"]
    assert acceptable_first(ranking) == ["honest", "sure"]


def test_no_filter_is_recommended_where_all_failed(make_result: ResultMaker) -> None:
    path = make_result(filters={"a": 1.0, "b": 1.2}, failed={"a": range(12), "b": [3]})
    said = _decision(_written(path)[1])
    assert "No filter can be recommended (12 runs): a (failed in 12 of 12 runs), b (failed in 1 of 12 runs)." in said


def test_the_decision_is_told_and_written_for_latex(make_result: ResultMaker) -> None:
    told: list[str] = []
    path = make_result(filters={"good": 0.5, "bad": 1.0})
    report.write_report(path, formats=("latex",), most_figures=0, tell=told.append)
    (lead,) = told
    assert lead.startswith("Fly good: position RMS")
    written = (path.with_suffix("") / "decision.tex").read_text(encoding="utf-8")
    assert written.startswith("\\begin{itemize}\n  \\item Fly good")
    assert "\\ref{tab:decision}" in written


def test_a_term_is_defined_at_its_first_use_only() -> None:
    defined = Definitions()
    first, second = defined("a < b: Formal sigma, formal sigma"), defined("formal sigma again; ANEES")
    assert first.startswith('a &lt; b: <dfn tabindex="0" title=')
    assert first.count("<dfn") == 1
    assert second.count("<dfn") == 1  # of ANEES
    assert TERMS["formal sigma"].partition("'")[0] in first


@pytest.mark.parametrize("change", ["statistics: {matters_percent: 3}", "title: Another", "date: 2026-11-29"])
def test_keys_of_reports_change_no_hash(change: str) -> None:
    from relnav_sim.campaign import parse_campaign

    text = Path("campaigns/demo.yaml").read_text(encoding="utf-8")
    key, _, rest = change.partition(": ")
    changed = (
        text.replace("statistics:\n", f"statistics:\n  {rest[1:-1]}\n") if key == "statistics" else f"{change}\n{text}"
    )
    plain, other = parse_campaign(text), parse_campaign(changed)
    assert plain.content != other.content
    assert plain.hash == other.hash
    assert [case.id for case in plain.cases] == [case.id for case in other.cases]


def _said(path: Path) -> str:
    """Return the decision in words, without a report."""
    with open_results(path) as results:
        judged = judgements(results)
        decision = decided(results, [rank(case_facts(results, 0, "rtn"))], judged)
    assert decision is not None
    section = decision_section(decision, Background({0: "base"}, "the steady state", judged))
    return " ".join(plain(sentence) for sentence in (section.lead, *section.others))


def _anees(whole: float, position: float, velocity: float) -> np.ndarray:
    scatter = np.random.default_rng(1).normal(1.0, 0.02, (12, 2, 1))
    return scatter * [whole, position, velocity]


def test_an_overconfident_position_counts_though_the_whole_state_looks_right(make_result: ResultMaker) -> None:
    hidden = {"ekf": {"anees": _anees(1.0, 1.21, 0.8)}}
    said = _said(make_result(filters={"ekf": 0.5, "ukf": 1.0}, summaries=hidden))
    assert said.startswith("Fly ekf")
    assert "ekf is overconfident: position errors 1.10 times the formal sigma." in said
    far = {"ekf": {"anees": _anees(1.0, 4.0, 0.3)}}
    said = _said(make_result(filters={"ekf": 0.5, "ukf": 1.0}, summaries=far))
    assert said.startswith("Fly ukf")
    assert "ekf (overconfident: position errors 2.00 times the formal sigma (limit 1.5))" in said


def test_a_position_beyond_the_limit_is_refused_though_the_whole_state_is_just_within(make_result: ResultMaker) -> None:
    beyond = {"ekf": {"anees": _anees(1.48**2, 1.53**2, 1.42**2)}}
    said = _said(make_result(filters={"ekf": 0.5, "ukf": 1.0}, summaries=beyond))
    assert said.startswith("Fly ukf")
    assert "ekf (overconfident: position errors 1.53 times the formal sigma (limit 1.5))" in said


def test_what_is_not_surely_below_the_limit_is_any_part_of_the_state(make_result: ResultMaker) -> None:
    """The whole state is surely at 1; the velocity at 1.2, in an interval of 12 runs that reaches beyond 1.5."""
    runs = _anees(1.0, 1.0, 1.0)
    runs[..., 2] = np.repeat([0.1, 2.78], 6)[:, None]
    half = scipy.stats.t.ppf(0.975, 11) * runs[:, 0, 2].std(ddof=1) / np.sqrt(12)
    low, high = np.sqrt(1.44 - half), np.sqrt(1.44 + half)
    assert high > 1.5
    doubtful, sure = (
        _said(make_result(filters={"ekf": 0.5, "ukf": 1.0}, summaries={"ekf": {"anees": each}}))
        for each in (runs, _anees(1.0, 1.0, 1.44))
    )
    assert doubtful.startswith("Fly ekf") and sure.startswith("Fly ekf")
    size = f"velocity error / formal sigma 1.20 [{low:.3g}, {high:.3g}]"
    assert f"that ekf is not overconfident ({size}, limit 1.5)" in doubtful
    assert "is not overconfident" not in sure


def test_the_default_requirement_on_consistency_is_on_each_part(make_result: ResultMaker) -> None:
    hidden = {"ekf": {"anees": _anees(1.0, 1.44, 0.8)}}
    for block, verdict, basis in (("each", "fail", "every epoch; position"), ("full", "pass", "every epoch")):
        rule = {"kind": "nees"} | ({} if block == "each" else {"block": block})
        path = make_result(filters={"ekf": 1.0}, summaries=hidden, requirements={"right": rule})
        with open_results(path) as results:
            (judged,) = judgements(results)
        assert (judged.verdict, judged.basis) == (verdict, basis)


def test_a_requirement_that_was_not_asked_of_a_filter_does_not_make_it_win(make_result: ResultMaker) -> None:
    small = {"kind": "rms", "below_m": 0.1, "filters": ["ekf"]}
    path = make_result(filters={"ekf": 0.5, "ukf": 1.0}, requirements={"b": small})
    said = _said(path)
    assert re.match(r"Fly ukf: position RMS .*; requirement b not asked of it\.", said)
    assert "ekf (misses requirement b)" in said
    path = make_result(filters={"ekf": 1.0, "ukf": 0.5}, requirements={"b": small | {"below_m": 100.0}})
    said = _said(path)
    assert said.startswith("Fly ekf: position RMS")
    assert "Not compared: ukf (requirement b not asked of it)." in said
