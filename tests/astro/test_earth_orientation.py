"""EME2000 and the ITRF against ERFA's own chain, brahe where it is installed, and physics."""

import erfa
import numpy as np
import pytest

from relnav_sim import eci_from_itrf, itrf_from_eci
from relnav_sim.astro.earth_orientation import (
    ROTATION_RAD_S,
    EarthOrientation,
    eme2000_from_gcrf,
    gcrf_from_eme2000,
)
from relnav_sim.astro.epoch import Epoch

EPOCH = "2010-07-27T00:00:00 GPS"
TIMES = np.sort(np.random.default_rng(1).uniform(-2 * 86400, 9 * 86400, 300))


def states(rng_seed=0, shape=(2, 300)):
    rng = np.random.default_rng(rng_seed)
    return rng.normal(size=(*shape, 6)) * np.repeat([7e6, 7e3], 3)


@pytest.mark.parametrize("epoch", [EPOCH, "1985-03-03T04:05:06.789 UTC", "2049-12-01T00:00:00 TAI"])
@pytest.mark.parametrize(("ut1_utc_s", "pole"), [(0.0, (0.0, 0.0)), (-0.3341, (1.1e-6, -2.3e-6))])
def test_the_rotation_is_erfas(epoch, ut1_utc_s, pole):
    """Celestial to terrestrial by one call of ERFA.

    What is left is rounding in ERFA's `era00`, there and in ours at the epoch: of the days since 2000 and of the turns
    that they amount to, each twice.
    """
    instant = Epoch.parse(epoch)
    day, fraction = instant.tt[0], instant.tt[1] + TIMES / 86400
    ut1 = fraction + (ut1_utc_s - instant.tai_minus_utc_s - 32.184) / 86400
    bias = erfa.bp00(2451545.0, 0.0)[0]
    expected = erfa.c2t06a(day, fraction, day, ut1, *pole) @ bias.T
    ours, _ = EarthOrientation(ut1_utc_s, pole).matrices(TIMES, instant)
    days = abs(day - 2451545)
    turns = np.spacing(0.0027379 * days) + 0.0027379 * np.spacing(days) + np.spacing(9.0)
    assert np.abs(ours - expected).max() < 2 * 2 * np.pi * turns < 3e-13


def test_the_rate_is_the_derivative():
    """Central differences of sixth order over 90 s leave (w h)^6 / 140, and rounding of the angle over the step."""
    instant, h = Epoch.parse(EPOCH), 30.0
    inside = TIMES[np.abs(TIMES % 86400 - 43200) < 43000]  # a step does not leave the day's polynomial
    of = EarthOrientation()
    difference = sum(
        w * (of.matrices(inside + k * h, instant)[0] - of.matrices(inside - k * h, instant)[0])
        for k, w in ((1, 45), (2, -9), (3, 1))
    ) / (60 * h)
    _, rate = of.matrices(inside, instant)
    assert np.abs(rate - difference).max() < 2 * np.spacing(15.0) / h + ROTATION_RAD_S * (ROTATION_RAD_S * h) ** 6 / 140
    # Without the motion of the pole the rate would be wrong by precession and nutation.
    turned, _ = of.matrices(inside, instant)
    spin = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]) * ROTATION_RAD_S
    assert 1e-12 < np.abs(spin @ turned - rate).max() < 3e-11


def test_the_two_directions_are_inverses():
    there = itrf_from_eci(states(), TIMES, EPOCH, ut1_utc_s=0.2, polar_motion_rad=(1e-6, 2e-6))
    back = eci_from_itrf(there, TIMES, EPOCH, ut1_utc_s=0.2, polar_motion_rad=(1e-6, 2e-6))
    assert there.shape == (2, 300, 6)
    assert (np.abs(back - states()) < np.repeat([2e-8, 2e-11], 3)).all()


def test_a_point_at_rest_on_the_ground_moves_with_the_earth():
    """Its inertial speed is w times the distance from the axis, eastwards."""
    equator = eci_from_itrf([[6378137.0, 0, 0, 0, 0, 0]] * 2, [0.0, 3600.0], EPOCH)
    assert np.linalg.norm(equator[:, 3:], axis=1) == pytest.approx(6378137.0 * ROTATION_RAD_S, rel=1e-6)
    assert np.abs(np.einsum("ti,ti->t", equator[:, :3], equator[:, 3:])).max() < 1e3  # m^2/s, of 3e9
    assert np.cross(equator[:, :3], equator[:, 3:])[:, 2].min() > 0


def test_a_day_of_stars():
    """After 86164.0989 s the Earth has turned once with respect to the stars."""
    first, later = itrf_from_eci([[7e6, 0, 0, 0, 0, 0]] * 2, [0.0, 2 * np.pi / ROTATION_RAD_S], EPOCH)[:, :3]
    assert np.linalg.norm(later - first) < 7e6 * 1e-5


def test_brahe_agrees():
    """Another library's chain, with zero Earth-orientation parameters.

    Dates are sixteenths of a day, because it keeps a date in one number, which rounds others to 3e-7 s. It has the bias
    to second order only (1e-12), and leaves precession and nutation out of velocities (3e-11 rad/s).
    """
    brahe = pytest.importorskip("brahe")
    brahe.set_global_eop_provider_from_static_provider(brahe.StaticEOPProvider.from_zero())
    given, times = states(3, (20,)), np.arange(20) * 5400.0
    ours = itrf_from_eci(given, times, "2010-07-27T00:00:00 UTC")
    start = brahe.Epoch.from_datetime(2010, 7, 27, 0, 0, 0.0, 0.0, brahe.TimeSystem.UTC)
    for k in range(20):
        r, gcrf = np.linalg.norm(given[k, :3]), gcrf_from_eme2000(given[k])
        assert np.abs(gcrf - brahe.state_eme2000_to_gcrf(given[k]))[:3].max() < 1e-12 * r
        theirs = brahe.state_gcrf_to_itrf(start + times[k], gcrf)
        assert np.abs(ours[k] - theirs)[:3].max() < 3e-14 * r  # rounding, as above
        assert np.abs(ours[k] - theirs)[3:].max() < 3e-11 * r


def test_no_times_no_states():
    assert itrf_from_eci(np.zeros((3, 0, 6)), [], EPOCH).shape == (3, 0, 6)


def test_the_frame_bias():
    given = states(4, (5,))
    np.testing.assert_allclose(gcrf_from_eme2000(eme2000_from_gcrf(given)), given, rtol=1e-14)
    assert 1e-8 < np.linalg.norm(eme2000_from_gcrf([0, 0, 1.0, 0, 0, 0]) - [0, 0, 1.0, 0, 0, 0]) < 1.2e-7


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: itrf_from_eci(np.zeros((3, 5)), np.zeros(3), EPOCH), r"must be \(..., 6\)"),
        (lambda: itrf_from_eci(np.zeros((3, 6)), np.zeros(4), EPOCH), "the same T"),
        (lambda: eci_from_itrf(np.zeros(6), 0.0, EPOCH), "the same T"),
        (lambda: eci_from_itrf(np.zeros((1, 6)), [np.nan], EPOCH), "times_s is NaN at epoch 0"),
        (lambda: eci_from_itrf(np.zeros((1, 6)), [0.0], "2010-07-27"), "names no time scale"),
        (lambda: eci_from_itrf(np.zeros((1, 6)), [3.2e9], EPOCH), "not within the years 1900 to 2100"),
        (lambda: eci_from_itrf(np.zeros((1, 6)), [0.0], "1971-07-27T00:00:00 TAI"), "before 1972"),
        (lambda: eci_from_itrf(np.zeros((1, 6)), [0.0], EPOCH, ut1_utc_s=-50.0), "UT1 - UTC stays within"),
        (lambda: eci_from_itrf(np.zeros((1, 6)), [0.0], EPOCH, polar_motion_rad=(0.2, 0.3)), "in rad"),
    ],
)
def test_what_does_not_fit_is_refused(call, sentence):
    with pytest.raises(ValueError, match=sentence):
        call()
