"""Campaigns that fly the papers word for word: the scenario is that of the others, the filters are the papers'."""

from pathlib import Path

import pytest

from relnav_sim.campaign import load_campaign
from relnav_sim.campaign.blocks import filter_cost_us

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
PAIRS = [("shi2025", "alpha_kf_gaussian"), ("wei2012", "mf_upf"), ("liu2011", "two_step")]


def literal(paper):
    return load_campaign(CAMPAIGNS / f"papers_literal_{paper}.yaml")


@pytest.mark.parametrize(("paper", "other"), PAIRS)
def test_truth_clock_and_seed_are_those_of_the_other_campaigns(paper, other):
    mine, theirs = literal(paper), load_campaign(CAMPAIGNS / f"{other}.yaml")
    assert mine.seed == theirs.seed
    for case in mine.cases:
        assert case.config.truth == theirs.cases[0].config.truth
        assert case.config.clock == theirs.cases[0].config.clock
    sensors = theirs.cases[0].config.sensors
    assert mine.cases[0].config.sensors.keys() == sensors.keys()
    for name in sensors.keys() - {"radar"}:
        assert mine.cases[0].config.sensors[name] == sensors[name]
    radar = {"boresight", "field_of_view_deg"}  # fixed in the literal campaign of Wei et al.
    mine_radar, theirs_radar = mine.cases[0].config.sensors["radar"], sensors["radar"]
    assert mine_radar.model_dump(exclude=radar) == theirs_radar.model_dump(exclude=radar)


def test_shi_2025():
    """Every filter has the same measurement, R and Q, and I + A dt; alpha_kf 10000 free samples of all states."""
    for case in literal("shi2025").cases:
        filters = case.config.filters
        assert {entry.measurement for entry in filters.values()} == {"cartesian"}
        assert {entry.assumed_noise for entry in filters.values()} == {"nominal"}
        assert len({entry.process_noise.model_dump_json() for entry in filters.values()}) == 1
        assert {(entry.dynamics.kind, entry.dynamics.discretisation) for entry in filters.values()} == {("cw", "euler")}
        sampled = [entry for entry in filters.values() if entry.kind == "alpha_kf"]
        assert {
            (e.samples, e.sampling, e.sampled_states, e.covariance_correction, e.proposal, e.fixed_point, e.likelihood)
            for e in sampled
        } == {(10_000, "random", "all", False, "prior", 1, "gaussian")}
        assert sorted(entry.alpha for entry in sampled) == [0.001, 0.005, 0.01, 0.05, 0.1, 0.5, 0.999]


def test_wei_2012():
    filters = literal("wei2012").cases[0].config.filters
    assert {(entry.ess_fraction, entry.roughening) for entry in filters.values()} == {(1.0, 0.0)}
    assert filters["pf"].process_noise.diagonal == (1e-9,) * 3 + (1e-6,) * 3
    for name in ("mf_upf_steps", "mf_upf_name"):
        entry, learned = filters[name], filters[name].dynamics
        assert (entry.estimate, entry.mcmc_steps > 0) == ("after_resampling", True)
        assert (learned.target, learned.training, learned.training_points) == ("absolute", "truth", 500)
        assert (learned.variance, learned.add_process_noise) == ("exact", False)
        assert learned.regression.model_dump() == {
            "processes": "one_per_output",
            "length_scales": "common",
            "standardised": False,
            "fitted_points": 500,
            "calibrated": False,
            "noise_counted": False,
        }
        shared = entry.model_copy(update={"dynamics": learned.model_copy(update={"regression": None})})
        assert filter_cost_us(entry) == 6 * filter_cost_us(shared)
    assert literal("wei2012").cases[0].config.sensors["radar"].boresight == "fixed"


def test_liu_2011():
    filters = literal("liu2011").cases[0].config.filters
    assert [name for name, entry in filters.items() if getattr(entry, "start", None) == "unscented_plain"]
    assert filters["two_step_default"].start == "unscented"
