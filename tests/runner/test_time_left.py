"""How long a campaign has to go: by the plan's costs of what is left, corrected by those measured."""

from dataclasses import replace
from pathlib import Path

import pytest

from relnav_sim.campaign.plan import block_seconds
from relnav_sim.runner.time_left import TimeLeft
from relnav_sim.runner.work import blocks_left, with_filters


@pytest.fixture
def blocks(campaign):
    return list(blocks_left(campaign("block_runs=2"), {}, Path()))


def planned(block):
    return block_seconds(block.case.config, tuple(block.case.config.filters), len(block.runs))


def expecting(blocks):
    time_left = TimeLeft()
    time_left.expect(blocks)
    return time_left


def test_before_anything_is_measured_it_is_the_plan(blocks):
    assert expecting(blocks).left_s([], places=2) == pytest.approx(sum(map(planned, blocks)) / 2)


def test_nothing_left_is_zero(blocks):
    time_left = expecting(blocks)
    for block in blocks:
        time_left.took(block, 3.0)
    assert time_left.left_s([], places=1) == pytest.approx(0.0, abs=1e-9)


def test_what_has_been_measured_counts_for_its_like_and_its_filters_elsewhere(blocks):
    assert len(blocks) == 6, "two cases, three blocks each"
    time_left = expecting(blocks)
    time_left.took(blocks[0], 10.0)
    assert time_left.is_measured(blocks[1]) and not time_left.is_measured(blocks[3])
    assert time_left.expected_s(blocks[1]) == pytest.approx(10.0)
    assert time_left.left_s([], places=1) == pytest.approx(50.0)
    time_left.took(blocks[3], 100.0)
    assert time_left.left_s([], places=1) == pytest.approx(2 * 10.0 + 2 * 100.0), "each case by its own costs"


def test_a_dear_filter_that_is_left_counts_by_its_cost_and_not_by_its_runs(campaign):
    """Two of three filters are done: by runs a third would be left, but the particle filter is the most of it."""
    (block, *_) = blocks_left(campaign("filters.pf={kind: particle}"), {}, Path())
    time_left = expecting([block])
    whole = time_left.left_s([], places=1)
    time_left.took(replace(block, case=with_filters(block.case, ["kf", "ekf"])), None)
    assert 0.9 * whole < time_left.left_s([], places=1) < whole


def test_candidates_of_a_search_count_as_what_they_are_candidates_of(blocks):
    """What `kf 0` has taken tells of `kf 1`, and nothing of it is told by `ekf 0`."""

    def as_candidates(block, number):
        config = block.case.config
        filters = {f"{name} {number}": entry for name, entry in config.filters.items()}
        return replace(block, case=replace(block.case, config=config.model_copy(update={"filters": filters})))

    first, second = as_candidates(blocks[0], 0), as_candidates(blocks[1], 1)
    time_left = TimeLeft(lambda name: name.rpartition(" ")[0])
    time_left.expect([first, second])
    assert time_left.left_s([], places=1) == pytest.approx(planned(first) + planned(second))
    time_left.took(first, 10.0)
    assert time_left.is_measured(second) and time_left.left_s([], places=1) == pytest.approx(10.0)
    alone = TimeLeft()
    alone.expect([first, second])
    alone.took(first, 10.0)
    assert not alone.is_measured(second)


def test_running_blocks_shorten_it_and_the_longest_bounds_it(blocks):
    time_left = expecting(blocks)
    time_left.took(blocks[0], 10.0)
    running = [(blocks[1], 4.0), (blocks[2], 0.0)]
    assert time_left.left_s(running, places=2) == pytest.approx((6.0 + 10.0 + 30.0) / 2)
    for block in blocks[3:]:
        time_left.took(block, 10.0)
    assert time_left.left_s(running, places=2) == pytest.approx(10.0), "nothing else waits: the longer of the two"


def test_an_overdue_block_is_not_thought_to_be_done(blocks):
    time_left = expecting(blocks[:2])
    time_left.took(blocks[0], 10.0)
    assert time_left.left_s([(blocks[1], 40.0)], places=1) == pytest.approx(10.0), "a quarter of its time so far"
