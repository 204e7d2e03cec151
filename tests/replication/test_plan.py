"""The plan's campaigns validate in every size, and every reading finds its case and filters in them."""

from pathlib import Path

import pytest

from relnav_sim.campaign import load_campaign
from relnav_sim.replication.alpha_kf_rules import future_rules
from relnav_sim.replication.compose import RULES
from relnav_sim.replication.measured import Measured
from relnav_sim.replication.plan import PLAN, TRIAL_RUNS, planned_campaign

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


def test_every_reading_finds_its_case_and_its_filters():
    readings = [reading for rule in (*RULES, *future_rules()) for reading in (*rule.main, *rule.others)]
    checked = 0
    for reading in readings:
        if reading.campaign not in NAMES:
            continue
        campaign = load_campaign(CAMPAIGNS / f"{reading.campaign}.yaml")
        measured = Measured({})
        measured._results[reading.campaign] = _Variables(campaign)
        case = campaign.cases[measured.case(reading.campaign, reading.case)]
        assert set(reading.filters.values()) <= set(case.config.filters)
        checked += 1
    assert checked > 30


def test_a_sensitivity_case_is_the_one_that_is_meant():
    campaign = load_campaign(CAMPAIGNS / "alpha_kf_attitude.yaml")
    measured = Measured({})
    measured._results["alpha_kf_attitude"] = _Variables(campaign)
    assert measured.case("alpha_kf_attitude", {"sensors.star_tracker.noise": {"kind": "gauss_markov"}}) == 1
