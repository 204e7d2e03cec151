"""The plan's campaigns validate in every size, and every interpretation finds its case and filters in them."""

from pathlib import Path

import pytest

from relnav_sim.campaign import load_campaign
from relnav_sim.runner.run import run_campaign
from replication import plan as plan_module
from replication.compose import RULES
from replication.measured import Measured
from replication.plan import PLAN, TRIAL_RUNS, Planned, complete_in_full, in_order, planned_campaign
from replication.shi2025.adaptive_rules import future_rules

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
NAMES = {planned.name for planned in PLAN}


@pytest.mark.parametrize("size", ["trial", "usual", "full"])
@pytest.mark.parametrize("planned", PLAN, ids=lambda planned: planned.name)
def test_every_planned_campaign_validates(planned, size):
    campaign = planned_campaign(planned, size, CAMPAIGNS)
    assert campaign.name == planned.name
    assert campaign.runs == {"trial": TRIAL_RUNS, "usual": planned.runs}.get(size, campaign.runs)


class _Variables:
    """A campaign where results would be, to look up cases without running it."""

    def __init__(self, campaign):
        self.path, self.cases = campaign.path, campaign.cases

    def variables(self, index):
        return self.cases[index].variables


@pytest.mark.slow
def test_every_reading_finds_its_case_and_its_filters():
    interpretations = [interpretation for rule in (*RULES, *future_rules()) for interpretation in (*rule.main, *rule.others)]
    checked = 0
    for interpretation in interpretations:
        if interpretation.campaign not in NAMES:
            continue
        campaign = load_campaign(CAMPAIGNS / f"{interpretation.campaign}.yaml")
        measured = Measured({})
        measured._results[interpretation.campaign] = _Variables(campaign)
        case = campaign.cases[measured.case(interpretation.campaign, interpretation.case)]
        assert set(interpretation.filters.values()) <= set(case.config.filters)
        checked += 1
    assert checked > 30


def test_a_sensitivity_case_is_the_one_that_is_meant():
    campaign = load_campaign(CAMPAIGNS / "alpha_kf_epsilon.yaml")
    measured = Measured({})
    measured._results["alpha_kf_epsilon"] = _Variables(campaign)
    assert measured.case("alpha_kf_epsilon", {"sensors.radar.noise": {"kind": "mixture", "shared": False}}) == 2


def test_in_full_the_longest_campaigns_come_last():
    assert [planned.name for planned in in_order("full")][-3:] == ["mf_upf_size", "alpha_kf_draws", "mf_upf_particles"]
    assert in_order("usual") == list(PLAN)


@pytest.mark.slow
def test_only_complete_results_of_the_same_campaign_are_taken(tmp_path, monkeypatch):
    short = ("clock.duration_s=10", "statistics.settle_s=5")
    monkeypatch.setattr(plan_module, "PLAN", (Planned("two_step", 1, full_runs=2, always=short),))
    (planned,) = plan_module.PLAN
    path = tmp_path / "two_step.h5"
    assert complete_in_full(CAMPAIGNS, tmp_path) == {}
    run_campaign(planned_campaign(planned, "usual", CAMPAIGNS), path, backend="sequential")
    assert complete_in_full(CAMPAIGNS, tmp_path) == {}  # a run is missing
    run_campaign(planned_campaign(planned, "full", CAMPAIGNS), path, backend="sequential")
    assert complete_in_full(CAMPAIGNS, tmp_path) == {"two_step": path}
    monkeypatch.setattr(
        plan_module,
        "PLAN",
        (Planned("two_step", 1, full_runs=2, always=("clock.duration_s=20", "statistics.settle_s=5")),),
    )
    said = []
    assert complete_in_full(CAMPAIGNS, tmp_path, said.append) == {}  # another campaign now
    assert said == [f"{path} is not taken: it is of other settings, or of fewer runs, than the plan"]


def test_every_filter_is_tuned_with_the_same_budget():
    tunes = {}
    for name in ("alpha_kf_gaussian", "alpha_kf_mixture", "alpha_kf_sweep"):
        campaign = load_campaign(CAMPAIGNS / f"{name}.yaml")
        filters = campaign.content["filters"]
        tuned = {filter.removesuffix("_tuned") for filter in filters if filter.endswith("_tuned")}
        assert tuned <= set(campaign.tune.filters)
        for filter in tuned:
            other = {**filters[f"{filter}_tuned"], "process_noise": filters[filter]["process_noise"]}
            assert other == filters[filter]
            assert filters[filter]["process_noise"]["acceleration_psd_m2_s3"] == 1e-6  # where each search begins
        assert set(campaign.tune.free.values()) == {(1e-11, 1e-3)}
        assert len(campaign.tune.free) == len(campaign.tune.filters)
        tunes[name] = campaign.tune.model_copy(update={"filters": (), "free": {}})
    assert len(set(map(repr, tunes.values()))) == 1


def test_filters_of_other_sizes_differ_by_their_particles_alone():
    many = load_campaign(CAMPAIGNS / "mf_upf_particles.yaml").content
    few = load_campaign(CAMPAIGNS / "mf_upf_size.yaml").content
    for name, entry in few["filters"].items():
        base, _, particles = name.rpartition("_")
        assert entry == {**many["filters"][base], "particles": int(particles)}
    assert {key: few[key] for key in ("seed", "truth", "sensors", "start")} == {
        key: many[key] for key in ("seed", "truth", "sensors", "start")
    }
