"""A truth from two files of orbits: the orbits themselves, what filters are told, what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from orbit_files import EPOCH, MU_M3_S2, RADIUS_M, calendar, circular, oem_text

from relnav_sim import CampaignError, eci_from_itrf, itrf_from_eci, load_campaign, run_campaign, simulate
from relnav_sim.campaign import Campaign
from relnav_sim.campaign.recorded_orbits import recorded_orbits
from relnav_sim.campaign.warnings import campaign_warnings, flown_warnings
from relnav_sim.results.block import RefusedError
from relnav_sim.streams import RandomSource
from relnav_sim.truth import EphemerisTruthOptions, nominal_chief, truth_trajectory
from relnav_sim.truth.flown_orbits import _flown, _read

ARCSEC = np.pi / 180 / 3600
TIMES = np.arange(0.0, 1500.0, 30.0)
AHEAD_RAD = 1e4 / RADIUS_M
CAMPAIGN = """name: recorded
seed: 1
runs: 2
clock: {duration_s: 600, step_s: 10, store_every_s: 10}
truth:
  ephemeris: {chief: a.oem, deputy: b.oem}
sensors: {radar: {range_sigma_m: 4, angle_sigma_deg: 0.0667}}
filters:
  ekf: {kind: ekf, dynamics: {kind: nonlinear_j2}, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}
statistics: {settle_s: 100}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.oem").write_text(oem_text(TIMES, circular(TIMES), more=""), encoding="utf-8")
    (tmp_path / "b.oem").write_text(oem_text(TIMES, circular(TIMES, AHEAD_RAD), more=""), encoding="utf-8")
    (tmp_path / "c.yaml").write_text(CAMPAIGN, encoding="utf-8")
    return tmp_path


def campaign(folder: Path, *changes: str) -> Campaign:
    return load_campaign(folder / "c.yaml", changes)


def problems(folder: Path, *changes: str) -> list[str]:
    with pytest.raises(CampaignError) as caught:
        campaign(folder, *changes)
    return [problem.replace(f"{folder}/", "") for problem in caught.value.problems]


def options(found: Campaign) -> EphemerisTruthOptions:
    truth = found.cases[0].config.truth
    assert isinstance(truth, EphemerisTruthOptions)
    return truth


def test_the_craft_fly_the_orbits_of_the_files(folder: Path) -> None:
    flown = simulate(campaign(folder), runs=[0, 1])
    np.testing.assert_allclose(flown.chief[1], circular(flown.times_s), rtol=0, atol=1e-6)
    np.testing.assert_allclose(flown.deputy[0], circular(flown.times_s, AHEAD_RAD), rtol=0, atol=1e-6)
    # On the same circle the deputy rests in the chief's frame.
    rest = [RADIUS_M * (np.cos(AHEAD_RAD) - 1), RADIUS_M * np.sin(AHEAD_RAD), 0, 0, 0, 0]
    np.testing.assert_allclose(flown.relative[0], np.tile(rest, (61, 1)), rtol=0, atol=1e-6)


def test_part_of_the_files_may_be_flown(folder: Path) -> None:
    flown = simulate(campaign(folder, "truth.epoch=2021-07-10T16:01:55 UTC"))
    np.testing.assert_allclose(flown.chief[0], circular(flown.times_s + 115), rtol=0, atol=1e-6)


def test_the_run_may_end_with_the_files(folder: Path) -> None:
    flown = simulate(campaign(folder, "clock.duration_s=1470"))
    np.testing.assert_allclose(flown.chief[0, -1], circular(TIMES)[-1], rtol=0, atol=1e-8)


def test_the_run_starts_where_both_files_have_begun(folder: Path) -> None:
    later = TIMES[4:]
    (folder / "b.oem").write_text(oem_text(later, circular(later, AHEAD_RAD), more=""), encoding="utf-8")
    found = campaign(folder)
    assert options(found).start_epoch == EPOCH.later(120)
    np.testing.assert_allclose(simulate(found).chief[0, 0], circular(TIMES)[4], rtol=0, atol=1e-8)


def test_relative_velocity_is_the_time_derivative_in_a_plane_that_turns(folder: Path) -> None:
    """A chief whose orbit plane is turned by a steady rate, as precession does, against differences."""

    def turned(times: Any, ahead_rad: float = 0.0) -> Any:
        states, rate = circular(times, ahead_rad), 1e-6
        angle = rate * np.asarray(times)
        rotation = np.zeros((len(angle), 3, 3))
        rotation[:, 0, 0] = rotation[:, 1, 1] = np.cos(angle)
        rotation[:, 1, 0], rotation[:, 0, 1], rotation[:, 2, 2] = np.sin(angle), -np.sin(angle), 1.0
        position = np.einsum("tij,tj->ti", rotation, states[:, :3])
        velocity = np.einsum("tij,tj->ti", rotation, states[:, 3:]) + np.cross([0, 0, rate], position)
        return np.concatenate([position, velocity], axis=1)

    for name, ahead in (("a", 0.0), ("b", 10 * AHEAD_RAD)):
        (folder / f"{name}.oem").write_text(oem_text(TIMES, turned(TIMES, ahead), more=""), encoding="utf-8")
    flown = simulate(campaign(folder, "clock.step_s=1")).relative[0]
    slope = (flown[:-4, :3] - 8 * flown[1:-3, :3] + 8 * flown[3:-1, :3] - flown[4:, :3]) / 12
    np.testing.assert_allclose(flown[2:-2, 3:], slope, rtol=0, atol=1e-6)
    # Without the chief's normal acceleration it would be off by the rate about the radius times the separation.
    assert np.abs(flown[:, 5]).max() > 1e-3


def test_filters_are_told_the_orbit_that_osculates_at_the_start(folder: Path) -> None:
    orbit = nominal_chief(options(campaign(folder)))
    assert orbit.semi_major_axis_m == pytest.approx(RADIUS_M, abs=1.0)  # two values of mu, WGS 84's is 9e-12 larger
    assert orbit.eccentricity < 1e-7
    assert np.degrees(orbit.inclination_rad) == pytest.approx(50.0, abs=1e-9)
    assert orbit.mu_m3_s2 == pytest.approx(MU_M3_S2, rel=1e-8)


def test_the_user_is_told_how_well_the_rows_fit(folder: Path) -> None:
    start, chief, deputy = recorded_orbits(campaign(folder))
    assert start == "The run starts at 2021-07-10T16:00:00 UTC."
    assert chief.startswith("The chief flies a.oem: 26 rows, interpolated by HERMITE of degree 11; ")
    assert deputy.startswith("The deputy flies b.oem: ")
    assert chief.endswith(" m.") and "withheld rows are met within" in chief


def test_a_file_is_known_by_its_content(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    moved = tmp_path_factory.mktemp("moved")
    for name in ("a.oem", "b.oem", "c.yaml"):
        (moved / name).write_bytes((folder / name).read_bytes())
    here, there = campaign(folder), campaign(moved)
    assert (here.hash, here.cases[0].id) == (there.hash, there.cases[0].id)
    with open(moved / "b.oem", "a", encoding="utf-8") as file:
        file.write("COMMENT changed\n")
    changed = campaign(moved)
    assert changed.cases[0].id != here.cases[0].id
    assert changed.content["truth"]["ephemeris"]["deputy_sha256"] != here.content["truth"]["ephemeris"]["deputy_sha256"]
    digest = here.content["truth"]["ephemeris"]["deputy_sha256"]
    (said,) = [each for each in problems(moved, f"truth.ephemeris.deputy_sha256={digest}") if "deputy" in each]
    assert "it is not the file that is meant" in said


def test_a_changed_file_is_not_resumed_nor_read_again(folder: Path) -> None:
    out = folder / "result.h5"
    found = campaign(folder)
    run_campaign(found, out, workers=1, backend="sequential")
    flown = options(found)
    with open(folder / "a.oem", "a", encoding="utf-8") as file:
        file.write("COMMENT changed\n")
    with pytest.raises(RefusedError):
        run_campaign(campaign(folder), out, workers=1, backend="sequential")
    _read.cache_clear()  # as in another process
    _flown.cache_clear()
    with pytest.raises(ValueError, match=r"a\.oem has changed since the campaign was read"):
        truth_trajectory(flown, 599.0, RandomSource(1, (0,)))


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            "truth.forces.zonals=4",
            "truth.forces: the files of truth.ephemeris say already how the craft fly; leave this out",
        ),
        ("truth.chief.orbit.a_km=7000", "truth.chief.orbit: the files of truth.ephemeris say already how"),
        ("truth.deputy.relative.position_m=[1,2,3]", "truth.deputy.relative: the files of truth.ephemeris say already"),
        ("truth.manoeuvres.one.time_s=3", "truth.manoeuvres: the files of truth.ephemeris say already how"),
        ("truth.dispersions.density.kind=normal", "truth.dispersions: the files of truth.ephemeris say already how"),
        ("truth.ephemeris.deputy=d.oem", "truth.ephemeris: d.oem: No such file or directory"),
        (
            "truth.ephemeris.frame=ITRF",
            "truth.ephemeris: a.oem:4: the frame of this OEM is EME2000, not ITRF; leave it",
        ),
        (
            "truth.ephemeris.frame=TEME",
            "truth.ephemeris.frame: must be 'EME2000', 'ICRF', 'GCRF' or 'ITRF', not the text",
        ),
        ("truth.ephemeris.cheif=a", "truth.ephemeris.cheif: unknown key; did you mean 'chief'?"),
        ("truth.epoch=soon", "truth.epoch: 'soon' is no epoch; write it as 2010-07-27T00:00:00 UTC"),
        (
            "truth.epoch=2021-07-10T17:00:00 UTC",
            "truth.ephemeris: a.oem:4: the orbit is useable from 2021-07-10T16:00:00",
        ),
        ("clock.duration_s=1480", "truth.ephemeris: a.oem:4: the orbit is useable from 2021-07-10T16:00:00 UTC to"),
        (
            "truth.ephemeris.interpolation=LAGRANGE",
            "truth.ephemeris: a.oem:4: the interpolation LAGRANGE needs a degree",
        ),
        (
            "sensors.accelerometer.velocity_random_walk_m_s_sqrt_s=1e-3",
            "sensors.accelerometer: recorded orbits do not tell thrust and drag from gravity",
        ),
        (
            "filters.ekf.dynamics.kind=gp",
            "filters.ekf.dynamics: learned dynamics are trained on what was before the start",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(folder: Path, change: str, sentence: str) -> None:
    assert any(f": {sentence}" in problem for problem in problems(folder, change)), problems(folder, change)


def test_a_file_that_is_wrong_is_refused_with_both_places(folder: Path) -> None:
    text = (folder / "b.oem").read_text(encoding="utf-8")
    (folder / "b.oem").write_text(text.replace("CENTER_NAME = EARTH", "CENTER_NAME = MOON"), encoding="utf-8")
    assert problems(folder) == [
        "c.yaml:6: truth.ephemeris: b.oem:7: CENTER_NAME is MOON; relnav reads orbits about the EARTH only"
    ]


def test_the_earths_orientation_may_be_told(folder: Path) -> None:
    rows = [
        ",".join([time, *map(repr, state)])
        for time, state in zip(calendar(TIMES), itrf_from_eci(circular(TIMES), TIMES, EPOCH).tolist(), strict=True)
    ]
    (folder / "a.csv").write_text("\n".join(["time_utc,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s", *rows]), encoding="utf-8")
    files = ("truth.ephemeris={chief: a.csv, deputy: a.csv, frame: ITRF}",)
    np.testing.assert_allclose(simulate(campaign(folder, *files)).chief[0, 0], circular(TIMES)[0], rtol=0, atol=1e-6)
    given = "truth.earth_orientation={ut1_utc_s: -0.1, polar_motion_arcsec: [0.1, 0.2]}"
    turned = simulate(campaign(folder, *files, given)).chief[0, 0]
    expected = itrf_from_eci(circular(TIMES), TIMES, EPOCH)
    expected = eci_from_itrf(expected, TIMES, EPOCH, ut1_utc_s=-0.1, polar_motion_rad=(0.1 * ARCSEC, 0.2 * ARCSEC))[0]
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-6)


def test_what_was_run_is_looked_at_again_by_a_report(folder: Path) -> None:
    found = campaign(folder, "sensors.radar.host=deputy", "sensors.radar.range_limits_m=[0, 9000]")
    flown = simulate(found, runs=[0])
    looked = flown_warnings(found.content, [("base", {}, flown.times_s, flown.relative, {"ekf": ("radar",)})])
    assert any("radar" in sentence for sentence in looked)
    (folder / "a.oem").unlink()
    _read.cache_clear()
    _flown.cache_clear()
    (sentence,) = flown_warnings(found.content, [("base", {}, flown.times_s, flown.relative, {"ekf": ("radar",)})])
    assert sentence.startswith("The geometry was not looked at: ")
    assert "a.oem: No such file or directory" in sentence


def test_masses_may_be_told(folder: Path) -> None:
    found = campaign(folder, "truth.chief={mass_kg: 500, area_m2: 2}", "truth.constants.j2=1.1e-3")
    assert options(found).chief is not None
    assert nominal_chief(options(found)).j2 == 1.1e-3


def test_each_craft_must_be_near_the_earth(folder: Path) -> None:
    far = circular(TIMES, AHEAD_RAD) * 1e3
    (folder / "b.oem").write_text(oem_text(TIMES, far, more=""), encoding="utf-8")
    (problem,) = problems(folder)
    assert "b.oem:13: the position is 6.9e+06 km from the Earth's centre" in problem
    assert problem.endswith("check the units")


def test_rows_that_are_met_badly_are_told_before_a_run(folder: Path) -> None:
    assert not any("withheld" in sentence for sentence in campaign_warnings(campaign(folder)))
    rough = circular(TIMES, AHEAD_RAD) + np.random.default_rng(1).normal(size=(len(TIMES), 6)) * 3 * np.repeat(
        [1, 0], 3
    )
    (folder / "b.oem").write_text(oem_text(TIMES, rough, more=""), encoding="utf-8")
    (told,) = (sentence for sentence in campaign_warnings(campaign(folder)) if "withheld" in sentence)
    assert told.startswith("Rows of b.oem that are withheld are met within ")
