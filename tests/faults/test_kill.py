"""A campaign that is killed at any moment loses only its blocks in progress, and goes on to the same bits."""

import os
import random
import shutil
import signal
import time

import pytest
from relnav_process import members, wait_until, workers
from small_campaign import assert_same_bits

from relnav_sim import load_campaign, open_results, run_campaign
from relnav_sim.results.shards import read_shard

# 12 blocks of a tenth of a second or more.
LONGER = (("runs: 6", "runs: 24"), ("block_runs: 4", "block_runs: 4"), ("duration_s: 40", "duration_s: 300"))


def assert_whole(relnav):
    """Every shard verifies, and the result opens if it is there."""
    for path in relnav.shards.glob("*.h5"):
        read_shard(path)
    if relnav.out.exists():
        with open_results(relnav.out) as results:
            results.summary()


def computing(relnav, since):
    """Whether a worker has begun a block since then; markers of killed workers are older."""
    for marker in relnav.shards.glob("*.busy"):
        try:
            if marker.stat().st_mtime >= since:
                return True
        except FileNotFoundError:
            return True
    return False


def kill_and_resume(make, folder, moments, rng, *options):
    """Kill campaigns at so many moments, each after the last goes on from what is left; return the finished one."""
    relnav = make(*LONGER, folder=folder)
    killed = 0
    while killed < moments:
        if relnav.out.exists():
            shutil.rmtree(relnav.folder / "results")
        began = time.time()
        process = relnav.start("run", "small.yaml", *options)
        before = len(list(relnav.shards.glob("*.h5")))
        # Mostly while blocks are computed, sometimes before, or during the merge.
        if rng.random() < 0.8:
            wait_until(lambda p=process, t=began: p.poll() is not None or computing(relnav, since=t))
        time.sleep(rng.uniform(0, 1.2))
        if process.poll() is None:
            victims = workers(process.pid)
            of_parent = not victims or rng.random() < 0.6
            try:
                os.kill(process.pid if of_parent else rng.choice(victims), signal.SIGKILL)
            except ProcessLookupError:
                continue
            killed += 1
            if of_parent:
                process.wait()
                assert wait_until(lambda p=process: not workers(p.pid), 10), members(process.pid)
                assert_whole(relnav)
                assert len(list(relnav.shards.glob("*.h5"))) >= before
                continue
        # A worker that is killed from outside is no fault of its run.
        _, stderr = process.communicate(timeout=120)
        assert process.returncode == 0, stderr
        assert "Traceback" not in stderr
    code, _, stderr = relnav.run("run", "small.yaml", *options)
    assert code == 0, stderr
    assert not list(relnav.shards.glob("*.busy")) and not list(relnav.shards.glob(".*"))
    return relnav


def uninterrupted(make, *changes):
    whole = make(*LONGER, folder="reference")
    return run_campaign(load_campaign(whole.folder / "small.yaml", changes), whole.out, backend="sequential")


def test_killed_once(relnav):
    """Of one worker, as each costs a second to start; below there are two."""
    options = ("--workers", "1", "--set", "bound=false")
    killed = kill_and_resume(relnav, "killed", 1, random.Random(4), *options)
    assert_same_bits(uninterrupted(relnav, "bound=false"), killed.out)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_killed_at_many_moments(relnav, seed):
    assert_same_bits(uninterrupted(relnav), kill_and_resume(relnav, "killed", 8, random.Random(seed)).out)
