"""`relnav replay` as a user types it: export, replay, report; and every mistake in one sentence."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from relnav_sim.campaign import load_campaign
from relnav_sim.cli.app import app
from relnav_sim.filters.ekf import ExtendedKalmanFilter
from relnav_sim.recorded.readings_csv import write_csv
from relnav_sim.results import open_results
from relnav_sim.runner.run import run_campaign
from relnav_sim.sensors import readings_layout
from relnav_sim.simulation.recording import record

TEXT = """
name: pass
seed: 4
runs: 3
clock: {duration_s: 300, step_s: 1, store_every_s: 5}
truth:
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 0, argp_deg: 0, ta_deg: 0}
    mass_kg: 200
    area_m2: 1
  deputy:
    relative: {position_m: [0, -2000, 100], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 100
    area_m2: 1
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.1}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.05}
  star_tracker: {cross_boresight_sigma_arcsec: 10, about_boresight_sigma_arcsec: 30}
start: {kind: first_fix, velocity_sigma_m_s: 0.5}
filters:
  ekf: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-9}}
  hasty: {kind: ukf, dynamics: {kind: cw}, assumed_noise: nominal, process_noise: {acceleration_psd_m2_s3: 1.0e-2}}
statistics: {settle_s: 100}
"""


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """A folder with a campaign, its result, and measurements of its runs 0 and 2."""
    folder = tmp_path_factory.mktemp("flight")
    (folder / "pass.yaml").write_text(TEXT)
    campaign = load_campaign(folder / "pass.yaml")
    run_campaign(campaign, folder / "pass.h5", backend="sequential")
    layout = readings_layout(campaign.cases[0].config.sensors)
    for one in record(campaign.cases[0].config, campaign.seed, [0, 2]):
        write_csv(folder / f"run{one.run}.csv", one, layout)
    return folder


@pytest.fixture
def relnav(flight, tmp_path, monkeypatch, unrendered):
    shutil.copytree(flight, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)

    def call(*words):
        return CliRunner().invoke(app, [str(word) for word in words])

    return call


def test_exported_readings_give_the_campaigns_own_numbers(relnav, tmp_path):
    done = relnav("replay", "pass.yaml", "--measurements", "run0.csv", "run2.csv")
    assert done.exit_code == 0, done.output
    assert "ekf is consistent" in done.output and "hasty is conservative" in done.output
    assert "scored against the truth that the campaign simulates, whose measurements these are" in done.output
    with open_results("pass.h5") as flown, open_results("results/pass.replay/result.h5") as again:
        a, b = flown.summary(), again.summary()
        kept = a["run"] != 1
        assert b["run"].tolist() == a["run"][kept].tolist()
        for name, column in a.items():
            if "cpu" not in name:
                np.testing.assert_array_equal(b[name], column[kept], err_msg=name)
        assert again.replay is not None and list(again.replay.files) == ["run0.csv", "run2.csv"]
    shown = relnav("inspect", "results/pass.replay/result.h5").output
    assert "run0.csv  SHA-256" in shown and "not finished" not in shown
    assert relnav("report", "results/pass.replay/result.h5").exit_code == 0


def test_a_replay_is_logged_and_noticed(relnav, tmp_path):
    tell = "echo $RELNAV_STATE $RELNAV_FAILED $RELNAV_SUMMARY > told"
    words = ("replay", "pass.yaml", "-m", "run0.csv", "run2.csv", "--log", "night.jsonl", "--notify", tell)
    assert relnav(*words).exit_code == 0
    assert (tmp_path / "told").read_text() == "finished 0 pass: 2 recorded runs replayed\n"
    begin, start, done, end = map(json.loads, (tmp_path / "night.jsonl").read_text().splitlines())
    assert [begin["event"], start["event"], done["event"], end["event"]] == ["begin", "start", "done", "end"]
    assert begin["total"] == end["done"] == 2 * 2 and end["state"] == "finished"
    assert start["runs"] == [0, 2] and start["filters"] == ["ekf", "hasty"] and done["memory_mb"] > 10
    status = relnav("status", "night.jsonl")
    assert status.exit_code == 0 and "4 of 4 runs of filters (100 %)" in status.output


def test_without_a_truth_nothing_is_called_accuracy(relnav, tmp_path):
    done = relnav("replay", "pass.yaml", "--measurements", "run0.csv", "--truth", "none", "--filter", "ekf")
    assert done.exit_code == 0, done.output
    assert "not scored" in done.output and "RMS" not in done.output
    folder = tmp_path / "results" / "pass.replay"
    assert not (folder / "result.h5").exists()
    page = (folder / "index.html").read_text()
    assert page.index("ekf is consistent") < page.index("No truth is known") and "ANEES" not in page
    assert {path.name for path in (folder / "figures").glob("*.png")} == {
        "residuals_ekf.png",
        "nis_ekf.png",
        "autocorrelation_ekf.png",
    }
    estimates = np.genfromtxt(folder / "estimates.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert len(estimates) == 301 and estimates["x_m"].dtype == float


def test_a_replay_without_truth_leaves_no_scored_result_of_an_earlier_one(relnav, tmp_path):
    words = ("replay", "pass.yaml", "--measurements", "run0.csv", "--filter", "ekf")
    assert relnav(*words).exit_code == 0
    assert relnav(*words).exit_code == 2  # there is something already
    assert relnav(*words, "--overwrite", "--truth", "none").exit_code == 0
    assert not (tmp_path / "results" / "pass.replay" / "result.h5").exists()


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--filter", "efk"], "no filter is named 'efk'; did you mean 'ekf'?"),
        (["--participant", "radar"], "--participant 'radar' is not NAME=SENSOR"),
        (["--participant", "B=rader"], "no sensor is named 'rader'; did you mean 'radar'?"),
        (["--participant", "B=radar", "--participant", "B=gnss"], "gives B two sensors, radar and gnss"),
        (["--run", "7"], "the files hold no run 7; they hold run 0"),
        (["--case", "4"], "the campaign has no case '4'"),
        (["--set", "clock.duration_s=200"], "run0.csv:206: radar reads at 201 s, after the campaign's end at 200 s"),
        (["--set", "clock.step_s=2", "--set", "clock.store_every_s=10"], "both in the step that ends at 2 s"),
    ],
)
def test_mistakes_are_one_sentence(relnav, words, sentence):
    done = relnav("replay", "pass.yaml", "--measurements", "run0.csv", *words)
    assert done.exit_code == 2
    assert sentence in done.output
    assert len(done.output.strip().splitlines()) == 1


TDM = """CCSDS_TDM_VERS = 2.0
CREATION_DATE = 2026-01-01T00:00:00
ORIGINATOR = TEST
META_START
TIME_SYSTEM = UTC
PARTICIPANT_1 = ALPHA
PARTICIPANT_2 = BRAVO
MODE = SEQUENTIAL
PATH = 2,1
RANGE_UNITS = km
META_STOP
DATA_START
RANGE = 2026-01-01T00:00:01 2.0025
RANGE = 2026-01-01T00:00:02 2.0026
DATA_STOP
"""


def test_a_participant_stands_for_a_sensor(relnav, tmp_path):
    (tmp_path / "range.tdm").write_text(TDM)
    second = "sensors.second={kind: radar, range_sigma_m: 5, angle_sigma_deg: 1}"
    words = ["replay", "pass.yaml", "-m", "range.tdm", "-m", "run0.csv", "--set", second]
    words += ["--set", "truth.epoch=2026-01-01T00:00:00 UTC", "--truth", "none", "--filter", "ekf"]
    refused = relnav(*words)
    assert refused.exit_code == 2
    assert "range.tdm:4: which sensor" in refused.output and "give --participant NAME=SENSOR" in refused.output
    done = relnav(*words, "--participant", "BRAVO=second")
    assert done.exit_code == 0, done.output
    assert re.search(r"^ekf +second +2 ", done.output, re.MULTILINE), done.output


def test_a_filter_that_breaks_or_fails_leaves_the_others(relnav, monkeypatch):
    update = ExtendedKalmanFilter.update

    def broken(self, belief, z, step):
        if step.epoch == 40:
            raise RuntimeError("wires crossed")
        return update(self, belief, z, step)

    monkeypatch.setattr(ExtendedKalmanFilter, "update", broken)
    done = relnav("replay", "pass.yaml", "--measurements", "run0.csv", "--overwrite")
    assert done.exit_code == 1
    assert "ekf broke: RuntimeError: wires crossed" in done.output
    assert "wires crossed" in Path("results/pass.replay/index.html").read_text()
    done = relnav("replay", "pass.yaml", "--measurements", "run0.csv", "--overwrite", "--filter", "ekf")
    assert done.exit_code == 1 and "wires crossed" in done.output
    assert not Path("results/pass.replay/result.h5").exists()  # nothing is left to put into it


def test_readings_that_end_before_anything_is_settled(relnav):
    short = Path("run0.csv").read_text().splitlines()[:60]
    Path("short.csv").write_text("\n".join(short) + "\n")
    done = relnav("replay", "pass.yaml", "--measurements", "short.csv", "--filter", "ekf")
    assert done.exit_code == 0
    assert "warning: nothing is settled: the replay ends at 55 s, statistics.settle_s is 100 s" in done.output


def test_a_file_that_is_not_there(relnav):
    done = relnav("replay", "pass.yaml", "--measurements", "run9.csv")
    assert done.exit_code == 3 and "run9.csv" in done.output


def test_a_result_of_recorded_readings_is_not_merged_with_others(relnav):
    assert relnav("replay", "pass.yaml", "--measurements", "run0.csv", "--filter", "ekf").exit_code == 0
    done = relnav("merge", "all.h5", "results/pass.replay/result.h5")
    assert done.exit_code == 2 and "of recorded measurements" in done.output


@pytest.mark.parametrize("change", ["seed=5", "truth.chief.orbit.a_km=7500", "sensors.radar.range_sigma_m=2.5"])
def test_readings_of_another_campaign_are_told_where_they_differ(relnav, tmp_path, change):
    done = relnav("replay", "pass.yaml", "--measurements", "run0.csv", "--filter", "ekf", "--set", change)
    assert done.exit_code == 0, done.output
    assert re.search(
        r"The measurements are not those that the campaign simulates with seed [45]: run 0 differs first in radar "
        r"at \d+ s \(run0\.csv:\d+\)\.",
        done.output,
    )
    page = (tmp_path / "results" / "pass.replay" / "index.html").read_text()
    assert "run 0 differs first in radar" in page


def test_readings_in_another_unit_are_no_matter_of_tuning(relnav, tmp_path):
    lines = [line for line in (tmp_path / "run0.csv").read_text().splitlines() if not line.startswith("#")]
    place = next(number for number, name in enumerate(lines[0].split(",")) if "range" in name)
    rows = [line.split(",") for line in lines[1:]]
    for row in rows[1:]:  # the first one starts the filter
        row[place] = repr(float(row[place]) / 1e3) if row[place] else ""
    (tmp_path / "km.csv").write_text("\n".join([lines[0], *(",".join(row) for row in rows)]))
    done = relnav("replay", "pass.yaml", "--measurements", "km.csv", "--filter", "ekf")
    assert "check the units, frame and times of the measurements" in done.output
    own = relnav("replay", "pass.yaml", "--measurements", "run0.csv", "--overwrite")
    assert "check the units" not in own.output
