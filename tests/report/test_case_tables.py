"""The further tables of a case against SciPy and against figures put in by hand."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from relnav_sim.plots.axes import Axes
from relnav_sim.plots.facts import CaseFacts, case_facts
from relnav_sim.report.case_tables import (
    case_table_makers,
    consistency_table,
    convergence_table,
    reliability_table,
    spread_table,
)
from relnav_sim.report.comparison_table import comparison_table
from relnav_sim.report.layouts import case_table, reading_notes, worst_runs_table
from relnav_sim.report.metrics import NIS, nis_ratio
from relnav_sim.report.overview import overview_table
from relnav_sim.report.ranking import rank
from relnav_sim.report.summary import summarise
from relnav_sim.report.tables import Number, Table, comma_separated
from relnav_sim.report.write import write_report
from relnav_sim.results import open_results
from relnav_sim.statistics.intervals import mean_interval, paired_differences
from relnav_sim.wording import MISSING

ResultMaker = Callable[..., Path]
RUNS = 20


def facts_of(path: Path, axes: Axes = "rtn") -> CaseFacts:
    with open_results(path) as results:
        return case_facts(results, 0, axes)


def cells(table: Table, label: str) -> list[Any]:
    return list(next(row for row in table.rows if row.label == label).cells)


def with_p_value(p: float, rng: np.random.Generator) -> np.ndarray:
    """Return differences whose Student's t test of a mean of zero has this p-value."""
    half = rng.normal(size=RUNS // 2)
    noise = np.concatenate([half, -half])
    noise /= noise.std(ddof=1)
    return noise + stats.t.isf(p / 2, RUNS - 1) / math.sqrt(RUNS)


def test_a_difference_decided_alone_is_not_among_several() -> None:
    rng = np.random.default_rng(0)
    alone = paired_differences({"one": with_p_value(0.03, rng)})["one"]
    assert alone.verdict == "worse" and alone.p_value == pytest.approx(0.03, rel=0.4)
    three = paired_differences({n: with_p_value(0.03, rng) for n in range(3)})
    assert {item.verdict for item in three.values()} == {"undecided"}
    assert min(item.p_value for item in three.values()) == pytest.approx(0.09, rel=0.4)
    after_two = paired_differences({n: with_p_value(p, rng) for n, p in enumerate((1e-5, 1e-5, 0.03))})
    assert {item.verdict for item in after_two.values()} == {"worse"}
    level, ratio = 0.05 / 3, stats.t.isf(0.015, RUNS - 1) / math.sqrt(RUNS)
    needed = math.ceil(((stats.norm.isf(level / 2) + stats.norm.ppf(0.8)) / ratio) ** 2)
    assert [item.runs_to_decide for item in three.values()] == [needed] * 3


def test_every_pair_once(make_result: ResultMaker) -> None:
    ranking = rank(facts_of(make_result(runs=RUNS)))
    table = comparison_table(ranking)
    assert [row.label for row in table.rows] == ["ukf against ekf", "kf against ekf", "kf against ukf"]
    assert [row.cells[2].text for row in table.rows] == ["worse"] * 3
    assert [row.cells[7].text for row in table.rows] == ["worse"] * 3


def test_the_number_of_runs_that_would_decide(make_result: ResultMaker) -> None:
    noise = np.random.default_rng(2).normal(size=RUNS)
    noise = (noise - noise.mean()) / noise.std(ddof=1)
    rms = np.full((RUNS, 2, 8), 10.0)
    summaries = {"a": {"rms": rms}, "b": {"rms": rms + (noise + 0.1)[:, None, None]}}
    path = make_result(filters={"a": 1.0, "b": 1.0}, runs=RUNS, summaries=summaries)
    (pair,) = rank(facts_of(path)).position
    expected = ((stats.norm.ppf(0.975) + stats.norm.ppf(0.8)) / 0.1) ** 2
    assert pair.comparison.verdict == "undecided" and pair.comparison.runs_to_decide == math.ceil(expected)
    assert comparison_table(rank(facts_of(path))).rows[0].cells[4].text == "about 780 runs"


def test_consistency_and_its_bands(make_result: ResultMaker) -> None:
    summary = {
        "coverage": np.full((RUNS, 2, 3, 5), 0.91),
        "nis_lag1": np.linspace(-0.1, 0.1, RUNS)[:, None] * np.ones(2),
        "updates": np.full((RUNS, 2), 50),
    }
    table = consistency_table(facts_of(make_result(runs=RUNS, filters={"ekf": 1.0}, summaries={"ekf": summary})))
    (inside,) = cells(table, "inside the 95 % ellipsoid, velocity")
    assert inside.value == pytest.approx(91.0)
    bands = [row.cells[0].text for row in table.rows if row.label.startswith("95 % band")]
    low, high = stats.chi2.ppf([0.025, 0.975], 3 * 50 * RUNS) / (50 * RUNS)
    assert bands[1] == f"[{low:.3f}, {high:.3f}]"
    assert bands[2] == f"[\N{MINUS SIGN}{1.959964 / math.sqrt(50 * RUNS):.5f}, {1.959964 / math.sqrt(50 * RUNS):.5f}]"
    anees_low, anees_high = (float(end) for end in bands[0].strip("[]").split(","))
    assert 0.8 < anees_low < 1 < anees_high < 1.2


def test_convergence_counts_runs_that_never_do(make_result: ResultMaker) -> None:
    times = np.array([10.0, 20.0, np.nan, 40.0, 50.0, np.nan, 70.0])
    levels = np.full((7, 7), np.nan)
    levels[:3, 2] = 5.0
    path = make_result(
        runs=7, filters={"ekf": 1.0}, summaries={"ekf": {"convergence": times, "convergence_level": levels}}
    )
    table = convergence_table(facts_of(path))
    (median,) = cells(table, "below 10 m for 50 s")
    assert median.value == 50 and (median.low, median.high) == (10, math.inf)
    rate = next(row.cells[0] for row in table.rows if row.label.endswith("reached by"))
    assert rate.value == pytest.approx(500 / 7) and rate.note == "(5 of 7)"
    theirs = stats.binomtest(5, 7).proportion_ci(method="wilson")
    assert (rate.low, rate.high) == pytest.approx((100 * theirs.low, 100 * theirs.high))
    (never,) = cells(table, "below 5 m for 50 s")
    assert never.shown == "∞"


def test_spread_and_the_largest_of_all(make_result: ResultMaker) -> None:
    largest = np.arange(1.0, RUNS + 1)
    summary = {"max": np.tile(largest[:, None, None], (1, 2, 8)), "quantile": np.full((RUNS, 2, 2, 4), 0.5)}
    table = spread_table(facts_of(make_result(runs=RUNS, filters={"ekf": 1.0}, summaries={"ekf": summary})))
    assert cells(table, "|position|, largest")[0].value == largest.mean()
    assert cells(table, "|velocity|, largest of all runs")[0].value == RUNS
    assert cells(table, "|position|, 99.7 % quantile")[0].value == 0.5


def test_reliability_and_diagnostics(make_result: ResultMaker) -> None:
    outside = np.where(np.arange(RUNS) == 7, 0.5, 0.01)
    path = make_result(
        runs=RUNS,
        filters={"ekf": 1.0, "pf": 1.0},
        failed={"ekf": [3]},
        summaries={"ekf": {"outside_late": outside}},
        diagnostics={"pf": {"ess": np.linspace(50, 100, RUNS)}},
    )
    table = reliability_table(facts_of(path))
    assert [cell.note for cell in cells(table, "failed")] == [f"(1 of {RUNS})", f"(0 of {RUNS})"]
    assert [cell.note for cell in cells(table, "diverged, failures included")] == [f"(2 of {RUNS})", f"(0 of {RUNS})"]
    absent, ess = cells(table, "effective sample size")
    assert math.isnan(absent.value) and ess.value == 75


def test_worst_runs_and_how_to_see_them(make_result: ResultMaker) -> None:
    rms = np.ones((RUNS, 2, 8))
    rms[4], rms[11] = 9.0, 5.0
    path = make_result(runs=RUNS, filters={"ekf": 1.0}, summaries={"ekf": {"rms": rms}})
    table = worst_runs_table(facts_of(path))
    assert [row.label for row in table.rows] == ["run 4", "run 11"]
    assert table.rows[0].cells[0].text == "ekf 9.00 m, 9.0 times its median"
    assert table.rows[0].cells[1].text == "relnav run campaigns/invented.yaml --only 0:4 --trace"


def test_where_no_run_was_completed(make_result: ResultMaker) -> None:
    facts = facts_of(make_result(runs=8, filters={"ekf": 1.0}, failed={"ekf": range(8)}))
    assert "No run was completed: there are no values." in reading_notes([facts])
    tables = [make() for make in case_table_makers(rank(facts)).values()]
    for table in (*filter(None, tables), case_table(facts, "settled")):
        assert all(not cell.has_interval or "of 8" in cell.note for row in table.rows for cell in row.cells
                   if isinstance(cell, Number))  # fmt: skip


def test_a_case_is_named_once_in_the_overview_and_always_in_csv(make_result: ResultMaker) -> None:
    with open_results(make_result(labels=("a=1", "a=2"), runs=6)) as results:
        table = overview_table([rank(case_facts(results, index)) for index in range(2)])
    assert [row.label for row in table.rows] == ["0: a=1", "0", "0", "1: a=2", "1", "1"]
    headings = [line.split(",")[0] for line in comma_separated(table).splitlines()[1:]]
    assert headings == ["0: a=1"] * 3 + ["1: a=2"] * 3


@pytest.mark.usefixtures("unrendered")
def test_the_stopping_rule_is_in_the_report(make_result: ResultMaker) -> None:
    rule = {
        "metric": "settled_r_rms_m", "filter": None, "half_width": 0.05, "at": [6, 12], "level": 0.95,
        "reached": 6, "met": True, "widest": 0.0412,
    }  # fmt: skip
    path = make_result(runs=6, filters={"ekf": 1.0}, stopping=rule)
    text = write_report(path, formats=["md"], most_figures=0).read_text(encoding="utf-8")
    assert "Stopping rule met at 6 runs: half width of the 95 % interval of settled" in text
    assert "every filter 0.0412, wanted 0.05; looked at 6, 12 runs." in text


def with_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give every case a bound of a root mean square of 0.5 m for t >= 500 s, and that of every filter's model 1 m."""
    bound = np.full((61, 8), 99.0)
    bound[5:, 6] = np.where(np.arange(56) % 2, 0.1, 0.7)
    own = np.full((61, 8), 1.0)
    monkeypatch.setattr(
        "relnav_sim.results.read.Results.bound", lambda self, case, filter=None: own if filter else bound
    )


def test_how_far_from_the_bound(make_result: ResultMaker, monkeypatch: pytest.MonkeyPatch) -> None:
    path = make_result(runs=6, filters={"ekf": 1.0}, failed={"ekf": [2]})
    assert "position RMS / bound" not in [column.label for column in overview_table([rank(facts_of(path))]).columns]
    with_bound(monkeypatch)
    with open_results(path) as results:
        square = float(np.square(results.error(0, "ekf")[[0, 1, 3, 4, 5], 5:, :3]).sum(axis=-1).mean())
    ranking = rank(facts_of(path))
    table = overview_table([ranking])
    place = [column.label for column in table.columns].index("position RMS / bound")
    cell = table.rows[0].cells[place]
    assert isinstance(cell, Number) and cell.value == pytest.approx(math.sqrt(square) / 0.5, rel=1e-6)
    assert any(sentence.startswith("Limit: the best filter's position RMS is") for sentence in summarise([ranking]))
    consistency = consistency_table(ranking.case)
    assert cells(consistency, "position RMS / bound, perfect model")[0].value == pytest.approx(cell.value)
    assert cells(consistency, "position RMS / bound, own model")[0].value == pytest.approx(cell.value / 2)


@pytest.mark.parametrize(("lost", "number"), [(2, True), (6, False), (12, False)])
def test_the_ratio_of_diverged_runs_never_looks_good(
    make_result: ResultMaker, monkeypatch: pytest.MonkeyPatch, lost: int, number: bool
) -> None:
    with_bound(monkeypatch)
    outside = np.where(np.arange(12) < lost, 0.2, 0.0)
    path = make_result(runs=12, filters={"ekf": 1.0}, summaries={"ekf": {"outside_late": outside}})
    ranking = rank(facts_of(path))
    note = f"diverged in {lost} of 12 runs"
    (cell,) = cells(consistency_table(ranking.case), "position RMS / bound, perfect model")
    assert isinstance(cell, Number) == number and note in cell.text and cell.mark == "failed"
    (said,) = [sentence for sentence in summarise([ranking]) if sentence.startswith("Limit")]
    assert note in said and ("times the" in said) == number
    assert note in summarise([ranking])[0]


def test_convergence_that_no_run_is_long_enough_for(make_result: ResultMaker) -> None:
    never = {"convergence": np.full(8, np.nan), "convergence_level": np.full((8, 7), np.nan)}
    path = make_result(
        runs=8,
        filters={"ekf": 1.0},
        summaries={"ekf": never},
        variables=[{"statistics.convergence_hold_s": 6000.0}],
    )
    ranking = rank(facts_of(path))
    assert cells(convergence_table(ranking.case), "below 10 m for 6000 s")[0].text == "cannot be judged"
    assert "cannot be judged" in [cell.text for cell in overview_table([ranking]).rows[0].cells]
    sentences = summarise([ranking])
    assert not any("No run reached" in sentence for sentence in sentences)
    assert sum(sentence.startswith("Convergence cannot be judged") for sentence in sentences) == 1


def test_a_filter_with_mixture_noise_has_no_chi_square_band(make_result: ResultMaker) -> None:
    updates = {"updates": np.full((RUNS, 2), 50)}
    names = {"imm": 1.0, "ekf": 1.0}
    case = facts_of(make_result(runs=RUNS, filters=names, summaries=dict.fromkeys(names, updates)))
    told = replace(case, filters=(replace(case.filters[0], mixture_sensors=("radar",)), *case.filters[1:]))
    rows = [row for row in consistency_table(told).rows if row.label == "95 % band if consistent"]
    assert [cell.text == MISSING for cell in rows[1].cells] == [True] + [False] * (len(case.filters) - 1)
    assert f"{case.filters[0].name}: the noise is a mixture" in consistency_table(told).caption
    assert "mixture" not in consistency_table(case).caption


def test_its_nis_has_the_interval_of_the_bootstrap(make_result: ResultMaker) -> None:
    """BCa of SciPy on the same runs: both have their own resamples, 2000 and 9999 of them."""
    values = np.random.default_rng(3).gamma(2.0, 1.5, RUNS)
    summary = {"nis_mean": np.stack([values] * 2, axis=1), "updates": np.full((RUNS, 2), 50)}
    case = facts_of(make_result(runs=RUNS, filters={"imm": 1.0}, summaries={"imm": summary}))
    item = replace(case.filters[0], mixture_sensors=("radar",))
    found = NIS.value(item, case.span)
    expected = stats.bootstrap((values,), np.mean, method="BCa", rng=1).confidence_interval
    spread = expected.high - expected.low
    assert found.estimate == pytest.approx(values.mean())
    assert (found.low, found.high) == pytest.approx((expected.low, expected.high), abs=0.06 * spread)
    assert NIS.value(case.filters[0], case.span) == mean_interval(values)
    ratio = nis_ratio(3 * 50 * values, np.full(RUNS, 150), chi_square=False)
    assert (ratio.low, ratio.high) == pytest.approx((found.low, found.high))
