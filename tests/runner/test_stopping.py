"""Adaptive stopping: at fixed looks, in run order, whatever the workers; the result tells rule and outcome."""

import numpy as np
import pytest
from scipy import stats
from small_campaign import assert_same_bits

from relnav_sim import open_results, run_campaign
from relnav_sim.campaign import CampaignError
from relnav_sim.campaign.models import StopOptions
from relnav_sim.results import layout
from relnav_sim.results.block import RefusedError
from relnav_sim.runner.stopping import half_width

RULE = "stop={{metric: r_rms_m, half_width: {}, at: [4, 6, 9]}}"


def widest(out, runs, names=("kf", "ekf")):
    """The widest half width by SciPy's own interval."""
    widths = []
    with open_results(out) as results:
        for case in range(2):
            for name in names:
                rms = results.statistic(case, name, "rms")[:runs, 0, layout.QUANTITIES.index("r")]
                low, high = stats.t.interval(0.95, len(rms) - 1, rms.mean(), stats.sem(rms))
                widths.append((high - low) / 2)
    return max(widths)


@pytest.fixture(scope="module")
def all_runs(tmp_path_factory, make_campaign):
    return run_campaign(
        make_campaign("runs=12", "bound=false"), tmp_path_factory.mktemp("all") / "all.h5", backend="sequential"
    )


def test_half_width_is_students():
    sample = np.random.default_rng(1).normal(3, 2, 20)
    low, high = stats.t.interval(0.95, 19, sample.mean(), stats.sem(sample))
    figures = dict(enumerate(sample.tolist())) | {99: float("nan")}
    assert half_width(figures) == pytest.approx((high - low) / 2, rel=1e-12)
    assert half_width({0: 1.0}) == half_width({}) == np.inf


@pytest.mark.parametrize("look", [pytest.param(4, marks=pytest.mark.slow), 6, pytest.param(9, marks=pytest.mark.slow)])
def test_stops_at_the_first_look_that_meets_the_rule(campaign, tmp_path, all_runs, look):
    limit = widest(all_runs, look) * 1.0001
    expected = next(n for n in (4, 6, 9, 12) if widest(all_runs, n) <= limit)
    said = []
    parsed = campaign("runs=12", "bound=false", RULE.format(limit))
    out = run_campaign(parsed, tmp_path / "a.h5", backend="sequential", say=said.append)
    with open_results(out) as results:
        assert results.planned_runs == expected and results.missing() == {}
        assert results.runs == tuple(range(expected))
        assert results.stopping["reached"] == expected and results.stopping["met"]
        assert results.stopping["widest"] == pytest.approx(widest(all_runs, expected), rel=1e-9)
        assert results.stopping["at"] == [4, 6, 9]
    assert any(f"stopped at {expected} runs" in sentence for sentence in said)


@pytest.mark.parametrize("look", [pytest.param(4, marks=pytest.mark.slow), 6, pytest.param(9, marks=pytest.mark.slow)])
@pytest.mark.slow
def test_workers_stop_where_one_process_does(campaign, tmp_path, all_runs, look):
    parsed = campaign("runs=12", "bound=false", RULE.format(widest(all_runs, look) * 1.0001))
    alone = run_campaign(parsed, tmp_path / "a.h5", backend="sequential")
    assert_same_bits(alone, run_campaign(parsed, tmp_path / "b.h5", workers=2))


def test_goes_on_to_all_runs_where_the_rule_is_never_met(campaign, tmp_path, all_runs):
    out = run_campaign(campaign("runs=12", "bound=false", RULE.format(1e-6)), tmp_path / "a.h5", backend="sequential")
    assert_same_bits(out, all_runs)
    with open_results(out) as results:
        assert (results.stopping["reached"], results.stopping["met"]) == (12, False)


def test_the_rule_may_change_and_more_runs_on_disk_do_not_show(campaign, tmp_path):
    out = tmp_path / "a.h5"
    run_campaign(campaign("runs=12", "bound=false"), out, backend="sequential")
    run_campaign(campaign("runs=12", "bound=false", RULE.format(1e6)), out, backend="sequential")
    with open_results(out) as results:
        assert results.runs == (0, 1, 2, 3)
    said = []
    run_campaign(campaign("runs=12", "bound=false"), out, backend="sequential", say=said.append)
    assert "every run was finished already" in said
    with open_results(out) as results:
        assert len(results.runs) == 12 and results.stopping == {}


def test_one_filter_only(campaign, tmp_path, all_runs):
    limit = widest(all_runs, 6, ["ekf"]) * 1.0001
    expected = next(n for n in (4, 6, 9, 12) if widest(all_runs, n, ["ekf"]) <= limit)
    rule = f"stop={{metric: r_rms_m, filter: ekf, half_width: {limit}, at: [4, 6, 9]}}"
    out = run_campaign(campaign("runs=12", "bound=false", rule), tmp_path / "a.h5", backend="sequential")
    with open_results(out) as results:
        assert results.stopping["reached"] == expected


def test_the_rule_is_checked(campaign, tmp_path):
    for rule, words in (
        ("{metric: r_rms_m, filter: ukf, half_width: 1, at: [4]}", "no filter is named 'ukf'"),
        ("{metric: r_rms_m, half_width: 1, at: [4, 4]}", "ascend"),
        ("{metric: r_rms, half_width: 1, at: [4]}", "r_rms_m"),
        ("{metric: r_rms_m, half_width: 0, at: [4]}", "half_width"),
        ("{metric: r_rms_m, half_width: 1, at: []}", "at"),
    ):
        with pytest.raises(CampaignError, match=words):
            campaign(f"stop={rule}")
    with pytest.raises(RefusedError, match="parts"):
        run_campaign(campaign(RULE.format(1)), tmp_path / "a.h5", part=(1, 2))
    assert campaign(RULE.format(1)).hash == campaign().hash


def test_every_metric_is_a_column():
    columns = {column for spec in layout.SUMMARY for column, _ in layout.columns(spec)}
    metrics = StopOptions.model_json_schema()["properties"]["metric"]["enum"]
    assert set(metrics) <= columns
