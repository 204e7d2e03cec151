"""Rows that are known only later are told from filters to fly."""

from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from relnav_sim.cli.app import app
from relnav_sim.plots.data import leading_filter
from relnav_sim.plots.facts import case_facts
from relnav_sim.report import figure
from relnav_sim.report.ranking import rank
from relnav_sim.report.summary import summarise
from relnav_sim.results import open_results
from relnav_sim.results.afterwards import known_when

RTS = {"filters.rts.smoother": "rts"}


def ranking_of(path):
    with open_results(path) as results:
        return rank(case_facts(results, 0))


def test_they_are_compared_with_no_filter_in_flight(make_result):
    later = {"filters.rts.smoother": "rts", "filters.lag.smoother": {"fixed_lag": {"lag_s": 60}}}
    sizes = {"kf": 1.0, "rts": 0.2, "lag": 0.4, "ekf": 0.5}
    ranking = ranking_of(make_result(filters=sizes, runs=10, variables=[later]))
    assert [item.name for item in ranking.ranked] == ["ekf", "kf"]
    assert [item.name for item in ranking.known_later] == ["rts", "lag"]
    assert {pair.first for pair in ranking.position} == {"kf"}
    sentences = summarise([ranking])
    assert sentences[0].startswith("ekf has the smallest position error")
    (said,) = (each for each in sentences if each.startswith("Known only later"))
    assert "no filter to fly: position RMS of rts (after the run) 0.1" in said and "lag (60 s later) 0.2" in said


def test_they_are_not_on_the_front_of_cost_and_accuracy(make_result):
    with open_results(make_result(filters={"kf": 1.0, "ekf": 0.5, "rts": 0.2}, runs=10, variables=[RTS])) as results:
        panel = figure(results, "cost").axes[0]
        (smoothed,) = (item.mean_rms("settled") for item in case_facts(results, 0).filters if item.name == "rts")
    drawn = [np.asarray(line.get_ydata()) for line in panel.lines]
    assert any(np.isclose(line, smoothed).any() for line in drawn if len(line) == 1)  # its own marker
    fronts = [line for line in drawn if len(line) > 1 and not np.isclose(line, line[0]).all()]
    assert not any(np.isclose(line, smoothed).any() for line in fronts)


def test_none_of_them_is_the_filter_that_figures_are_drawn_of(make_result):
    """Nor the best one of a cell of a heat map: that is the one the ranking names."""
    with open_results(make_result(filters={"kf": 1.0, "ekf": 0.5, "rts": 0.2}, runs=10, variables=[RTS])) as results:
        facts = case_facts(results, 0)
    assert leading_filter(facts) == rank(facts).best.name == "ekf"


def test_without_one_in_flight_they_are_compared_with_one_another(make_result):
    later = {"filters.a.smoother": "rts", "filters.b.smoother": "rts"}
    ranking = ranking_of(make_result(filters={"a": 1.0, "b": 0.5}, runs=10, variables=[later]))
    assert [item.name for item in ranking.ranked] == ["b", "a"] and not ranking.known_later


@pytest.mark.parametrize("form", ["text", "md", "csv", "latex"])
def test_a_comparison_with_one_in_flight_says_so_first(make_result, form):
    path = make_result(filters={"kf": 1.0, "ekf": 0.5, "rts": 0.2}, runs=5, variables=[RTS])
    found = CliRunner().invoke(app, ["compare", f"{path}:kf", f"{path}:rts", "--format", form])
    assert found.exit_code == 0 and " ".join(found.stderr.split()).startswith(
        "kf is known in flight, rts is known after the run: a row that is known later"
    )
    stdout = " ".join(found.stdout.split())
    assert "kf against rts (known after the run)" in stdout or form == "text"
    assert "kf is known in flight, rts is known after the run" in stdout or form == "csv"
    both = CliRunner().invoke(app, ["compare", f"{path}:kf", f"{path}:ekf", "--format", form])
    assert both.exit_code == 0 and "known" not in both.output


@pytest.mark.parametrize(
    "entry, variables, said",
    [
        ({"kind": "ekf"}, {}, ""),
        ({"kind": "ekf", "smoother": "rts"}, {}, "after the run"),
        ({"kind": "ekf", "smoother": {"fixed_lag": {"lag_s": 60.0}}}, {}, "60 s later"),
        ({"kind": "ekf", "smoother": "rts"}, {"filters.f.smoother": None}, ""),
        ({"kind": "ekf"}, {"filters.f": {"kind": "ekf", "smoother": "rts"}}, "after the run"),
        ({"kind": "ekf", "smoother": {"fixed_lag": {}}}, {"filters.f.smoother.fixed_lag.lag_s": 30}, "30 s later"),
        ({"kind": "batch_least_squares"}, {}, "after the run"),
        ({"kind": "ekf"}, {"filters.f.kind": "batch_least_squares"}, "after the run"),
        ({"kind": "gone"}, {}, ""),
    ],
)
def test_it_is_read_off_the_campaign(entry, variables, said):
    results = SimpleNamespace(
        campaign_content={"filters": {"f": entry}}, headers=[SimpleNamespace(stress="", variables=variables)]
    )
    assert known_when(results, 0, "f") == said
