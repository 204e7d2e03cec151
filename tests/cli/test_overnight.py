"""What a night's command tells at its end: failures by kind with a command for one, and a command of the user's own."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from relnav_sim.cli.app import app
from relnav_sim.cli.notify import Notice, notifying
from relnav_sim.runner import fault_isolation

TEXT = """
name: night
seed: 5
runs: 4
block_runs: 2
bound: false
clock: {duration_s: 20, step_s: 1, store_every_s: 4}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [0, -2000, 100], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 100
    area_m2: 1
    drag_coefficient: 2.2
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.1}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}
statistics: {settle_s: 10, convergence_hold_s: 5}
filters:
  kf: {kind: kf}
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Work in a folder with a campaign."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "night.yaml").write_text(TEXT)
    return tmp_path


def invoke(*words):
    return CliRunner().invoke(app, list(words))


def test_failures_by_kind_and_the_notice(here, monkeypatch):
    simulate = fault_isolation.simulate_block

    def struck(case, seed, runs, *rest):
        if set(runs) & {1, 2}:
            raise ValueError(f"no such luck in {tuple(runs)}")
        return simulate(case, seed, runs, *rest)

    monkeypatch.setattr(fault_isolation, "simulate_block", struck)
    notify = "env | grep ^RELNAV_ > told; exit 3"
    done = invoke("run", "night.yaml", "--backend", "sequential", "--notify", notify, "--log", "night.log")
    assert done.exit_code == 1
    assert "2 of kind: ValueError in fault_isolation.py:" in done.output
    assert "first: case base, run 1; look into it: relnav run night.yaml --only 0:1 --trace" in done.output
    assert "the command of --notify ended with exit code 3" in done.output, "and the exit code is the campaign's"
    told = dict(line.split("=", 1) for line in (here / "told").read_text().splitlines())
    assert told.pop("RELNAV_SECONDS").isdecimal()
    told.pop("RELNAV_CACHE_DIR", None)  # where who runs the tests has set it
    assert told == {
        "RELNAV_RESULT": str(here / "results" / "night.h5"),
        "RELNAV_CAMPAIGN": "night",
        "RELNAV_EXIT_CODE": "1",
        "RELNAV_STATE": "finished",
        "RELNAV_SUMMARY": "night: 2 failed runs of filters",
        "RELNAV_FAILED": "2",
    }
    status = invoke("status")
    assert status.exit_code == 1 and "2 ValueError in fault_isolation.py:" in status.output


def test_a_campaign_that_can_not_be_used_is_noticed_once(here):
    done = invoke("run", "night.yaml", "--set", "runs=x", "--notify", "echo $RELNAV_EXIT_CODE $RELNAV_STATE >> told")
    assert done.exit_code == 2
    assert (here / "told").read_text() == "2 failed\n"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--shard", "slurm"], "there is no SLURM_ARRAY_TASK_ID here"),
        (["--shard", "slrum"], "takes I/N with I from 1 to N, as 1/4, or slurm, not 'slrum'"),
        (["--log", "."], "--log . is a directory"),
        (["--only", "0:1", "--log", "a"], "--log is of a campaign"),
    ],
)
def test_mistakes(here, words, sentence):
    done = invoke("run", "night.yaml", *words)
    assert done.exit_code == 2 and sentence in done.output
    assert not (here / "results").exists()


def test_a_log_in_no_folder(here):
    done = invoke("run", "night.yaml", "--log", "nowhere/night.log")
    assert done.exit_code == 3 and "nowhere/night.log: No such file or directory" in done.output
    assert not (here / "results").exists()


ENDS = [(typer.Exit(4), "4 failed"), (SystemExit(130), "130 interrupted"), (ZeroDivisionError(), "70 failed")]


@pytest.mark.parametrize(("end", "told"), ENDS)
def test_a_notice_is_sent_however_it_ends(tmp_path, end, told):
    notice = Notice(f"sleep 0.1; echo $RELNAV_EXIT_CODE $RELNAV_STATE >> {tmp_path}/told")
    with pytest.raises(type(end)), notifying(notice):
        raise end
    notice.send(0)
    assert notice.process.wait(20) == 0
    assert (tmp_path / "told").read_text() == f"{told}\n"


def events_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_a_search_is_logged_and_noticed_and_status_reads_its_log(here):
    words = ["--budget", "6", "--runs", "2", "--check-runs", "2", "--workers", "1", "--filter", "kf"]
    tell = "echo $RELNAV_STATE $RELNAV_RESULT $RELNAV_SUMMARY > told"
    done = invoke("tune", "night.yaml", *words, "--log", "search.jsonl", "--notify", tell)
    assert done.exit_code == 0, done.output
    assert (here / "told").read_text() == f"finished {here}/night_tuned.yaml night: 1 filter tuned\n"
    begin, *between, end = events_of(here / "search.jsonl")
    assert begin["event"] == "begin" and begin["campaign"] == "night" and begin["runs"] == 2
    assert begin["total"] == 6 * 2 + 2 * 2, "candidates on tuning runs, and two on those of the check"
    assert end["event"] == "end" and end["state"] == "finished" and end["done"] == end["total"]
    blocks = [event for event in between if event["event"] == "done"]
    assert {name for event in blocks for name in event["filters"]} >= {"kf 0", "kf 1"}
    assert sum(len(event["filters"]) * 2 for event in blocks) == end["done"]
    left = [event["eta_s"] for event in blocks]
    assert begin["eta_s"] > left[-1]
    status = invoke("status", "search.jsonl")
    assert status.exit_code == 0 and re.search(r"^log +search.jsonl$", status.output, re.MULTILINE)
    assert f"{end['done']} of {end['total']} runs of filters (100 %)" in status.output


def test_a_search_that_fails_says_so_in_its_log(here, monkeypatch):
    monkeypatch.setattr(fault_isolation, "simulate_block", lambda *given: 1 / 0)
    words = ["--budget", "6", "--runs", "2", "--check-runs", "0", "--workers", "1", "--log", "search.jsonl"]
    done = invoke("tune", "night.yaml", *words)
    assert done.exit_code == 2 and "no filter gets through" in done.output
    *_, last, end = events_of(here / "search.jsonl")
    assert last["failed"] > 0 and any(kind.startswith("ZeroDivisionError") for kind in last["kinds"])
    assert end["state"] == "failed" and "no filter gets through" in end["reason"]
    status = invoke("status", "search.jsonl")
    assert status.exit_code == 6 and "ZeroDivisionError" in status.output
    assert "the same command goes on" not in status.output, "a search begins anew"


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["tune", "night.yaml", "--log", "."], 2, "--log . is a directory; give a file's name"),
        (["tune", "night.yaml", "--log", "nowhere/a"], 3, "nowhere/a: No such file or directory"),
        (
            ["tune", "night.yaml", "--timeout-s", "9", "--backend", "sequential"],
            2,
            "--timeout-s needs worker processes",
        ),
        (["replay", "night.yaml", "-m", "night.yaml", "--log", "."], 2, "--log . is a directory; give a file's name"),
        (["status", "night.yaml"], 2, "'night.yaml' is neither a result file nor a log that --log has written"),
    ],
)
def test_mistakes_of_other_commands(here, words, code, sentence):
    done = invoke(*words)
    assert done.exit_code == code and sentence in done.output, done.output


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_campaign_is_noticed(here, number):
    command = ["relnav", "run", "night.yaml", "--set", "clock.duration_s=20000", "--runs", "400", "--notify"]
    notify = "echo $RELNAV_EXIT_CODE $RELNAV_STATE >> told"
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    process = subprocess.Popen([*command, notify], env={**os.environ, "PATH": path}, stderr=subprocess.DEVNULL)
    while not list(here.glob("results/night.h5.shards/*.h5")):
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(number)
    assert process.wait(30) == 128 + number
    time.sleep(1)
    assert (here / "told").read_text() == f"{128 + number} interrupted\n"
    assert invoke("status").exit_code == 6
