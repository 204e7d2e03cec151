"""`relnav export --part readings`: the files hold what the runs of the result were given."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from relnav_sim import load_campaign, simulate
from relnav_sim.astro.epoch import Epoch
from relnav_sim.cli.app import app
from relnav_sim.recorded.readings_files import load_readings
from relnav_sim.sensors import readings_layout

TEXT = """
name: small
seed: 5
runs: 3
bound: false
clock: {duration_s: 20, step_s: 0.5, store_every_s: 5}
truth:
  epoch: 2016-12-31T23:59:50 UTC
  chief:
    orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 10, argp_deg: 20, ta_deg: 30}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  deputy:
    relative: {position_m: [20, -2000, 300], velocity_m_s: [0.05, 0, 0.1]}
    mass_kg: 200
    area_m2: 1
    drag_coefficient: 2.2
  forces: {zonals: 4, drag: exponential}
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.05, period_s: 1.5}
  gnss: {position_sigma_m: 30, velocity_sigma_m_s: 0.15}
start: {kind: dispersed, position_sigma_m: [5, 5, 5], velocity_sigma_m_s: [0.1, 0.1, 0.1]}
filters:
  ekf: {kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}
grid: {sensors.radar.range_sigma_m: [2, 4]}
statistics: {settle_s: 10}
"""
SET = "truth.deputy.mass_kg=150"


def invoke(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def succeeds(*arguments):
    result = invoke(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


def fails(*arguments):
    result = invoke(*arguments)
    assert result.exit_code == 2, result.output
    assert isinstance(result.exception, SystemExit)
    return result.stderr


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("computed")
    (folder / "small.yaml").write_text(TEXT)
    for name, more in (("small.h5", []), ("timeless.h5", ["--set", "truth.epoch=null"])):
        changes = ["--set", SET, *more, "--backend", "sequential", "--out", folder / name]
        succeeds("run", folder / "small.yaml", *changes)
    return folder


@pytest.fixture
def here(tmp_path, monkeypatch, computed):
    for path in computed.iterdir():
        if path.is_file():
            shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def campaign(computed):
    return load_campaign(computed / "small.yaml", [SET])


def read(campaign, *files, epoch=None):
    (readings,) = load_readings(files, readings_layout(campaign.cases[0].config.sensors), epoch)
    return readings


def on_grid(readings, name, width):
    z = np.full((41, width), np.nan)
    z[np.rint(readings.sensors[name].times_s / 0.5).astype(int)] = readings.sensors[name].values
    return z


def test_csv_holds_the_bits_that_were_filtered(here, campaign):
    said = succeeds("export", "small.h5", "--part", "readings", "--case", 1, "--run", 2, "--run", 0)
    assert said == "wrote small_readings_case1_run0.csv\nwrote small_readings_case1_run2.csv\n"
    for run in (0, 2):
        readings = read(campaign, f"small_readings_case1_run{run}.csv")
        simulation = simulate(campaign, case=1, runs=[run])
        assert readings.run == run
        assert on_grid(readings, "radar", 3).tobytes() == simulation.z["radar"][0].tobytes()
        assert on_grid(readings, "gnss", 6).tobytes() == simulation.z["gnss"][0].tobytes()
        # A receiver and no star tracker: the attitude is that of the true orbit.
        assert on_grid(readings, "chief_orbit", 6).tobytes() == simulation.chief[0].tobytes()
        assert np.diagonal(readings.start.covariance).tolist() == pytest.approx([25, 25, 25, 0.01, 0.01, 0.01])
    head = Path("small_readings_case1_run2.csv").read_text().splitlines()[:6]
    assert head[0] == "# campaign: small"
    assert "# seed: 5" in head and "# run: 2" in head
    assert "# epoch: 2016-12-31T23:59:50 UTC" in head


def test_some_sensors_alone(here, campaign):
    """So that measured readings can take the place of one sensor's."""
    succeeds("export", "small.h5", "--part", "readings", "--sensor", "gnss", "--sensor", "chief_orbit")
    readings = read(campaign, "small_readings_case0_run0.csv")
    assert set(readings.sensors) == {"gnss", "chief_orbit"}
    assert on_grid(readings, "gnss", 6).tobytes() == simulate(campaign, runs=[0]).z["gnss"][0].tobytes()
    assert readings.start is not None
    said = fails("export", "small.h5", "--part", "readings", "--sensor", "gns", "--overwrite")
    assert "no sensor is named 'gns'; did you mean 'gnss'" in said
    assert "give --part readings" in fails("export", "small.h5", "--sensor", "gnss")


def test_tdm_with_a_csv_file_for_the_rest(here, campaign):
    said = succeeds("export", "small.h5", "--part", "readings", "--to", "tdm", "--out", "made/")
    assert said == ("wrote made/small_readings_case0_run0.tdm: radar\nwrote made/small_readings_case0_run0.csv\n")
    files = "made/small_readings_case0_run0.tdm", "made/small_readings_case0_run0.csv"
    readings = read(campaign, *files, epoch=Epoch.parse("2016-12-31T23:59:50 UTC"))
    simulation = simulate(campaign, case=0, runs=[0])
    assert (readings.run, readings.notes) == (0, ())
    np.testing.assert_allclose(on_grid(readings, "radar", 3), simulation.z["radar"][0], rtol=4 * 2.0**-52)
    assert on_grid(readings, "gnss", 6).tobytes() == simulation.z["gnss"][0].tobytes()
    # The leap second at the end of 2016 has readings of its own.
    assert "2016-12-31T23:59:60" in Path(files[0]).read_text()


def test_what_is_refused(here):
    readings = ["export", "small.h5", "--part", "readings"]
    assert "holds no run 3; its runs go from 0 to 2" in fails(*readings, "--run", 3)
    assert "no case '7'" in fails(*readings, "--case", 7)
    assert "2 runs go to 2 files; give --out a folder" in fails(*readings, "--run", 0, "--run", 1, "--out", "one.csv")
    assert "give --part readings" in fails("export", "small.h5", "--run", 1)
    assert "give --part readings" in fails("export", "small.h5", "--to", "tdm")
    assert "give it a truth.epoch" in fails("export", "timeless.h5", "--part", "readings", "--to", "tdm")
    assert "give --out another ending" in fails(*readings, "--to", "tdm", "--out", "a.csv")
    Path("small_readings_case0_run0.csv").write_text("mine")
    for to in ("csv", "tdm"):
        assert "exists already" in fails(*readings, "--to", to)
    assert Path("small_readings_case0_run0.csv").read_text() == "mine"
    assert not Path("small_readings_case0_run0.tdm").exists()
    succeeds(*readings, "--overwrite")


def test_the_result_itself_is_never_written_over(here):
    before = Path("small.h5").read_bytes()
    fails("export", "small.h5", "--part", "readings", "--out", "small.h5", "--overwrite")
    assert Path("small.h5").read_bytes() == before
