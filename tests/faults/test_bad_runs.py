"""A filter of somebody else's that kills, raises, fills the memory or hangs in run 3 costs that run and no other."""

import pytest
from relnav_process import installed, wait_until, workers
from small_campaign import assert_same_bits

from relnav_sim import open_results
from relnav_sim.results.block import Failure
from relnav_sim.statistics.intervals import wilson_interval

PLUGIN = '''
import os, signal, time
import numpy as np
from relnav_sim.filters.kalman import KalmanOptions, KalmanFilter
from relnav_sim.filters.registry import register_filter

class Bad(KalmanFilter):
    """A Kalman filter that goes wrong in run 3."""

    def start(self, prior, source):
        self.place = source.runs.index(3) if 3 in source.runs else None
        return super().start(prior, source)

    def correct(self, belief, z, step):
        belief, innovation = super().correct(belief, z, step)
        if self.place is not None and step.epoch == 12:
            belief = self.go_wrong(belief) or belief
        return belief, innovation

@register_filter("kills", KalmanOptions)
class Kills(Bad):
    """Kills its process."""
    def go_wrong(self, belief):
        os.kill(os.getpid(), signal.SIGKILL)

@register_filter("killed_once", KalmanOptions)
class KilledOnce(KalmanFilter):
    """Its process is killed the first time, as if somebody did it from outside."""
    def start(self, prior, source):
        if not os.path.exists("killed"):
            open("killed", "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        return super().start(prior, source)

@register_filter("exits", KalmanOptions)
class Exits(Bad):
    """Ends its process the polite way."""
    def go_wrong(self, belief):
        raise SystemExit("enough")

@register_filter("raises", KalmanOptions)
class Raises(Bad):
    """Raises an exception."""
    def go_wrong(self, belief):
        raise ZeroDivisionError("too interesting")

@register_filter("lacks", KalmanOptions)
class Lacks(Bad):
    """Has too little memory until there is a file ``enough``."""
    def go_wrong(self, belief):
        if not os.path.exists("enough"):
            try:
                np.empty((1 << 50,))
            except MemoryError:
                raise ValueError("no room")

@register_filter("hangs", KalmanOptions)
class Hangs(Bad):
    """Never returns, and swallows whatever should end it."""
    def go_wrong(self, belief):
        while True:
            try:
                time.sleep(0.1)
            except BaseException:
                pass

@register_filter("holds", KalmanOptions)
class Holds(Bad):
    """Never returns, from compiled code that leaves no other thread a turn."""
    def go_wrong(self, belief):
        open("holding", "w").close()
        sum(range(10**15))

@register_filter("unstartable", KalmanOptions)
class Unstartable(KalmanFilter):
    """Cannot start in run 3."""
    def start(self, prior, source):
        if 3 in source.runs:
            raise RuntimeError("no start")
        return super().start(prior, source)

@register_filter("diverges", KalmanOptions)
class Diverges(Bad):
    """Loses its covariance."""
    def go_wrong(self, belief):
        belief.covariance[self.place] = np.inf
'''


@pytest.fixture
def with_plugin(relnav, tmp_path):
    """Return a maker of command lines that know the plugin as an installed package."""
    environment = installed(tmp_path / "site", "bad_filters", PLUGIN)

    def make(*kinds):
        entries = "".join(f"\n  {kind}: {{kind: {kind}}}" for kind in kinds)
        one_case = ("[{kind: gaussian}, {kind: mixture, scale: 5, fraction: 0.1}]", "[{kind: gaussian}]")
        change = ("\n  ekf: {kind: ekf}", f"\n  ekf: {{kind: ekf}}{entries}")
        return relnav(change, one_case, environment=environment)

    return make


def failures(out, runs=6):
    with open_results(out) as results:
        assert not results.missing()
        for name in results.filters:
            failed = results.statistic(0, name, "failed").tolist()
            assert failed == [int(run == 3 and name not in ("kf", "ekf")) for run in range(runs)], name
        found = [failure for _, failure in results.failures()]
    assert all(failure.run == 3 for failure in found)
    return {failure.filter: failure.reason for failure in found}


@pytest.mark.slow
def test_exceptions_and_divergence(with_plugin):
    here = with_plugin("exits", "raises", "unstartable", "diverges")
    code, _, stderr = here.run("run", "small.yaml", "--backend", "sequential")
    assert code == 1
    assert "4 runs of a filter failed" in stderr and "Traceback" not in stderr
    reasons = failures(here.out)
    assert reasons.keys() == {"exits", "raises", "unstartable", "diverges"}
    assert reasons["exits"].startswith("SystemExit: enough (bad_filters.py:")
    assert reasons["raises"].startswith("ZeroDivisionError: too interesting (bad_filters.py:")
    assert reasons["unstartable"].startswith("RuntimeError: no start (bad_filters.py:")
    assert "covariance" in reasons["diverges"] or "mean" in reasons["diverges"]


# Each time that a block is cut costs a new worker; the long check cuts those of four runs and three filters.
FEW_CUTS = ("--runs", "5", "--set", "block_runs=1", "--set", "filters={ekf: {kind: ekf}, kills: {kind: kills}}")


@pytest.mark.parametrize(
    "workers, runs, options", [pytest.param("1", 6, (), marks=pytest.mark.slow), ("2", 5, FEW_CUTS)]
)
def test_a_run_that_kills_its_worker_is_isolated(with_plugin, workers, runs, options):
    here = with_plugin("kills")
    code, _, stderr = here.run("run", "small.yaml", "--workers", workers, "--set", "bound=false", *options)
    assert code == 1, stderr
    assert "1 run of a filter failed" in stderr and "Traceback" not in stderr
    assert failures(here.out, runs) == {
        "kills": "the worker process died: killed by the system, most likely out of memory, or a crash in compiled code"
    }
    assert not list(here.shards.glob("*.busy"))


@pytest.mark.slow
def test_a_run_that_cannot_be_cut_is_blamed_the_second_time_only(with_plugin):
    here = with_plugin("killed_once")
    options = ("--workers", "1", "--runs", "1", "--set", "filters={once: {kind: killed_once}}", "--set", "bound=false")
    code, _, stderr = here.run("run", "small.yaml", *options)
    assert code == 0, stderr
    assert (here.folder / "killed").exists()


@pytest.mark.parametrize("options", [("--backend", "sequential"), pytest.param((), marks=pytest.mark.slow)])
@pytest.mark.slow
def test_want_of_memory_is_no_failure_of_the_filter_and_is_tried_again(with_plugin, options):
    here = with_plugin("lacks")
    again, one = ("run", "small.yaml", *options), ("run", "small.yaml", "--only", "0:3", *options)
    code, _, stderr = here.run(*again)
    assert code == 1 and "1 of the runs of filters lacked memory" in stderr and "failed;" not in stderr
    with open_results(here.out) as results:
        assert results.missing() == {(results.cases[0], "lacks"): (3,)}
        assert results.case_runs(0, "lacks").tolist() == [0, 1, 2, 4, 5]
        assert not any(results.statistic(0, name, "failed").any() for name in results.filters)
        ((_, failure),) = results.failures()
        assert results.lacked_memory() == results.failures()
    assert (failure.run, failure.filter) == (3, "lacks")
    assert failure.reason.startswith("not enough memory: ") and "no room" in failure.reason
    (code, _, stderr), third = here.in_turn(again, one)
    assert code == 1 and "1 of the runs of filters lacked memory or a worker the last time; trying them again" in stderr
    code, stdout, stderr = third
    assert code == 1 and "1 of the runs of filters lacked memory" in stderr and "failed;" not in stderr
    assert "wrote results/small.case_000.run_3.h5" in stdout
    (here.folder / "enough").touch()
    fresh = ("run", "small.yaml", "--backend", "sequential", "--out", "fresh.h5")
    for code, _, stderr in here.in_turn(again, fresh):
        assert code == 0, stderr
    assert_same_bits(here.folder / "fresh.h5", here.out)


ALONE = ("--set", "bound=false", "--set", "block_runs=1", "--runs", "4")


@pytest.mark.parametrize("kind", ["hangs", pytest.param("holds", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_a_run_that_hangs_is_ended_from_outside(with_plugin, kind):
    here = with_plugin(kind)
    code, _, stderr = here.run("run", "small.yaml", "--timeout-s", "4", *ALONE)
    assert code == 1 and "4 of 4 runs done" in stderr, stderr
    with open_results(here.out) as results:
        assert not results.missing()
        assert [failure for _, failure in results.failures()] == [Failure(3, kind, -1, "took longer than 4 s")]
        for name in results.filters:
            assert results.statistic(0, name, "failed").tolist() == [0, 0, 0, int(name == kind)]
    assert not list(here.shards.glob("*.busy"))


@pytest.mark.slow
def test_a_run_that_hangs_is_cut_out_of_its_block(with_plugin):
    here = with_plugin("hangs")
    code, _, stderr = here.run("run", "small.yaml", "--timeout-s", "4")
    assert code == 1, stderr
    assert failures(here.out) == {"hangs": "took longer than 4 s"}


def test_no_time_limit_without_worker_processes(with_plugin):
    here = with_plugin("raises")
    code, _, stderr = here.run("run", "small.yaml", "--timeout-s", "4", "--backend", "sequential")
    assert code == 2
    assert stderr == "relnav: --timeout-s needs worker processes, which can be ended; leave out --backend sequential\n"


@pytest.mark.slow
def test_workers_die_with_their_parent_whatever_they_are_at(with_plugin):
    here = with_plugin("holds")
    process = here.start("run", "small.yaml", *ALONE)
    assert wait_until((here.folder / "holding").exists)
    assert workers(process.pid)
    process.kill()
    process.wait()
    assert wait_until(lambda: not workers(process.pid), 20)


@pytest.mark.slow
def test_fail_fast_keeps_what_is_finished_and_a_later_command_goes_on(with_plugin):
    here = with_plugin("raises")
    sequential = ("--backend", "sequential", "--set", "block_runs=1")
    code, _, stderr = here.run("run", "small.yaml", "--fail-fast", *sequential)
    assert code == 1
    assert "stopped: 1 failure" in stderr
    with open_results(here.out) as results:
        assert results.case_runs(0, "kf").tolist() == [0, 1, 2, 3]
    code, _, stderr = here.run("run", "small.yaml", "--max-failures", "1", *sequential)
    assert code == 1
    assert failures(here.out)


@pytest.mark.slow
def test_the_report_counts_failures_with_an_interval(with_plugin):
    here = with_plugin("raises")
    assert here.run("run", "small.yaml", "--backend", "sequential")[0] == 1
    code, _, stderr = here.run("report", str(here.out), "--format", "md")
    assert code == 0, stderr
    pages = "\n".join(path.read_text() for path in here.out.parent.rglob("*.md"))
    interval = wilson_interval(1, 6)
    assert f"{100 * interval.low:.0f}" in pages and f"{100 * interval.high:.0f}" in pages
