from pathlib import Path

import pytest

from relnav_sim.campaign import parse_campaign, plan_campaign
from relnav_sim.campaign.blocks import SIZES, filter_groups, run_seconds
from relnav_sim.campaign.plan import block_seconds


@pytest.fixture(scope="module")
def limit():
    return (Path(__file__).parents[2] / "campaigns" / "limit.yaml").read_text(encoding="utf-8")


def blocks_of(text, *overrides):
    campaign = parse_campaign(text, overrides)
    return campaign.block_runs, plan_campaign(campaign).blocks


def test_a_small_campaign_is_a_block_for_each_case(demo):
    assert blocks_of(demo) == (SIZES[-1], 2)


def test_one_case_has_two_blocks(demo):
    assert blocks_of(demo, "grid={}") == (20, 2)
    assert blocks_of(demo, "grid={}", "runs=1") == (1, 1)


def test_a_block_takes_about_twenty_seconds(demo):
    long = ["clock.duration_s=6000", "clock.step_s=0.5", "runs=100"]
    size, blocks = blocks_of(demo, *long)
    assert 8 < size * run_seconds(parse_campaign(demo, long).cases[0].config) <= 20
    assert size in SIZES
    assert blocks == 2 * -(-100 // size)


def test_many_filters_leave_enough_runs_in_a_block_that_calls_are_not_most_of_it(limit):
    """What a step costs however few the runs is paid once a block, so that small blocks cost a multiple."""
    kinds = ("ekf", "ukf", "ckf", "sr_ukf", "iekf", "huber", "mckf", "student_t", "ud_ekf", "srif")
    like_kf = limit.partition("  kf: ")[2].partition("kind: kf\n")[2].partition("  imm:")[0].split("\n")
    settings = ", ".join(line.strip() for line in like_kf if line.strip())
    many = [f"filters.{kind}={{kind: {kind}, {settings}}}" for kind in kinds]
    campaign = parse_campaign(limit, [*many, "block_runs=null"])
    config, names = campaign.cases[0].config, tuple(campaign.cases[0].config.filters)
    assert len(names) == 15

    def calls(size):
        """Return what of the planned time of a block of so many runs is paid once."""
        return 2 * block_seconds(config, names, size) - block_seconds(config, names, 2 * size)

    size = campaign.block_runs
    assert calls(size) < 0.5 * block_seconds(config, names, size)
    former = max(s for s in SIZES if s <= 20 / run_seconds(config))
    assert calls(former) > 0.5 * block_seconds(config, names, former)
    # And there is no less to hand out: as many blocks in a case as six workers keep busy, none beyond 40 s.
    groups = filter_groups(config, names, size)
    assert sum(groups, ()) == names and len(groups) * (campaign.runs // size) >= 6
    for group in groups:
        alone = config.model_copy(update={"filters": {name: config.filters[name] for name in group}})
        assert size * run_seconds(alone) <= 40


def test_a_run_that_takes_longer_is_a_block_of_its_own(demo):
    """And where its filters take longer than 40 s together, they are computed one after another."""
    assert blocks_of(demo, "clock.duration_s=1200000", "runs=3") == (1, 6)
    assert blocks_of(demo, "clock.duration_s=6000000", "runs=3") == (1, 6 * 4)


def test_blocks_that_the_campaign_makes_long_are_split_by_filters(demo):
    config = parse_campaign(demo, ["clock.duration_s=60000"]).cases[0].config
    names = tuple(config.filters)
    assert filter_groups(config, names, 5) == [names]
    groups = filter_groups(config, names, 40)
    assert 1 < len(groups) < len(names) and sum(groups, ()) == names
    for group in groups:
        alone = config.model_copy(update={"filters": {name: config.filters[name] for name in group}})
        assert 40 * run_seconds(alone) <= 40


def test_many_samples_make_blocks_short(demo):
    sampled = "filters.kf={kind: alpha_kf, samples: 100000}"
    assert blocks_of(demo, sampled, "clock.duration_s=10", "statistics.settle_s=1")[0] == 10
    few = plan_campaign(parse_campaign(demo, ["filters.kf={kind: alpha_kf, samples: 100}"]))
    many = plan_campaign(parse_campaign(demo, ["filters.kf={kind: alpha_kf, samples: 10000}"]))
    per_sample = 200e-6 / 10_000  # the registered cost of the default number of samples
    assert many.cpu_s - few.cpu_s == pytest.approx(2 * 40 * 600 * 9900 * per_sample)  # all else stays


def test_the_campaign_may_say_how_many(demo):
    assert blocks_of(demo, "block_runs=7") == (7, 12)


def test_the_plan_counts_steps(demo):
    plan = plan_campaign(parse_campaign(demo))
    assert plan.filter_steps == 2 * 40 * 600 * 4
    assert plan.disk_bytes == pytest.approx(2 * 40 * (121 * (4 * 56 + 48) + 4 * 1600))
    assert 150e6 < plan.memory_bytes < 1e9


def test_the_chiefs_legs_are_held_once_for_filters_that_share_them(demo):
    def memory(*dynamics):
        changes = [f"filters.{name}.dynamics={{{it}}}" for name, it in zip(("ekf", "ukf"), dynamics, strict=True)]
        return plan_campaign(parse_campaign(demo, ["block_runs=40", *changes])).memory_bytes

    none, one = memory("kind: cw", "kind: cw"), memory("kind: cw", "kind: nonlinear_j2")
    higher = "kind: nonlinear_j2, zonals: 4"
    assert memory("kind: nonlinear_j2", "kind: nonlinear_j2") == one > none
    assert memory("kind: nonlinear_j2", higher) - none == pytest.approx(2 * (one - none))
