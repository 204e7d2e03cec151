"""`relnav tune` as a user runs it."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from relnav_sim.cli.app import app
from relnav_sim.cli.interrupts import LONGEST_END_S

ROOT = Path(__file__).parents[2]
TINY = [
    *["--set", "clock.duration_s=40", "--set", "clock.store_every_s=5", "--set", "statistics.settle_s=10"],
    *["--runs", "2", "--check-runs", "2", "--budget", "6", "--workers", "1"],
]
PSD = "acceleration_psd_m2_s3"


def invoke(*arguments):
    return CliRunner().invoke(app, ["tune", *(str(argument) for argument in arguments)])


@pytest.fixture
def demo(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("demo.yaml").write_text((ROOT / "campaigns" / "demo.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    return Path("demo.yaml")


def curve():
    return list(csv.DictReader(Path("demo_tuned_tuning.csv").read_text(encoding="utf-8").splitlines()))


def test_writes_the_tuned_campaign_and_the_curve(demo):
    result = invoke(demo, "--filter", "ekf", "--free", f"filters.ekf.process_noise.{PSD}=1e-6:1e-3", *TINY)
    assert result.exit_code == 0, result.output
    assert "ekf" in result.stdout and "next: relnav run demo_tuned.yaml --out results/demo_tuned.h5" in result.stdout
    before, after = demo.read_text(encoding="utf-8"), Path("demo_tuned.yaml").read_text(encoding="utf-8")
    rows = curve()
    assert len(rows) == 6
    (chosen,) = [row for row in rows if row["chosen"] == "1"]
    tuned = float(chosen[f"process_noise.{PSD}"])
    data = yaml.safe_load(before)
    data["filters"]["ekf"]["process_noise"][PSD] = tuned
    assert yaml.safe_load(after) == data
    # Nothing is lost, and what is new are a comment and the number.
    kept = [line for line in before.splitlines() if line in after.splitlines()]
    assert len(before.splitlines()) - len(kept) <= 1
    assert "# Tuned by relnav" in after and "While tuning: clock.duration_s=40" in after
    assert Path("demo_tuned_tuning.png").read_bytes()[:4] == b"\x89PNG"
    assert Path("demo_tuned_tuning.pdf").read_bytes()[:4] == b"%PDF"


def test_the_section_of_the_campaign_is_taken_and_the_command_line_wins(demo):
    section = "tune: {objective: velocity, budget: 5, runs: 2, check_runs: 0, free: {filters.kf.r_scale: [0.5, 2]}}\n"
    demo.write_text(demo.read_text(encoding="utf-8") + section, encoding="utf-8")
    result = invoke(demo, "--filter", "kf", *TINY[:6], "--workers", "1", "--budget", "7")
    assert result.exit_code == 0, result.output
    assert "objective: velocity RMS, settled; at most 7 candidates a filter, 2 runs" in result.stdout
    rows = curve()
    assert len(rows) == 7
    assert {float(row["r_scale"]) for row in rows} >= {0.5, 1.0, 2.0}
    assert all(0.5 <= float(row["r_scale"]) <= 2 for row in rows)


def test_the_section_names_the_filters_and_the_command_line_wins(demo):
    free = "{filters.ekf.process_noise.acceleration_psd_m2_s3: [1.0e-9, 1.0e-5], filters.kf.r_scale: [0.5, 2]}"
    section = f"tune: {{filters: [ekf], budget: 5, runs: 2, check_runs: 0, free: {free}}}\n"
    demo.write_text(demo.read_text(encoding="utf-8") + section, encoding="utf-8")
    assert invoke(demo, *TINY[:6], "--workers", "1").exit_code == 0
    assert {row["filter"] for row in curve()} == {"ekf"}
    assert invoke(demo, "--filter", "kf", *TINY[:6], "--workers", "1", "--overwrite").exit_code == 0
    assert {row["filter"] for row in curve()} == {"kf"}
    assert all(0.5 <= float(row["r_scale"]) <= 2 for row in curve())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--filter", "efk"], "no filter is named 'efk'; did you mean 'ekf'?"),
        (
            ["--set", "tune={free: {filters.ekf.nope: [0, 1]}}"],
            "tune.free.filters.ekf.nope: filters.ekf.nope is no number",
        ),
        (["--free", "filters.ekf.alpha=0:1"], "filters.ekf.alpha is no number of this campaign"),
        (["--filter", "ekf", "--free", "filters.kf.r_scale=1:2"], "is no number of the filters to tune: ekf"),
        (["--free", "filters.kf.r_scale=a:b"], "--free takes PATH=LOW:HIGH"),
        (["--free", "filters.kf.r_scale=0:1"], "does not take 0: input should be greater than 0"),
        (["--case", "7"], "the campaign has no case '7'; its cases are 0 to 1"),
        (["--set", "filters.ekf.kind=ukf"], "change the filters in the file"),
        (["--out", "demo.yaml"], "is the campaign itself"),
        (["--out", "nowhere/x.yaml"], "nowhere is no directory"),
        (["--budget", "2"], "budget"),
        (["--objective", "speed"], "objective"),
    ],
)
def test_wrong_input_is_one_sentence(demo, arguments, words):
    result = invoke(demo, *arguments)
    assert result.exit_code == 2, result.output
    assert words in " ".join(result.stderr.replace("│", " ").split())
    assert list(Path().iterdir()) == [demo]


def test_a_wrong_section_is_told_with_its_line(demo):
    demo.write_text("tune: {objectiv: both}\n" + demo.read_text(encoding="utf-8"), encoding="utf-8")
    result = invoke(demo)
    assert result.exit_code == 2
    assert "demo.yaml:1: tune.objectiv: unknown key; did you mean 'objective'?" in result.stderr


def test_validate_checks_the_section(demo):
    demo.write_text(
        "tune: {free: {filters.ekf.alpha: [0.1, 1]}}\n" + demo.read_text(encoding="utf-8"), encoding="utf-8"
    )
    result = CliRunner().invoke(app, ["validate", "demo.yaml"])
    assert result.exit_code == 2
    assert result.stderr.startswith("demo.yaml:1: tune.free.filters.ekf.alpha: filters.ekf.alpha is no number")


def test_validate_checks_the_filters_of_the_section(demo):
    demo.write_text("tune: {filters: [efk]}\n" + demo.read_text(encoding="utf-8"), encoding="utf-8")
    result = CliRunner().invoke(app, ["validate", "demo.yaml"])
    assert result.exit_code == 2
    assert result.stderr.startswith("demo.yaml:1: tune.filters: no filter is named 'efk'; did you mean 'ekf'?")


def test_nothing_is_overwritten_unasked(demo):
    Path("demo_tuned_tuning.csv").write_text("mine", encoding="utf-8")
    result = invoke(demo, *TINY)
    assert result.exit_code == 2
    assert "demo_tuned_tuning.csv exists already" in result.stderr
    assert Path("demo_tuned_tuning.csv").read_text(encoding="utf-8") == "mine"
    assert not Path("demo_tuned.yaml").exists()


@pytest.mark.slow
def test_ctrl_c_ends_it_within_two_seconds(demo):
    program = "from relnav_sim.cli.app import main; main()"
    command = [sys.executable, "-c", program, "tune", "demo.yaml", "--budget", "500"]
    scratch = demo.absolute().parent / "scratch"
    scratch.mkdir()
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(scratch)}
    process = subprocess.Popen(
        command,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # ignored where tests run in the background
    )
    try:
        limit = time.monotonic() + 60
        while not list(scratch.glob("relnav_tune_*")) and time.monotonic() < limit:
            time.sleep(0.1)
        time.sleep(1)
        asked = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) == 130
        assert time.monotonic() - asked < LONGEST_END_S + 1  # and some time for a busy machine
        _, words = process.communicate(timeout=20)
        assert "interrupted; nothing was written" in words
        assert sorted(Path().iterdir()) == [demo, Path("scratch")]
    finally:
        if process.poll() is None:
            process.kill()
