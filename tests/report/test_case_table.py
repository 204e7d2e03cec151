"""Tables against numbers worked out by hand from figures per run."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t

from relnav_sim.plots.axes import Axes
from relnav_sim.plots.facts import CaseFacts, case_facts
from relnav_sim.report.layouts import case_table, failures_table
from relnav_sim.report.overview import overview_table
from relnav_sim.report.ranking import rank
from relnav_sim.report.tables import Number, Table, Words
from relnav_sim.results import open_results
from relnav_sim.wording import short_labels

ResultMaker = Callable[..., Path]

MEANS = np.array([[0.1, 0.2, 0.3, 0.01, 0.02, 0.03, 1.0, 0.5], [0.3, 0.4, 0.5, 0.03, 0.04, 0.05, 2.0, 0.7]])


def facts_of(path: Path, axes: Axes = "rtn") -> CaseFacts:
    with open_results(path) as results:
        return case_facts(results, 0, axes)


def row(table: Table, label: str) -> list[Number | Words]:
    return list(next(row for row in table.rows if row.label == label).cells)


def values(table: Table, label: str) -> list[float]:
    return [cell.value for cell in row(table, label) if isinstance(cell, Number)]


@pytest.fixture
def two_runs(make_result: ResultMaker) -> Path:
    """Two runs of one filter whose settled means are MEANS and whose settled standard deviations are 10 times that."""
    spans = np.stack([np.full_like(MEANS, 99.0), MEANS], axis=1)
    summary = {"mean": spans, "std": 10 * spans, "convergence": np.array([18.0, 22.0])}
    return make_result(filters={"ekf": 1.0}, runs=2, summaries={"ekf": summary})


def test_a_table_has_the_rows_of_shi_et_al_table_2(two_runs: Path) -> None:
    table = case_table(facts_of(two_runs), "settled")
    assert [row.label.split(" ")[0] for row in table.rows[:8]] == ["x", "y", "z", "r", "vx", "vy", "vz", "v"]
    assert [row.unit for row in table.rows[:8]] == ["m"] * 4 + ["m/s"] * 4
    assert [column.full_label for column in table.columns] == ["ekf mean", "ekf std"]


def test_figures_are_means_over_runs_of_means_over_time(two_runs: Path) -> None:
    table = case_table(facts_of(two_runs), "settled")
    assert values(table, "x") == pytest.approx([0.2, 2.0])
    assert values(table, "z") == pytest.approx([0.4, 4.0])
    assert values(table, "r = |position|") == pytest.approx([1.5, 15.0])
    assert values(table, "vy") == pytest.approx([0.03, 0.3])
    assert values(table, "v = |velocity|") == pytest.approx([0.6, 6.0])
    assert values(table, "median convergence time") == pytest.approx([20.0])
    assert values(case_table(facts_of(two_runs), "whole"), "x") == pytest.approx([99.0, 990.0])


def test_the_interval_of_two_runs_is_that_of_student(two_runs: Path) -> None:
    """Both runs are positive, and what is never negative has no interval below zero."""
    cell = row(case_table(facts_of(two_runs), "settled"), "x")[0]
    assert isinstance(cell, Number)
    low, high = t.interval(0.95, 1, 0.2, 0.1)
    assert low < 0 and (cell.low, cell.high) == pytest.approx((0.0, high))


def test_shi2025_axes_permute_components_and_turn_signs(two_runs: Path) -> None:
    table = case_table(facts_of(two_runs, "shi2025"), "settled")
    assert values(table, "x") == pytest.approx([0.3, 3.0])  # y of RTN
    assert values(table, "y") == pytest.approx([-0.4, 4.0])  # -z: the mean turns its sign, the std does not
    assert values(table, "z") == pytest.approx([-0.2, 2.0])  # -x
    assert values(table, "vz") == pytest.approx([-0.02, 0.2])
    assert values(table, "r = |position|") == pytest.approx([1.5, 15.0])
    assert "x along-track, y minus orbit normal, z nadir" in table.caption


def test_one_run_has_no_intervals_and_says_so(make_result: ResultMaker) -> None:
    facts = facts_of(make_result(runs=1))
    for table in (case_table(facts, "settled"), overview_table([rank(facts)])):
        numbers = [cell for row in table.rows for cell in row.cells if isinstance(cell, Number)]
        assert numbers and not any(number.has_interval for number in numbers)
        assert "One run only" in table.caption


def test_failed_runs_are_counted_and_left_out(make_result: ResultMaker) -> None:
    facts = facts_of(make_result(runs=10, failed={"ekf": [2, 5]}))
    ekf = facts.filter("ekf")
    table = case_table(facts, "settled")
    good = np.delete(ekf.errors("mean", "settled", "x"), [2, 5])
    assert values(table, "x")[2] == pytest.approx(good.mean(), rel=1e-12)
    cells = row(table, "failed runs")
    assert [cell.text for cell in cells] == ["0 of 10", "2 of 10", "0 of 10"]
    assert "2 failed runs are counted, and left out of every mean." in table.caption
    failures = failures_table(facts)
    assert [row.label for row in failures.rows] == ["run 2", "run 5"]
    reason, command = "the covariance is not positive definite", "relnav run campaigns/invented.yaml --only 0:2 --trace"
    assert [cell.text for cell in failures.rows[0].cells] == ["ekf", "17", reason, command]


def test_a_filter_without_a_completed_run_shows_dashes(make_result: ResultMaker) -> None:
    facts = facts_of(make_result(runs=4, failed={"ekf": range(4)}))
    assert all(math.isnan(value) for value in values(case_table(facts, "settled"), "x")[2:4])
    ranking = rank(facts)
    assert {item.name for item in ranking.standings} == {"kf", "ukf"}
    overview = overview_table([ranking])
    assert "no completed run" in [cell.text for cell in overview.rows[1].cells]


def test_runs_that_never_converge_are_counted(make_result: ResultMaker) -> None:
    convergence = np.array([10.0, np.nan, 30.0, np.nan])
    path = make_result(runs=4, filters={"ekf": 1.0}, summaries={"ekf": {"convergence": convergence}})
    cell = row(case_table(facts_of(path), "settled"), "median convergence time")[0]
    assert isinstance(cell, Number)
    assert cell.shown == "∞" and cell.note == "in 2 of 4 runs"  # the median of 10, 30 and two that never come


def test_a_campaign_that_ends_before_settling_is_reported_over_the_whole_span(make_result: ResultMaker) -> None:
    facts = facts_of(make_result(settle_s=1e6))
    assert facts.span == "whole"
    assert facts.when == "all epochs"
    assert all(math.isfinite(value) for value in values(case_table(facts, facts.span), "x"))


def test_filters_are_compared_run_by_run(make_result: ResultMaker) -> None:
    """A difference far smaller than the spread over runs is decided when every run shows it."""
    rms = np.random.default_rng(5).normal(10, 3, size=(20, 2, 8))
    path = make_result(
        runs=20,
        filters={"a": 1.0, "b": 1.0},
        summaries={"a": {"rms": rms}, "b": {"rms": rms + 0.01}},
    )
    ranking = rank(facts_of(path))
    a, b = ranking.best, ranking.standings[1]
    assert (a.name, b.name) == ("a", "b")
    assert b.position.low < a.position.estimate < b.position.high  # the intervals overlap
    assert b.told_apart
    assert b.percent.estimate == pytest.approx(1.0 / rms[:, 1, 6].mean())


def test_the_overview_has_a_row_per_case_and_filter(make_result: ResultMaker) -> None:
    with open_results(make_result(labels=("a=1", "a=2"), runs=6)) as results:
        rankings = [rank(case_facts(results, index)) for index in range(2)]
    table = overview_table(rankings)
    assert [row.key for row in table.rows] == ["0"] * 3 + ["1"] * 3
    assert [row.cells[0].text for row in table.rows] == ["kf", "ekf", "ukf"] * 2
    verdicts = [row.cells[3] for row in table.rows[:3]]
    assert [cell.mark for cell in verdicts] == ["", "best", ""]
    assert isinstance(verdicts[0], Number)
    assert verdicts[0].value == pytest.approx(100 * (1.0 / 0.6 - 1))


@pytest.mark.parametrize(
    ("labels", "short"),
    [
        (["sensors.radar.noise.kind=a", "sensors.radar.noise.kind=b"], ["noise.kind=a", "noise.kind=b"]),
        (
            ["sensors.radar.range_sigma_m=0.5, truth.chief.orbit.e=1", "clock.step_s=2"],
            ["radar.range_sigma_m=0.5, orbit.e=1", "clock.step_s=2"],
        ),
        (["a.b.c.d=1", "x.b.c.d=1"], ["a.b.c.d=1", "x.b.c.d=1"]),
        (
            ["filters.alpha_0.5.alpha=1", "filters.alpha_0.5.alpha=2"],
            ["filters.alpha_0.5.alpha=1", "filters.alpha_0.5.alpha=2"],
        ),
    ],
)
def test_labels_are_shortened_where_cases_stay_apart(labels: list[str], short: list[str]) -> None:
    assert short_labels(labels) == short
