"""Recorded orbits whatever their format: frames, checks of the states, defaults, coverage."""

from pathlib import Path
from typing import Any

import erfa
import numpy as np
import pytest
from orbit_files import EPOCH, MU_M3_S2, RADIUS_M, calendar, circular, oem_text

from relnav_sim import EphemerisError, itrf_from_eci, load_ephemeris
from relnav_sim.arrays import Array

TIMES = np.arange(0.0, 1800.0, 60.0)
STATES = circular(TIMES)


def loaded(folder: Path, states: Array, times: Array = TIMES, **options: Any) -> Any:
    stated = {key: options.pop(key) for key in ("velocity_frame", "start", "stop") if key in options}
    frame = options.pop("frame", "EME2000")
    header = "time_utc,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
    rows = [",".join([time, *map(repr, state)]) for time, state in zip(calendar(times), states.tolist(), strict=True)]
    (folder / "a.csv").write_text("\n".join([header, *rows]), encoding="utf-8")
    return load_ephemeris(folder / "a.csv", frame=frame, **stated, **options)


def test_the_frame_bias_is_applied_to_celestial_axes(tmp_path: Path) -> None:
    bias = erfa.bp06(2451545.0, 0.0)[0]
    for frame in ("ICRF", "GCRF"):
        found = loaded(tmp_path, STATES, frame=frame)
        assert (found.frame, found.eci().frame) == (frame, "EME2000")
        turned = np.concatenate([STATES[:, :3] @ bias.T, STATES[:, 3:] @ bias.T], axis=1)
        # IAU 2000 and 2006 differ by 1e-10 rad and less in the bias.
        np.testing.assert_allclose(found.eci().states, turned, rtol=0, atol=1e-3)
        assert np.linalg.norm(found.eci().states[0, :3] - STATES[0, :3]) > 0.1


def test_eme2000_is_eci(tmp_path: Path) -> None:
    assert np.array_equal(loaded(tmp_path, STATES, frame="J2000").eci().states, STATES)


def test_itrf_states_are_turned_and_their_velocities_relative_to_the_earth(tmp_path: Path) -> None:
    fixed = itrf_from_eci(STATES, TIMES, EPOCH)
    for frame in ("ITRF", "ITRF2014"):
        found = loaded(tmp_path, fixed, frame=frame)
        np.testing.assert_allclose(found.eci().states, STATES, rtol=0, atol=1e-7)


def test_velocities_seen_from_inertial_space_are_told_apart(tmp_path: Path) -> None:
    fixed = itrf_from_eci(STATES, TIMES, EPOCH)
    rate = np.array([0.0, 0.0, 7.292115146706979e-5])
    inertial = np.concatenate([fixed[:, :3], fixed[:, 3:] + np.cross(rate, fixed[:, :3])], axis=1)
    found = loaded(tmp_path, inertial, frame="ITRF", velocity_frame="inertial")
    # The axis itself moves by precession, 50 arc seconds a year: 7.7e-12 rad/s.
    np.testing.assert_allclose(found.eci().states, STATES, rtol=0, atol=7.7e-12 * RADIUS_M)
    for states, velocity_frame in ((inertial, "ITRF"), (fixed, "inertial")):
        with pytest.raises(EphemerisError, match=r"a\.csv:2: the velocities are not the change of position with time"):
            loaded(tmp_path, states, frame="ITRF", velocity_frame=velocity_frame)


@pytest.mark.parametrize("factor", [1e-3, 1e3, 0.97, -1.0])
def test_velocities_in_another_unit_are_refused(tmp_path: Path, factor: float) -> None:
    with pytest.raises(EphemerisError, match=r"differ by .* %.*; check the units and the velocity frame"):
        loaded(tmp_path, STATES * np.repeat([1.0, factor], 3))


def test_sparse_rows_are_not_taken_for_a_wrong_unit(tmp_path: Path) -> None:
    times = np.arange(0.0, 9000.0, 600.0)
    assert len(loaded(tmp_path, circular(times), times).times_s) == len(times)


def test_defaults_follow_the_rows(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    dense = np.arange(0.0, 600.0, 10.0)
    rounded = circular(dense) + 0.001 * rng.standard_normal((len(dense), 6)) * np.repeat([1.0, 1e-3], 3)
    sparse = np.arange(0.0, 9000.0, 300.0)
    chosen = [
        loaded(tmp_path, states, times).spans[0].interpolation
        for states, times in ((rounded, dense), (circular(sparse), sparse), (STATES[:3], TIMES[:3]))
    ]
    assert [(each.kind, each.degree) for each in chosen] == [("LAGRANGE", 7), ("HERMITE", 11), ("HERMITE", 5)]


def test_a_stated_interpolation_wins_over_the_files(tmp_path: Path) -> None:
    (tmp_path / "a.oem").write_text(oem_text(TIMES, STATES), encoding="utf-8")
    found = load_ephemeris(tmp_path / "a.oem", interpolation="LINEAR")
    np.testing.assert_allclose(found.at(30.0), (STATES[0] + STATES[1]) / 2, rtol=1e-15)
    with pytest.raises(EphemerisError, match=r"a\.oem:4: the interpolation 'CUBIC' is not known"):
        load_ephemeris(tmp_path / "a.oem", interpolation="CUBIC")
    with pytest.raises(EphemerisError, match=r"a\.oem:4: a HERMITE interpolation has at least degree 2, not 1"):
        load_ephemeris(tmp_path / "a.oem", interpolation="HERMITE", interpolation_degree=1)


def test_what_is_stated_against_an_oem_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.oem").write_text(oem_text(TIMES, STATES), encoding="utf-8")
    assert load_ephemeris(tmp_path / "a.oem", frame="EME2000", time_scale="UTC").frame == "EME2000"
    for stated in (
        {"frame": "ITRF"},
        {"time_scale": "GPS"},
        {"velocity_frame": "inertial"},
        {"epoch": "2020-01-01 UTC"},
    ):
        with pytest.raises(EphemerisError, match=r"a\.oem:4: "):
            load_ephemeris(tmp_path / "a.oem", **stated)


def test_states_have_the_shape_of_the_times(tmp_path: Path) -> None:
    found = loaded(tmp_path, STATES)
    assert found.at(60.0).shape == (6,)
    assert found.at(np.full((2, 3), 60.0)).shape == (2, 3, 6)
    assert found.at([]).shape == (0, 6)
    with pytest.raises(EphemerisError, match="does not cover a time; it covers"):
        found.at([60.0, np.nan])


def test_part_of_a_file_is_the_same_orbit(tmp_path: Path) -> None:
    whole = loaded(tmp_path, STATES)
    part = loaded(tmp_path, STATES, start="2021-07-10T16:10:10 UTC", stop="2021-07-10T16:15:00 UTC")
    at = np.linspace(610.0, 900.0, 30)
    assert np.array_equal(part.at(at), whole.at(at))
    assert len(part.times_s) < len(TIMES)
    with pytest.raises(EphemerisError, match="does not cover"):
        part.at(600.0)


def test_the_earths_orientation_may_be_given(tmp_path: Path) -> None:
    found = loaded(tmp_path, itrf_from_eci(STATES, TIMES, EPOCH), frame="ITRF")
    turned = found.eci(ut1_utc_s=-0.2).states[:, :3]
    # 0.2 s of the Earth's rotation.
    shift = np.linalg.norm(turned - STATES[:, :3], axis=1)
    assert shift.max() == pytest.approx(0.2 * 7.292115e-5 * RADIUS_M, rel=0.01)


@pytest.mark.parametrize("factor", [1e-3, 1e3])
def test_states_in_another_unit_are_refused(tmp_path: Path, factor: float) -> None:
    with pytest.raises(EphemerisError, match=r"a\.csv:2: the position is 6\.9(e\+06)? km from .*; check the units"):
        loaded(tmp_path, STATES * factor)


@pytest.mark.parametrize(("step_s", "rows"), [(60.0, 30), (5.0, 12), (600.0, 20)])
def test_rows_in_another_frame_than_stated_are_refused(step_s: float, rows: int, tmp_path: Path) -> None:
    times = np.arange(rows) * step_s
    states = circular(times)
    fixed = itrf_from_eci(states, times, EPOCH)
    for right, wrong, frame in ((states, fixed, "EME2000"), (fixed, states, "ITRF")):
        assert loaded(tmp_path, right, times, frame=frame).frame == frame
        with pytest.raises(
            EphemerisError, match=r"a\.csv:2: the velocities .* Earth's pull .* 1?\d(\.\d+)? % .*the frame"
        ):
            loaded(tmp_path, wrong, times, frame=frame)
    (tmp_path / "a.oem").write_text(oem_text(times, states, frame="ITRF2014"), encoding="utf-8")
    with pytest.raises(EphemerisError, match=r"a\.oem:15: the velocities do not change as the Earth's pull makes them"):
        load_ephemeris(tmp_path / "a.oem")


def test_a_wrong_frame_costs_what_coriolis_adds(tmp_path: Path) -> None:
    # Along the equator 2 w v + w^2 r is missing, of mu / r^2.
    n, w = np.sqrt(MU_M3_S2 / RADIUS_M**3), 7.292115e-5
    angle = n * TIMES
    position = RADIUS_M * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    states = np.concatenate([position, n * np.cross([0, 0, 1], position)], axis=1)
    share = 100 * (2 * w * n + w**2) / n**2
    with pytest.raises(EphemerisError) as caught:
        loaded(tmp_path, states, frame="ITRF")
    told = float(str(caught.value).partition("differ by ")[2].partition(" %")[0])
    assert told == pytest.approx(share, rel=0.2**2 / 24 + 0.005)  # over the chord of 0.2 rad; three digits


@pytest.mark.parametrize("row", [1, 7, 28])
@pytest.mark.parametrize(("column", "off"), [(0, 5000.0), (2, -100.0), (4, 20.0)])
def test_a_single_row_that_is_off_is_refused_with_its_line(row: int, column: int, off: float, tmp_path: Path) -> None:
    for frame, states in (("EME2000", STATES), ("ITRF", itrf_from_eci(STATES, TIMES, EPOCH))):
        spoilt = states.copy()
        spoilt[row, column] += off
        what = "position" if column < 3 else "velocity"
        with pytest.raises(EphemerisError, match=rf"a\.csv:{row + 2}: the {what} is .* off .*; leave the row out"):
            loaded(tmp_path, spoilt, frame=frame)


def test_what_flies_on_is_no_row_that_is_off(tmp_path: Path) -> None:
    burnt = np.concatenate([STATES[:15], circular(TIMES[15:], 2e-6)])  # 14 m ahead
    burnt[15:, 3:] += 1.0
    noisy = STATES + np.random.default_rng(1).normal(size=STATES.shape) * np.repeat([3.0, 0.05], 3)
    for states in (burnt, noisy):
        assert len(loaded(tmp_path, states).times_s) == len(TIMES)
