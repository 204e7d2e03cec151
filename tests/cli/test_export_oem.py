"""`relnav export --to oem`: written, read back by the `oem` package and by relnav, and refused where it can't be."""

from pathlib import Path

import numpy as np
import oem
import pytest
from typer.testing import CliRunner

from relnav_sim import load_campaign, load_ephemeris, open_results, rtn_from_eci, run_campaign, simulate
from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch
from relnav_sim.cli.app import app
from relnav_sim.recorded.oem_writing import OemOrbit, write_oem
from relnav_sim.truth import TruthOptions
from relnav_sim.truth.trajectory import force_model

CAMPAIGN = """name: small
seed: 3
runs: 2
clock: {duration_s: 300, step_s: 5, store_every_s: 10}
truth:
  epoch: 2016-12-31T23:57:30 UTC
  chief: {orbit: {a_km: 7137, e: 0.01, i_deg: 42}, mass_kg: 200, area_m2: 1}
  deputy: {relative: {position_m: [0, 1200, 300], velocity_m_s: [0, 0, 0.1]}, mass_kg: 100, area_m2: 1}
  dispersions: {relative_position: {kind: normal, sigma_m: 50}}
sensors: {radar: {range_sigma_m: 4, angle_sigma_deg: 0.0667}}
filters:
  ekf: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}
  cw: {kind: ekf, dynamics: {kind: cw}, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}
statistics: {settle_s: 100}
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    (folder / "small.yaml").write_text(CAMPAIGN, encoding="utf-8")
    return run_campaign(load_campaign(folder / "small.yaml"), folder / "small.h5", workers=1, backend="sequential")


def exported(result: Path, *words: str) -> str:
    found = CliRunner().invoke(app, ["export", str(result), *words, "--overwrite"])
    assert found.exit_code == 0, found.output
    return found.output


def peer_states(path: Path) -> Array:
    return np.array([[*each.position, *each.velocity] for each in oem.OrbitEphemerisMessage.open(path).states]) * 1e3


def test_true_orbits_come_back_to_a_micrometre(result: Path) -> None:
    exported(result, "--to", "oem", "--part", "truth", "--run", "1")
    flown = simulate(load_campaign(result.with_name("small.yaml")), runs=[1])
    for craft, states in (("chief", flown.chief[0, ::2]), ("deputy", flown.deputy[0, ::2])):
        path = result.with_name(f"small_truth_run1_{craft}.oem")
        found = load_ephemeris(path)
        np.testing.assert_array_equal(found.times_s, flown.times_s[::2])
        assert np.abs(found.states - states)[:, :3].max() <= 1e-8
        assert np.abs(found.states - states)[:, 3:].max() <= 1e-11


def test_true_orbits_are_read_by_the_oem_package(result: Path) -> None:
    text = (
        result.with_name("small.yaml").read_text(encoding="utf-8").replace("2016-12-31T23:57:30", "2021-06-30T23:57:30")
    )
    other = result.with_name("other.yaml")
    other.write_text(text, encoding="utf-8")
    out = run_campaign(load_campaign(other), result.with_name("other.h5"), workers=1, backend="sequential")
    exported(out, "--to", "oem", "--part", "truth")
    path = out.with_name("other_truth_run0_deputy.oem")
    np.testing.assert_allclose(peer_states(path), load_ephemeris(path).states, rtol=0, atol=1e-6)
    truth = simulate(load_campaign(other)).deputy[0, ::2]
    np.testing.assert_allclose(peer_states(path), truth, rtol=0, atol=1e-8)
    exported(out, "--to", "oem", "--part", "estimates", "--filter", "ekf")
    message = oem.OrbitEphemerisMessage.open(out.with_name("other_estimates_ekf_run0_deputy.oem"))
    with open_results(out) as results:
        stored = results.series(0, "ekf", 0)
    matrices = np.array([each.matrix for each in message.covariances]) * 1e6
    # Back into the chief's turning axes, by differences: the standard deviations that the filter states.
    found = load_campaign(other)
    truth = found.cases[0].config.truth
    assert isinstance(truth, TruthOptions)
    chief = simulate(found).chief[0, ::2]
    normal = force_model(truth).normal_acceleration(chief, truth.chief.ballistic_m2_kg)
    H = 1e5 * np.eye(6)
    columns = rtn_from_eci(chief[:, None], chief[:, None] + H, normal[:, None]) / 1e5
    back = np.swapaxes(columns, 1, 2) @ matrices @ columns
    sigma = np.sqrt(np.diagonal(back, axis1=1, axis2=2))
    np.testing.assert_allclose(sigma, stored.sigma, rtol=1e-5)


def test_estimates_are_those_of_the_result(result: Path) -> None:
    output = exported(result, "--to", "oem", "--part", "estimates", "--filter", "cw", "--run", "1")
    path = result.with_name("small_estimates_cw_run1_deputy.oem")
    assert output == f"wrote {path}\n"
    with open_results(result) as results:
        stored = results.series(0, "cw", 1)
    flown = simulate(load_campaign(result.with_name("small.yaml")), runs=[1])
    # Relative positions do not depend on how the frame turns; results store 32 bits.
    estimate = rtn_from_eci(flown.chief[0, ::2], load_ephemeris(path).states)
    error = (estimate - flown.relative[0, ::2])[:, :3]
    np.testing.assert_allclose(error, stored.error[:, :3], rtol=0, atol=1e-4)
    text = path.read_text(encoding="utf-8")
    assert "set on the true orbit of the chief" in text
    assert "COV_REF_FRAME = EME2000" in text


def test_an_exported_truth_flies_again(result: Path) -> None:
    exported(result, "--to", "oem", "--part", "truth")
    text = result.with_name("small.yaml").read_text(encoding="utf-8")
    begin, end = text.index("truth:"), text.index("sensors:")
    flown_again = result.with_name("again.yaml")
    files = "truth: {ephemeris: {chief: small_truth_run0_chief.oem, deputy: small_truth_run0_deputy.oem}}\n"
    flown_again.write_text(text[:begin] + files + text[end:], encoding="utf-8")
    first, again = (simulate(load_campaign(path)) for path in (result.with_name("small.yaml"), flown_again))
    # At the rows, and between them by interpolation.
    np.testing.assert_allclose(again.chief, first.chief, rtol=0, atol=1e-5)
    np.testing.assert_allclose(again.relative[..., :3], first.relative[..., :3], rtol=0, atol=1e-5)
    np.testing.assert_allclose(again.relative[..., 3:], first.relative[..., 3:], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--to", "oem"], "--to oem is no format of summary; give --part truth or --part estimates with it"),
        (["--part", "truth"], "truth is written as an OEM; give --to oem with it"),
        (["--to", "oem", "--part", "readings"], "--to oem is no format of measurements; give --part truth or --part"),
        (["--to", "oem", "--part", "estimates"], "the case has several filters; give --filter, one of ekf, cw"),
        (
            ["--to", "oem", "--part", "estimates", "--filter", "kf"],
            "the case has no filter 'kf'; its filters are ekf, cw",
        ),
        (["--to", "oem", "--part", "truth", "--filter", "ekf"], "--filter chooses estimates; give --part estimates"),
        (["--to", "oem", "--part", "truth", "--run", "7"], "holds no run 7; its runs go from 0 to 1"),
        (["--to", "oem", "--part", "truth", "--out", "one.oem"], "2 orbits go to 2 files; give --out a folder, as one"),
    ],
)
def test_what_can_not_be_written_is_refused(result: Path, words: list[str], sentence: str) -> None:
    found = CliRunner().invoke(app, ["export", str(result), *words])
    assert found.exit_code == 2
    assert sentence in " ".join(found.output.split())


def test_a_campaign_without_a_calendar_is_refused(tmp_path: Path) -> None:
    (tmp_path / "c.yaml").write_text(CAMPAIGN.replace("  epoch: 2016-12-31T23:57:30 UTC\n", ""), encoding="utf-8")
    out = run_campaign(load_campaign(tmp_path / "c.yaml"), tmp_path / "c.h5", workers=1, backend="sequential")
    found = CliRunner().invoke(app, ["export", str(out), "--to", "oem", "--part", "truth"])
    assert found.exit_code == 2
    assert "an OEM holds calendar dates, and the campaign has none; give it a truth.epoch" in " ".join(
        found.output.split()
    )


def test_zeros_are_written_as_zeros(tmp_path: Path) -> None:
    path = tmp_path / "zero.oem"
    states = np.array([[7e6, 0.0, -0.0, 0.0, 7500.0, 1e-12]] * 2)
    epoch = Epoch.parse("2021-07-10T16:00:00 UTC")
    write_oem(path, OemOrbit("ONE", epoch, np.array([0.0, 1.0]), states, np.zeros((2, 6, 6))), epoch)
    words = {word for line in path.read_text().splitlines() for word in line.split() if float_like(word) == 0}
    assert words == {"0.0000000000000000e+00", "-0.0000000000000000e+00"}


def float_like(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return np.nan


def test_the_result_itself_is_not_replaced(result: Path) -> None:
    before = result.read_bytes()
    words = ["--to", "oem", "--part", "estimates", "--filter", "ekf", "--out", str(result), "--overwrite"]
    found = CliRunner().invoke(app, ["export", str(result), *words])
    assert found.exit_code == 2
    assert "is the result itself; give another --out" in " ".join(found.output.split())
    assert result.read_bytes() == before
