"""What the decision's sentences say, on invented evidence whose decision is known."""

from __future__ import annotations

import numpy as np

from relnav_sim.campaign.requirements import RmsRequirement
from relnav_sim.report.decision import decision_section
from relnav_sim.report.reservations import Background
from relnav_sim.report.sentences import plain
from relnav_sim.report.tables import Column, Row, Table, Words
from relnav_sim.statistics.decision import Candidate, CaseEvidence, decide
from relnav_sim.statistics.equivalence import Difference
from relnav_sim.statistics.findings import Finding, Verdict
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.regret import Regret
from relnav_sim.statistics.requirements import Judgement

RUNS = 20


def _exactly(value: float) -> Interval:
    return Interval(value, value, value, 0.95, RUNS)


def _case(index: int, diverged: str = "", **sizes: float) -> CaseEvidence:
    candidates = tuple(
        Candidate(name, _exactly(size), _exactly(size), RUNS, 0, 3 * (name in diverged), {"full": _exactly(1.0)})
        for name, size in sizes.items()
    )
    (a, first), (b, second) = sizes.items()
    percent = _exactly(100 * (first / second - 1))
    return CaseEvidence(
        index, candidates, {(a, b): Difference(percent, "worse" if first > second else "better", percent)}
    )


def _said(cases: list[CaseEvidence], **known: object) -> list[str]:
    background = Background({case.index: f"name{case.index}" for case in cases}, "the run", **known)  # type: ignore[arg-type]
    section = decision_section(decide(cases, 1.0), background)
    return [plain(section.lead), *map(plain, section.others)]


def test_where_no_filter_fits_all_cases_each_is_named_with_its_choice() -> None:
    said = _said([_case(0, "a", a=1.0, b=2.0), _case(1, "b", a=1.0, b=2.0), _case(2, "ab", a=1.0, b=2.0)])
    assert said[0] == (
        "No filter can be recommended for all cases (3 cases of 20 runs): "
        "a and b (diverged in 6 of 60 runs, in 2 of 3 cases)."
    )
    assert said[1] == (
        "Case by case: case 0 (name0) b 2.00 m; case 1 (name1) a 1.00 m; case 2 (name2) no acceptable filter."
    )


def test_where_no_case_has_an_acceptable_filter_the_lead_says_so() -> None:
    said = _said([_case(0, "ab", a=1.0, b=2.0), _case(1, "ab", a=1.0, b=2.0)])
    assert said[0].startswith("No filter can be recommended in any case (2 cases of 20 runs): a and b (diverged in 6")
    assert not any(line.startswith("Case by case") for line in said)


def test_many_cases_are_grouped_by_their_choice_the_first_of_each_named() -> None:
    cases = [_case(n, "a" if n < 10 else "b" if n < 58 else "ab", a=1.0, b=2.0) for n in range(60)]
    said = _said(cases)
    assert said[1] == (
        "Case by case, of 60 cases: a in 48 (10: name10; 11: name11; 12: name12 and 45 more); "
        "b in 10 (0: name0; 1: name1; 2: name2 and 7 more); no acceptable filter in 2 (58: name58; 59: name59)."
    )


def test_a_reason_of_one_case_names_it() -> None:
    said = _said([_case(0, a=1.0, b=2.0), _case(1, "b", a=1.0, b=2.0)])
    assert said[0].startswith("Fly a: position RMS 1.00 m over 2 cases of 20 runs")
    assert "Not recommended: b (diverged in 3 of 40 runs, case 1: name1)." in said


def test_the_smallest_margin_of_a_requirement_names_its_case() -> None:
    wanted = RmsRequirement(kind="rms", below_m=4.0)
    judged = tuple(
        Judgement("small", wanted, index, "a", Finding(Interval(size, size, size, 0.95, RUNS), "pass", 1.0, None), "")
        for index, size in enumerate((1.0, 3.0))
    )
    said = _said([_case(0, a=1.0, b=2.0), _case(1, a=3.0, b=6.0)], judged=judged)
    assert "requirement small met in every case (smallest margin 25 % of the limit, case 1: name1)" in said[0]
    alone = _said([_case(0, a=1.0, b=2.0)], judged=judged[:1])
    assert "over 20 runs" in alone[0] and "requirement small met (margin 75 % of the limit)" in alone[0]


def test_the_lead_names_the_requirement_that_sets_filters_aside() -> None:
    judged = [_judged("small", name, "pass" if name == "a" else "undecided") for name in "abc"]
    judged += [_judged("rare", name, "undecided" if name == "c" else "pass") for name in "abc"]
    candidates = tuple(
        Candidate(
            name, _exactly(1.0), _exactly(1.0), RUNS, 0, 0, {"full": _exactly(1.0)},
            verdicts={one.name: one.verdict for one in judged if one.filter == name},
        )
        for name in "abc"
    )  # fmt: skip
    said = _said([CaseEvidence(0, candidates, {})], judged=tuple(judged))
    assert "requirement small met (margin 75 % of the limit), undecided for b and c" in said[0]
    assert said[0].endswith("requirement rare met (margin 75 % of the limit), undecided for c.")
    assert "Not compared: b (requirement small undecided), c (requirements small and rare undecided)." in said


def test_requirements_missed_under_stress_are_named_and_judged_without_it() -> None:
    stressed = {"dark": (_judged("small", "a", "fail"),), "late": (_judged("small", "a", "undecided"),)}
    said = _said([_case(0, a=1.0, b=2.0)], judged=(_judged("small", "a", "pass"),), under_stress=stressed)
    assert (
        "Requirements are judged without stress. Under stress a misses small (dark: 1.00 m [1.00, 1.00]), and is "
        "undecided for small (late: 1.00 m [1.00, 1.00])." in said
    )
    kept = {"dark": (_judged("small", "a", "pass"),)}
    said = _said([_case(0, a=1.0, b=2.0)], under_stress=kept)
    assert "Requirements are judged without stress. Under stress a meets all that are asked of it." in said


def _judged(name: str, filter: str, verdict: Verdict) -> Judgement:
    wanted = RmsRequirement(kind="rms", below_m=4.0)
    return Judgement(name, wanted, 0, filter, Finding(_exactly(1.0), verdict, 1.0, None), "")


def _regret(*rows: tuple[float, ...]) -> Regret:
    size = np.array(rows)
    none = np.zeros(size.shape, dtype=np.int64)
    cases = ("nominal", "noisy")
    ends = (size, size, size, none, none, none[0])
    return Regret(("a", "b"), cases, (0, 1), size + 1, *ends, np.arange(RUNS), "r", "whole")


def test_no_regret_is_said_to_be_none_and_a_regret_names_its_stress() -> None:
    best = _said([_case(0, a=1.0, b=2.0)], regrets={0: _regret((0, 0), (1, 1))})
    assert "Without regret under stress: a has the smallest position RMS of all filters under noisy." in best
    worse = _said([_case(0, a=1.0, b=2.0)], regrets={0: _regret((0, 0.5), (1, 0))})
    assert any(line.startswith("Worst regret of a under stress: 50 % [50.0, 50.0] (noisy)") for line in worse)


def test_the_error_budget_names_its_case_where_there_are_several() -> None:
    columns = (Column("halved", numeric=False), Column("per unit", numeric=False))
    rows = (Row("range", (Words("20 %"), Words(""))), Row("angle", (Words("5 %"), Words(""))))
    budget = Table("case_001_budget", "Error budget of a", "", "source", columns, rows)
    cases = [_case(0, a=1.0, b=2.0), _case(1, a=1.0, b=2.0)]
    wanted = "What would help most: range, 20 % less position error if halved (error budget of a"
    assert f"{wanted}, case 1: name1)." in _said(cases, budget=budget, budget_case=1)
    assert f"{wanted})." in _said(cases[:1], budget=budget)
    # Of a filter that diverges the budget would name the wrong source.
    diverging = _said([_case(0, "ab", a=1.0, b=2.0)], budget=budget)
    assert not any(line.startswith(wanted) for line in diverging)
    assert any(
        line.startswith("What would help most is not told: a is refused for another reason") for line in diverging
    )


def _one_case(sizes: dict[str, float], half_percent: float) -> CaseEvidence:
    """Return filters in the order of their size, whose differences are all known to ± a half width."""
    candidates = tuple(
        Candidate(name, _exactly(size), _exactly(size), RUNS, 0, 0, {"full": _exactly(1.0)})
        for name, size in sizes.items()
    )
    names = list(sizes)
    differences = {}
    for place, first in enumerate(names):
        for second in names[:place]:
            size = 100 * (sizes[first] / sizes[second] - 1)
            percent = Interval(size, size - half_percent, size + half_percent, 0.95, RUNS)
            differences[first, second] = Difference(percent, "worse" if percent.low > 0 else "undecided", percent)
    return CaseEvidence(0, candidates, differences)


def test_only_the_next_filter_is_a_runner_up_and_what_runs_would_decide_is_said() -> None:
    # 20 (10 / 5)^2 = 80 runs shrink ±10 % to the 5 % by which b, the nearer of the two, lies above a.
    said = _said([_one_case({"a": 1.0, "b": 1.05, "c": 1.051, "d": 2.5}, 10.0)])
    assert "Surely worse: d loses 150 % [140, 160]." in said
    assert said[2].startswith("Undecided at 20 runs: b ")
    assert said[2].endswith("; about 80 runs would tell each from a, or show each within ±1 % of it.")
    said = _said([_one_case({"a": 1.0, "d": 2.5, "e": 3.0}, 10.0)])
    assert "Runner-up d loses 150 % [140, 160], e loses 200 % [190, 210]." in said
