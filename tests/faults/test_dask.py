"""A campaign on a Dask cluster has the same bits, whatever workers die, come late, go or are of another relnav."""

import gc
import os
import re
import signal
import socket
import subprocess
import sys
import time

import pytest
from relnav_process import installed, members, wait_until
from small_campaign import assert_same_bits

from relnav_sim import load_campaign, open_results, run_campaign
from relnav_sim.results.block import RefusedError
from relnav_sim.runner.event_log import read_events
from relnav_sim.runner.executors import dask_client
from relnav_sim.runner.executors.interface import WorkersError
from relnav_sim.runner.executors.on_worker import end_idle
from relnav_sim.runner.machines import machines_of

LONGER = (("runs: 6", "runs: 24"), ("block_runs: 4", "block_runs: 4"), ("duration_s: 40", "duration_s: 300"))
LOCAL = ("--backend", "dask", "--local-cluster", "2")
WORKER, PROCESS = "spawn_main", "popen_loky"
SCHEDULER = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--no-dashboard", "--port"]
OF_SCHEDULER = [sys.executable, "-m", "distributed.cli.dask_worker", "--no-dashboard", "--nthreads", "1"]

PLUGIN = '''
import os, signal, time
from relnav_sim.filters.kalman import KalmanOptions, KalmanFilter
from relnav_sim.filters.registry import register_filter

class Bad(KalmanFilter):
    """A Kalman filter that goes wrong in run 3."""

    def start(self, prior, source):
        self.bad = 3 in source.runs
        return super().start(prior, source)

    def correct(self, belief, z, step):
        if self.bad and step.epoch == 12:
            self.go_wrong()
        return super().correct(belief, z, step)

@register_filter("kills", KalmanOptions)
class Kills(Bad):
    """Kills its process."""
    def go_wrong(self):
        os.kill(os.getpid(), signal.SIGKILL)

@register_filter("holds", KalmanOptions)
class Holds(Bad):
    """Never returns, from compiled code that leaves no other thread a turn."""
    def go_wrong(self):
        sum(range(10**15))

@register_filter("raises", KalmanOptions)
class Raises(Bad):
    """Raises an exception."""
    def go_wrong(self):
        raise ZeroDivisionError("too interesting")
'''


@pytest.fixture
def reference(relnav):
    whole = relnav(*LONGER, folder="reference")
    return run_campaign(load_campaign(whole.folder / "small.yaml"), whole.out, backend="sequential")


def test_a_cluster_gives_the_bits_of_this_process(relnav, tmp_path):
    from distributed import LocalCluster

    here = relnav()
    one = load_campaign(here.folder / "small.yaml", ["runs=2", "grid={}"])
    alone = run_campaign(one, tmp_path / "alone.h5", backend="sequential")
    said = []
    try:
        with LocalCluster(
            1, threads_per_worker=1, processes=False, protocol="tcp://", dashboard_address="127.0.0.1:0"
        ) as cluster:
            given = {"backend": "dask", "scheduler": cluster.scheduler_address, "say": said.append}
            run_campaign(one, here.out, **given)
            run_campaign(one, here.out, **given)
    finally:
        end_idle()
    assert_same_bits(alone, here.out)
    assert "every run was finished already" in said
    with open_results(here.out) as results:
        assert list(results.provenance.machines.values()) == [2], "a block and a bound"
    assert machines_of(here.shards) == results.provenance.machines
    assert not list(here.shards.glob(".*")), "no token stays"


def test_without_the_package_a_sentence_names_the_extra(relnav, tmp_path, monkeypatch):
    here = relnav()
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RefusedError, match=re.escape("pip install 'relnav-sim[dask]'")):
        run_campaign(load_campaign(here.folder / "small.yaml"), tmp_path / "a.h5", backend="dask")
    assert not list(tmp_path.glob("a.h5*"))


@pytest.mark.parametrize(
    "options, sentence",
    [
        (("--scheduler", "tcp://a:1"), "--scheduler goes with --backend dask"),
        (("--local-cluster", "2", "--backend", "sequential"), "--local-cluster goes with --backend dask"),
        (("--backend", "dask", "--scheduler", "tcp://a:1", "--workers", "3"), "leave out --workers"),
        (("--backend", "dask", "--scheduler", "tcp://a:1", "--local-cluster", "3"), "leave out --local-cluster"),
        (("--backend", "dask", "--workers", "1", "--local-cluster", "3"), "leave out --workers"),
        (("--backend", "dask", "--scheduler", "myhost"), "a Dask scheduler's address is like tcp://host:8786"),
        (("--backend", "dask", "--scheduler", "tcp://myhost"), "a Dask scheduler's address is like tcp://host:8786"),
        (("--backend", "dask", "--scheduler", "tcp://a:99999"), "a Dask scheduler's address is like tcp://host:8786"),
    ],
)
def test_options_that_do_not_fit_together(relnav, monkeypatch, options, sentence):
    from typer.testing import CliRunner

    from relnav_sim.cli.app import app

    here = relnav()
    monkeypatch.chdir(here.folder)
    for words in (["run", "small.yaml", *options], ["tune", "small.yaml", *options]):
        done = CliRunner().invoke(app, words)
        if "address" not in sentence or words[0] == "run":
            assert done.exit_code == 2, done.output
            assert sentence in done.stderr and done.stderr.count("\n") == 1


def test_who_accepts_a_connection_and_says_nothing_is_no_scheduler(monkeypatch, recwarn):
    monkeypatch.setattr(dask_client, "LONGEST_CONNECTION_S", 0.5)
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        address = f"tcp://127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(WorkersError, match=f"no Dask scheduler answers at {address}"):
            dask_client.Connection(address, 1)
        gc.collect()  # its client would try to say good-bye, and raise that it can't
    assert not recwarn.list


@pytest.mark.slow
@pytest.mark.parametrize("victim", [WORKER, PROCESS])
def test_a_worker_that_is_killed_costs_nobody_a_run(relnav, reference, victim):
    here = relnav(*LONGER)
    process = here.start("run", "small.yaml", *LOCAL)
    assert wait_until(lambda: len(list(here.shards.glob("*.h5"))) >= 2 or process.poll() is not None)
    os.kill(next(pid for pid, command in members(process.pid).items() if victim in command), signal.SIGKILL)
    _, stderr = process.communicate(timeout=240)
    assert process.returncode == 0, stderr
    assert "Traceback" not in stderr and "distributed" not in stderr
    assert_same_bits(reference, here.out)
    assert wait_until(lambda: not members(process.pid), 10), members(process.pid)


@pytest.mark.slow
@pytest.mark.parametrize("kind, words", [("kills", "the worker process died"), ("holds", "took longer than 5 s")])
def test_a_run_that_kills_or_hangs_is_isolated(relnav, tmp_path, kind, words):
    environment = installed(tmp_path / "site", "bad_filters", PLUGIN)
    entries = f"\n  ekf: {{kind: ekf}}\n  raises: {{kind: raises}}\n  {kind}: {{kind: {kind}}}"
    one_case = ("[{kind: gaussian}, {kind: mixture, scale: 5, fraction: 0.1}]", "[{kind: gaussian}]")
    here = relnav(("\n  ekf: {kind: ekf}", entries), one_case, environment=environment)
    process = here.start("run", "small.yaml", *LOCAL, "--timeout-s", "5")
    _, stderr = process.communicate(timeout=240)
    assert process.returncode == 1, stderr
    with open_results(here.out) as results:
        assert not results.missing()
        for name in results.filters:
            expected = [0] * 6 if name in ("kf", "ekf") else [0, 0, 0, 1, 0, 0]
            assert results.statistic(0, name, "failed").tolist() == expected, name
        reasons = {failure.filter: failure.reason for _, failure in results.failures()}
    assert reasons[kind].startswith(words)
    assert reasons["raises"].startswith("ZeroDivisionError: too interesting (bad_filters.py:")
    assert "too interesting" in (here.shards / "failures.log").read_text()


@pytest.mark.slow
def test_ctrl_c_leaves_shards_and_no_process(relnav):
    here = relnav(*LONGER)
    process = here.start("run", "small.yaml", *LOCAL)
    assert wait_until(lambda: len(list(here.shards.glob("*.h5"))) >= 2 or process.poll() is not None)
    os.killpg(process.pid, signal.SIGINT)
    begin = time.monotonic()
    process.wait(timeout=20)
    assert time.monotonic() - begin < 3
    _, stderr = process.communicate(timeout=20)  # until its workers have noticed and ended
    assert process.returncode == 130
    assert stderr.splitlines()[-1].startswith("relnav: interrupted; what is finished is kept, and this continues it: ")
    assert "Traceback" not in stderr
    assert wait_until(lambda: not members(process.pid), 5), members(process.pid)
    assert len(list(here.shards.glob("*.h5"))) >= 2
    code, _, stderr = here.run("run", "small.yaml", *LOCAL)
    assert code == 0 and " finished blocks found; " in stderr, stderr


@pytest.fixture
def scheduler(tmp_path):
    """Return a maker of schedulers and workers, which are ended; the address comes with it."""
    started = []
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"

    def begin(command, **options):
        started.append(subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL, **options))
        return started[-1]

    class Made:
        tcp = address
        options = ("--backend", "dask", "--scheduler", address)

        def begin(self):
            return begin([*SCHEDULER, str(port)])

        def worker(self, *options, environment=None):
            return begin([*OF_SCHEDULER, *options, address], env={**os.environ, **(environment or {})})

    yield Made()
    for process in started:
        for pid in [*members(process.pid), process.pid]:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        process.wait()


@pytest.mark.slow
def test_late_workers_a_scheduler_that_dies_and_the_same_command_again(relnav, reference, scheduler):
    here = relnav(*LONGER)
    first = scheduler.begin()
    process = here.start("run", "small.yaml", *scheduler.options)
    waits = process.stderr.readline()
    assert waits == f"waiting for workers of {scheduler.tcp}; there are none yet\n"
    scheduler.worker()
    assert wait_until(lambda: len(list(here.shards.glob("*.h5"))) >= 2 or process.poll() is not None)
    first.kill()
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 3
    assert stderr.splitlines()[-1] == (
        f"relnav: the Dask scheduler is gone ({scheduler.tcp}); what is finished is kept, and the same command goes on "
        "once it is there again"
    )
    code, _, stderr = here.run("run", "small.yaml", *scheduler.options)
    assert code == 3 and f"no Dask scheduler answers at {scheduler.tcp}" in stderr
    scheduler.begin()
    scheduler.worker()
    code, _, stderr = here.run("run", "small.yaml", *scheduler.options)
    assert code == 0 and " finished blocks found; " in stderr, stderr
    assert_same_bits(reference, here.out)


@pytest.mark.slow
def test_a_worker_with_other_plug_ins_is_refused_by_name_and_another_one_works(relnav, tmp_path, scheduler):
    here = relnav()
    scheduler.begin()
    scheduler.worker(environment=installed(tmp_path / "site", "bad_filters", PLUGIN))
    code, _, stderr = here.run("run", "small.yaml", *scheduler.options)
    assert code == 2, stderr
    refused = r"the worker tcp://[\d.:]+ on \S+: it has plug-ins bad \(bad_filters 1\.0\), not none"
    assert re.search(refused, stderr) and "no Dask worker can compute this campaign" in stderr, stderr
    scheduler.worker()
    deadline = time.monotonic() + 60
    while code == 2 and time.monotonic() < deadline:  # until the other one has joined
        code, _, stderr = here.run("run", "small.yaml", *scheduler.options)
    assert code == 0 and "is not used: it has plug-ins" in stderr, stderr


@pytest.mark.slow
def test_workers_whose_time_ends_cost_nobody_a_run(relnav, reference, scheduler):
    here = relnav(*LONGER)
    scheduler.begin()
    for seconds in (60, 80):
        scheduler.worker("--lifetime", f"{seconds}s", "--lifetime-restart")
    code, _, stderr = here.run("run", "small.yaml", *scheduler.options)
    assert code == 0, stderr
    assert_same_bits(reference, here.out)


@pytest.mark.slow
@pytest.mark.parametrize("options", [(), ("--no-nanny",)], ids=["nanny", "no nanny"])
def test_all_processes_of_a_worker_are_told_to_end_and_nobody_is_to_blame(relnav, reference, scheduler, options):
    here = relnav(*LONGER)
    scheduler.begin()
    worker = scheduler.worker(*options)
    process = here.start("run", "small.yaml", *scheduler.options, "--log", "night.jsonl")
    assert wait_until(lambda: len(list(here.shards.glob("*.h5"))) >= 2 or process.poll() is not None)
    scheduler.worker(*options)
    for pid in [*members(worker.pid), worker.pid]:
        os.kill(pid, signal.SIGTERM)
    _, stderr = process.communicate(timeout=240)
    assert process.returncode == 0, stderr
    faults = [event["fault"] for event in read_events(here.folder / "night.jsonl") if event["event"] == "retry"]
    assert set(faults) <= {"sent back"}, faults
    assert_same_bits(reference, here.out)
