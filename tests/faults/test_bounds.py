"""A Cramér-Rao bound that fails costs itself only; one that is interrupted is computed again, to the same bits."""

import os
import signal
import time

import pytest
from relnav_process import installed, wait_until, workers
from small_campaign import assert_same_bits

from relnav_sim import open_results

PLUGIN = '''
import os, signal, traceback
from relnav_sim.filters.kalman import KalmanOptions, KalmanFilter
from relnav_sim.filters.registry import register_filter

@register_filter("kills_bound", KalmanOptions)
class KillsBound(KalmanFilter):
    """Kills the process that wants its model for a bound."""
    def __init__(self, *arguments):
        if any(frame.name == "case_bound" for frame in traceback.extract_stack()):
            os.kill(os.getpid(), signal.SIGKILL)
        super().__init__(*arguments)
'''

# One short block, and a bound that takes seconds.
LONG = (("runs: 6", "runs: 1"), ("duration_s: 40", "duration_s: 3000"), ("\n  kf: {kind: kf}", ""))
ONE_CASE = ("[{kind: gaussian}, {kind: mixture, scale: 5, fraction: 0.1}]", "[{kind: gaussian}]")


@pytest.mark.slow
def test_a_bound_that_kills_its_worker_costs_itself_only(relnav, tmp_path):
    environment = installed(tmp_path / "site", "bad_bounds", PLUGIN)
    here = relnav(("{kind: kf}", "{kind: kills_bound}"), ONE_CASE, environment=environment)
    code, _, stderr = here.run("run", "small.yaml")
    assert code == 0, stderr
    assert "lacks a Cramér-Rao bound: the worker process died" in stderr and "Traceback" not in stderr
    with open_results(here.out) as results:
        assert not results.failures() and not results.missing()
        assert results.bound(0) is None
    assert not list(here.shards.glob("*.busy"))


@pytest.mark.slow
@pytest.mark.parametrize("count", ["1", "2"])
@pytest.mark.parametrize("victim", ["worker", "parent", "interrupted"])
def test_killed_during_a_bound(relnav, count, victim):
    whole, here = relnav(*LONG, ONE_CASE, folder="whole"), relnav(*LONG, ONE_CASE)
    assert whole.run("run", "small.yaml", "--backend", "sequential")[0] == 0
    process = here.start("run", "small.yaml", "--workers", count)
    # A block's marker names its runs as well.
    assert wait_until(lambda: any(path.stem.count("_") == 1 for path in here.shards.glob("*.busy")))
    assert process.poll() is None
    if victim == "worker":
        for pid in workers(process.pid):
            os.kill(pid, signal.SIGKILL)
        assert process.wait(120) == 0
    else:
        os.killpg(process.pid, signal.SIGINT) if victim == "interrupted" else process.kill()
        begin = time.monotonic()
        assert process.wait(20) == (130 if victim == "interrupted" else -signal.SIGKILL)
        assert time.monotonic() - begin < 2
        assert wait_until(lambda: not workers(process.pid), 10)
        assert here.run("run", "small.yaml", "--workers", count)[0] == 0
    assert_same_bits(whole.out, here.out)
    with open_results(here.out) as results:
        assert results.bound(0, "ekf") is not None
