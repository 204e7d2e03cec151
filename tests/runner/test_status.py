"""The log of a campaign and what `relnav status` makes of it: running, finished, interrupted, killed, torn lines."""

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from relnav_sim import run_campaign
from relnav_sim.cli.app import app
from relnav_sim.results.failure_kinds import KILLED, NO_MEMORY, TIMEOUT, kind_of
from relnav_sim.runner.compute import Outcome
from relnav_sim.runner.event_log import EventLog, read_events
from relnav_sim.runner.executors.interface import Ended, Fault
from relnav_sim.runner.job import Job
from relnav_sim.runner.process_mark import is_alive, process_mark
from relnav_sim.runner.status import State, status_from, status_of
from relnav_sim.runner.watch import Watch
from relnav_sim.runner.work import blocks_left

T0 = datetime(2026, 1, 1, tzinfo=UTC)


def at(seconds, event, **told):
    return {"time": (T0 + timedelta(seconds=seconds)).isoformat(), "event": event, **told}


def begin(**told):
    return at(0, "begin", **{"found": 4, "total": 12, "eta_s": 90.0, **process_mark(), **told})


def test_of_a_running_campaign():
    start = {"case": "x", "runs": [0, 3], "filters": ["kf"], "host": "a", "expected_s": 5.0}
    events = [
        begin(),
        at(1, "start", block="one", **start),
        at(2, "start", block="two", **start),
        at(10, "done", block="one", kinds={"E in f.py:1": 2}, memory_mb=120.0, done=4, total=12, retries=1, eta_s=50.0),
        at(70, "slow", block="two"),
    ]
    status = status_from(events, T0 + timedelta(seconds=80))
    assert (status.state, status.done, status.total, status.failures, status.retries) == (State.RUNNING, 8, 16, 2, 1)
    assert status.left_s == pytest.approx(0.0) and status.memory_mb == 120.0 and status.kinds == {"E in f.py:1": 2}
    (block,) = status.running
    assert (block.runs, block.is_slow, block.elapsed_s) == ((0, 3), True, 78.0)
    assert status_from(events, T0 + timedelta(seconds=30)).left_s == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("mark", "seconds", "state"),
    [
        ({"pid": 2**22 + 1}, 1, State.KILLED),
        ({"pid_start": 1}, 1, State.KILLED),
        ({"pid": "x"}, 1, State.KILLED),
        ({"host": "elsewhere"}, 100, State.RUNNING),
        ({"host": "elsewhere"}, 1000, State.SILENT),
    ],
)
def test_of_a_command_without_an_end(mark, seconds, state):
    assert status_from([begin(**mark)], T0 + timedelta(seconds=seconds)).state is state


def test_of_a_command_that_came_after_one_that_was_killed():
    events = [begin(pid=2**22 + 1), at(5, "start", block="b"), begin(found=6, total=2), at(9, "end", state="finished")]
    status = status_from(events, T0)
    assert status.state is State.FINISHED and status.total == 8 and not status.running
    assert status_from([at(9, "beat")], T0) is None


def test_a_mark_is_of_a_process_and_not_of_its_number():
    mark = process_mark()
    assert is_alive(mark) and mark["pid"] == os.getpid() and mark["host"] == platform.node()
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    assert is_alive({**mark, "pid": ended.pid}) is False


def test_torn_lines_cost_only_themselves(tmp_path):
    path = tmp_path / "log"
    with EventLog(path) as log:
        log.write(at(0, "one", nan=float("nan"), bad="\udcff\n"))
    with open(path, "ab") as file:
        file.write(b'{"time": "2026-01-01T00:00:00+00:00", "event": "to')
    with EventLog(path) as log:
        log.write(at(1, "two"))
    with open(path, "ab") as file:
        file.write(b'[1]\n{"event": 3}\n\xff\xfe\n{"time": "x", "event": "three"}\n{"time": "2026')
    assert [event["event"] for event in read_events(path)] == ["one", "two"]
    assert next(read_events(path))["nan"] is None


def test_a_full_disk_does_not_end_the_campaign():
    if not os.path.exists("/dev/full"):
        pytest.skip("no full device here")
    with EventLog("/dev/full") as log:
        log.write(at(0, "one"))
        assert log.error is not None


def test_kinds():
    assert kind_of("the worker process died: killed by the system") == KILLED
    assert kind_of("took longer than 3 s") == TIMEOUT
    assert kind_of("not enough memory: MemoryError") == NO_MEMORY
    assert kind_of("ValueError: row (3) of 17 (a b.py:3) (ekf.py:41)") == "ValueError in ekf.py:41"
    assert kind_of("x = 3.2e-5 after 17 steps") == kind_of("x = -1 after 2 steps") == "x = # after # steps"
    assert kind_of("") == "no reason told"


@pytest.fixture
def watched(campaign, tmp_path, monkeypatch):
    """Return a watch of blocks with a clock that is set by hand, what it says, and the blocks."""
    clock, said = [0.0], []
    monkeypatch.setattr("relnav_sim.runner.watch.time.monotonic", lambda: clock[0])
    blocks = list(blocks_left(campaign("block_runs=2"), {}, tmp_path))
    watch = Watch(said.append)
    watch.expect(blocks)
    with watch.logging(tmp_path, [tmp_path / "log.jsonl"]):
        yield SimpleNamespace(watch=watch, blocks=blocks, clock=clock, said=said, log=tmp_path / "log.jsonl")


def test_a_block_that_takes_far_longer_than_its_like_is_told_once(watched):
    watch, (first, second, *_) = watched.watch, watched.blocks
    watch.began(first, "here")
    watched.clock[0] = 20.0
    watch.ended(Ended(first, Outcome(0, {}, seconds=20.0)), 0)
    watch.began(second, "there")
    for moment in (40.0, 119.0):
        watched.clock[0] = moment
        watch.look()
    assert not watched.said
    for moment in (121.0, 150.0):
        watched.clock[0] = moment
        watch.look()
    (sentence,) = watched.said
    assert "runs 2 to 3" in sentence and "on there" in sentence and "its like took 20 s" in sentence
    assert watch.trouble_in_words() == "1 slow"
    assert [event["event"] for event in read_events(watched.log)].count("slow") == 1


def test_a_killed_worker_and_failures_are_told(watched):
    watch, (first, *_) = watched.watch, watched.blocks
    watch.began(first, "here")
    watch.ended(Ended(first, None, Fault.KILLED, "the worker process died: out of memory"), None)
    (sentence,) = watched.said
    assert sentence.startswith("a worker process on ") and "died while it computed case" in sentence
    watch.began(first, "here")
    watch.look()
    watch.ended(Ended(first, Outcome(3, {}, {"E in f.py:1": 3}, 2.0, 5 * 10**7)), 3)
    assert "3 of case" in watched.said[1] and "E in f.py:1" in watched.said[1]
    assert watch.trouble_in_words() == "3 failed, 1 tried again"
    done = list(read_events(watched.log))[-1]
    assert (done["failures"], done["retries"], done["memory_mb"], done["done"], done["total"]) == (3, 1, 50.0, 4, 24)
    assert done["eta_s"] > 0


def test_the_command_from_another_terminal(campaign, tmp_path, monkeypatch):
    ours = campaign("grid={}", "block_runs=2", "bound=false")
    out, log = tmp_path / "out.h5", tmp_path / "night.log"
    accept = Job.accept

    def looked_at(job, done):
        accept(job, done)
        seen = CliRunner().invoke(app, ["status", str(out), "--json"])
        told = json.loads(seen.output)
        assert seen.exit_code == 0 and told["state"] == "running" and told["done"] == 4 and told["total"] == 12
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Job, "accept", looked_at)
        with pytest.raises(KeyboardInterrupt):
            run_campaign(ours, out, backend="sequential", log=log)
    seen = CliRunner().invoke(app, ["status", str(out)])
    assert seen.exit_code == 6 and "interrupted" in seen.output and "4 of 12 runs of filters (33 %)" in seen.output
    run_campaign(ours, out, backend="sequential", log=log)
    seen = CliRunner().invoke(app, ["status", f"{out}.shards"])
    assert seen.exit_code == 0 and "finished" in seen.output and "12 of 12" in seen.output
    assert status_of(out).failures == 0
    other = tmp_path / f"{'long_' * 20}.h5"
    shutil.copytree(f"{out}.shards", f"{other}.shards")
    seen = CliRunner().invoke(app, ["status", str(out), str(other)])
    assert re.sub(r" +", " ", seen.output).count("finished 12 of 12") == 2, "a long name leaves the columns whole"
    ours = [event["event"] for event in read_events(log)]
    assert ours == [event["event"] for event in read_events(tmp_path / "out.h5.shards" / "log.jsonl")]
    assert ours == ["begin", "start", "done", "end", "begin", "start", "done", "start", "done", "end"]
    assert CliRunner().invoke(app, ["status", str(tmp_path / "none.h5")]).exit_code == 3
    assert CliRunner().invoke(app, ["status", str(tmp_path)]).exit_code == 2
