"""What goes wrong is cut, filters first, until the run and the filter to blame stand alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from relnav_sim import open_results
from relnav_sim.results.merge import merge_shards
from relnav_sim.runner.blame import TaskQueue
from relnav_sim.runner.compute import compute
from relnav_sim.runner.executors.interface import KILLED
from relnav_sim.runner.job import result_header
from relnav_sim.runner.pool import Pool, failed_task
from relnav_sim.runner.sessions import provenance_of
from relnav_sim.runner.work import blocks_left, with_filters
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.memory import lacks_memory


def pairs(block):
    return {(name, run) for name in block.case.config.filters for run in block.runs}


@pytest.fixture
def block(campaign):
    (block,) = blocks_left(campaign("sensors.radar.noise={kind: gaussian}", "grid={}", "block_runs=6"), {}, Path())
    assert len(pairs(block)) == 12
    return block


@pytest.mark.parametrize("wrong", [{("kf", 3)}, {("ekf", run) for run in range(6)}, {("kf", 0), ("ekf", 5)}])
@pytest.mark.parametrize("kind", ["killed", "too_long", "lacked_memory"])
def test_every_pair_of_filter_and_run_is_computed_or_blamed_once(block, wrong, kind):
    queue, sound, blamed = TaskQueue([block]), [], []
    while queue:
        task = queue.take()
        if not pairs(task) & wrong:
            sound += pairs(task)
        elif queue.too_long(task) if kind == "too_long" else getattr(queue, kind)(task, alone=True):
            blamed += pairs(task)
    assert sorted(blamed) == sorted(wrong)
    assert sorted(sound) == sorted(pairs(block) - wrong)


def test_what_died_beside_others_is_computed_alone_first(block):
    queue = TaskQueue([block, block])
    assert not queue.suspects
    assert not queue.killed(queue.take(), alone=False)
    assert queue.suspects and queue.take() is block and not queue.suspects
    one = block.pieces()[0].pieces()[0].pieces()[0]
    queue = TaskQueue([one])
    assert len(one.runs) == 1 and not one.pieces()
    assert not queue.killed(queue.take(), alone=True)
    assert queue.killed(queue.take(), alone=True)
    assert not queue.lacked_memory(one, alone=False)
    assert queue.suspects


def test_want_of_memory_is_known_by_the_first_cause():
    assert lacks_memory(MemoryError()) and lacks_memory(OSError(12, "Cannot allocate memory"))
    assert not lacks_memory(OSError(28, "No space left on device")) and not lacks_memory(ValueError("memory"))
    try:
        try:
            raise MemoryError
        except MemoryError as error:
            raise ValueError("no room") from error
    except ValueError as error:
        assert lacks_memory(error)


def test_no_time_limit_in_this_process():
    with pytest.raises(ValueError, match="timeout_s needs worker processes"):
        Pool(backend="sequential", timeout_s=1.0)


@pytest.mark.parametrize("filters, known", [(("kf", "ekf"), True), (("ekf",), False)])
def test_the_truth_of_a_run_whose_process_died_comes_from_another_block_or_is_unknown(
    campaign, tmp_path, filters, known
):
    made = campaign("sensors.radar.noise={kind: gaussian}", "grid={}", "runs=1")
    (block,) = blocks_left(made, {}, tmp_path)
    shards = [replace(block, case=with_filters(block.case, [name])) for name in filters]
    *others, died = shards
    for shard in others:
        compute(shard, Learned())
    failed_task(died, KILLED, retry=False)
    merge_shards(
        [shard.path for shard in shards], result_header(made), provenance_of([]), tmp_path / "out.h5", complete=False
    )
    with open_results(tmp_path / "out.h5") as results:
        truth = np.asarray(results.truth(0))
        assert results.statistic(0, "ekf", "failed").tolist() == [1]
    assert truth.shape == (1, 11, 6)
    assert np.isfinite(truth).all() if known else np.isnan(truth).all()
