"""Campaigns that fly a shipped scenario in the real field: nothing but gravity, epoch and filters may differ."""

from pathlib import Path

import pytest

from relnav_sim.campaign import load_campaign

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"
PAIRS = ["limit", "mf_upf", "rendezvous"]


def pair(name):
    return [load_campaign(CAMPAIGNS / f"{each}.yaml") for each in (name, f"{name}_real_field")]


@pytest.mark.parametrize("name", PAIRS)
def test_the_scenario_is_the_same(name):
    zonal, real = pair(name)
    assert (zonal.seed, zonal.runs, zonal.block_runs) == (real.seed, real.runs, real.block_runs)
    assert len(zonal.cases) == len(real.cases)
    for there, here in zip(zonal.cases, real.cases, strict=True):
        assert there.config.clock == here.config.clock
        assert there.config.sensors == here.config.sensors
        assert there.config.start == here.config.start
        assert there.config.truth.epoch is None
        apart = {"forces", "epoch", "constants"}  # the constants are the field's own
        assert there.config.truth.model_dump(exclude=apart) == here.config.truth.model_dump(exclude=apart)


@pytest.mark.parametrize("name", PAIRS)
def test_gravity_is_the_real_one_and_the_air_the_same(name):
    zonal, real = (campaign.cases[0].config.truth.forces for campaign in pair(name))
    assert zonal.gravity is None and zonal.zonals == 4
    assert (real.gravity.model, real.gravity.degree, real.gravity.order) == ("ggm05s", 40, 40)
    assert set(real.third_bodies) == {"sun", "moon"}
    assert (real.drag, real.atmosphere) == (zonal.drag, zonal.atmosphere)
