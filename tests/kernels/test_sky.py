"""The sky over lanes against pyerfa at each time, and forces against plain NumPy and numbers of many digits."""

import math

import erfa
import numpy as np
import pytest
from checks import check_runs_are_alone
from mpmath import mp, mpf

from relnav_sim import kernels
from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.sky import sky_between
from relnav_sim.astro.sun_moon import MOON_MU, SUN_MU, moon_position, sun_position
from relnav_sim.kernels.sky import AU_M, SUN_RADIUS_M

EPOCH = Epoch.parse("2010-07-27T00:00:00 GPS")
RADIUS = 6378137.0
OBSERVED = EarthOrientation(-0.05, (1e-6, 2e-6))
SKY = sky_between(EPOCH, -86400.0, 3 * 86400.0, OBSERVED)
TIMES = np.random.default_rng(0).uniform(-86400.0, 3 * 86400.0, 500)
PRESSURE = 1361.0 / 299792458.0


def positions(count, lowest=6.6e6, highest=5e7, seed=1):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    return direction / np.linalg.norm(direction, axis=1)[:, None] * rng.uniform(lowest, highest, count)[:, None]


def pulls(times, at, reflectivity=0.0, sun=0.0, moon=0.0, radius=RADIUS):
    of_each = np.full(len(at), reflectivity)
    return kernels.sky.acceleration(SKY, times, np.ascontiguousarray(at), of_each, sun, moon, radius)


def test_orientation_is_erfas():
    """`c2t06a` at each time; rounding of the days since 2000 in its rotation angle is up to 2e-14."""
    day, fraction = EPOCH.tt[0], EPOCH.tt[1] + TIMES / 86400
    ut1 = fraction + (-0.05 - EPOCH.tai_minus_utc_s - 32.184) / 86400
    bias = erfa.bp00(2451545.0, 0.0)[0]
    expected = erfa.c2t06a(day, fraction, day, ut1, 1e-6, 2e-6) @ bias.T
    found = kernels.sky.orientations(SKY, TIMES)
    assert np.abs(found - expected).max() < 5e-14
    assert np.abs(found - OBSERVED.matrices(TIMES, EPOCH)[0]).max() < 2e-15


def test_bits_do_not_depend_on_the_span_of_the_table():
    whole = kernels.sky.orientations(SKY, TIMES)
    for k in range(0, 500, 97):
        alone = sky_between(EPOCH, TIMES[k], TIMES[k], OBSERVED)
        assert np.array_equal(kernels.sky.orientations(alone, TIMES[k : k + 1])[0], whole[k])


def test_steps_may_go_a_day_too_far_and_nothing_is_made_up_beyond():
    sky = sky_between(EPOCH, 0.0, 0.0)
    known = kernels.sky.orientations(sky, np.array([-86400.0, 86400.0 * 1.999]))
    assert np.isfinite(known).all()
    for time in (-86401.0, 2 * 86400.0, 1e300, np.inf, np.nan):
        assert np.isnan(kernels.sky.orientations(sky, np.array([time]))).all()


def test_third_bodies_keep_their_digits():
    """The plain difference of two pulls in 40 digits; the Moon takes 1e-6 of the acceleration of gravity."""
    at, found = positions(20), pulls(TIMES[:20], positions(20), sun=SUN_MU, moon=MOON_MU)
    with mp.workdps(40):
        for k in range(20):
            exact = np.zeros(3, dtype=object)
            for mu, body in ((SUN_MU, sun_position(TIMES[k], EPOCH)), (MOON_MU, moon_position(TIMES[k], EPOCH))):
                s = np.array([mpf(c) for c in body.tolist()])
                d = s - np.array([mpf(c) for c in at[k].tolist()])
                exact = exact + mpf(mu) * (d / mp.sqrt((d * d).sum()) ** 3 - s / mp.sqrt((s * s).sum()) ** 3)
            # The bodies are known to 10 mm from the polynomials: 3e-11 of the distance of the Moon, times 3.
            assert np.abs(found[k] - exact.astype(float)).max() < 1e-10 * np.abs(exact.astype(float)).max()


def test_a_third_body_pulls_towards_itself_and_away():
    """Montenbruck and Gill (2000), section 3.3: 2 mu r / s^3 towards the body, and as much behind."""
    moon = moon_position(0.0, EPOCH)
    s = np.linalg.norm(moon)
    at = np.stack([7e6 * moon / s, -7e6 * moon / s])
    found = pulls(np.zeros(2), at, moon=MOON_MU) @ (moon / s)
    assert found == pytest.approx([2 * MOON_MU * 7e6 / s**3, -2 * MOON_MU * 7e6 / s**3], rel=0.06)


def in_sight(r, s):
    """Share of the Sun's disc outside the Earth's, by counting a polar grid of the Sun's disc as seen from r."""
    to_sun, to_earth = s - r, -r
    sun, earth = np.arcsin(SUN_RADIUS_M / np.linalg.norm(to_sun)), np.arcsin(RADIUS / np.linalg.norm(r))
    cosine = to_sun @ to_earth / np.linalg.norm(to_sun) / np.linalg.norm(to_earth)
    apart = math.acos(min(1.0, max(-1.0, cosine)))
    n = 1000
    rho = sun * np.sqrt((np.arange(n) + 0.5) / n)[:, None]
    phi = 2 * np.pi * (np.arange(n) + 0.5) / n
    return 1 - (np.hypot(rho * np.cos(phi) - apart, rho * np.sin(phi)) < earth).mean()


@pytest.mark.parametrize("distance", [7e6, 4.2e7, 1.6e9])
def test_shadow_is_the_share_of_the_suns_disc(distance):
    """Through the shadow's edge on a circle in the Sun's plane; at 1.6 million km the Earth leaves a ring of the Sun.

    Discs on a plane are what the reference and the formula share; the count of a million cells errs by 1e-3.
    """
    sun = sun_position(0.0, EPOCH)
    away = -sun / np.linalg.norm(sun)
    across = np.cross(away, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    half_shadow, half_sun = RADIUS / distance, SUN_RADIUS_M / AU_M
    angles = math.asin(half_shadow) + half_sun * np.linspace(-2, 2, 17)
    angles = np.append(angles, [0.0, math.pi / 2, math.pi])
    at = distance * (np.cos(angles)[:, None] * away + np.sin(angles)[:, None] * across)
    found = pulls(np.zeros(len(at)), at, reflectivity=0.02)
    d = at - sun
    full = 0.02 * PRESSURE * AU_M**2 / np.linalg.norm(d, axis=1) ** 2
    share = np.einsum("ij,ij->i", found, d) / np.linalg.norm(d, axis=1) / full
    expected = [in_sight(r, sun) for r in at]
    np.testing.assert_allclose(share, expected, atol=2e-3)
    assert share[-1] == pytest.approx(1.0, rel=1e-9)
    assert share.min() >= 0.0
    assert np.cross(found[-1], d[-1]) == pytest.approx(np.zeros(3), abs=1e-9 * np.linalg.norm(d[-1]) * full[-1])
    assert (share.min() == 0.0) == (distance < 1e9)
    assert np.sum((share > 0.02) & (share < 0.98)) > 0


def test_brahe_agrees_on_sunlight_and_shadow():
    """At places all about, and across the edge of the shadow, where 40 of 100 are in the penumbra."""
    brahe = pytest.importorskip("brahe")
    sun = sun_position(0.0, EPOCH)
    away = -sun / np.linalg.norm(sun)
    across = np.cross(away, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    rng = np.random.default_rng(2)
    behind, beside = rng.uniform(1e6, 4e7, (100, 1)), rng.uniform(-1, 1, (100, 1))
    edge = behind * away + (brahe.R_EARTH + 0.012 * behind * beside) * across
    at = np.concatenate([positions(300), edge])
    found = pulls(np.zeros(len(at)), at, reflectivity=0.02, radius=brahe.R_EARTH)
    lit = np.array([brahe.eclipse_conical(r, sun) for r in at])
    assert ((lit > 0) & (lit < 1)).sum() > 30
    assert (lit == 0).sum() > 10
    pressure = [brahe.accel_solar_radiation_pressure(r, sun, 100.0, 1.0, 2.0, PRESSURE) for r in at]
    np.testing.assert_allclose(found, lit[:, None] * pressure, rtol=0, atol=1e-9 * 0.02 * PRESSURE)


def test_brahe_agrees_on_third_bodies():
    """It takes low-precision series for the places of both, which changes their pull by up to 2 %."""
    brahe = pytest.importorskip("brahe")
    brahe.set_global_eop_provider_from_static_provider(brahe.StaticEOPProvider.from_zero())
    start = brahe.Epoch.from_datetime(2010, 7, 26, 23, 59, 45.0, 0.0, brahe.TimeSystem.UTC)
    at = positions(50)
    for k in range(50):
        for ours, theirs in (
            (pulls(TIMES[k : k + 1], at[k : k + 1], sun=SUN_MU)[0], brahe.accel_third_body_sun),
            (pulls(TIMES[k : k + 1], at[k : k + 1], moon=MOON_MU)[0], brahe.accel_third_body_moon),
        ):
            expected = theirs(start + TIMES[k], at[k])
            assert np.linalg.norm(ours - expected) < 0.02 * np.linalg.norm(expected)


def test_the_forces_add_up():
    at = positions(300)
    apart = pulls(TIMES[:300], at, sun=SUN_MU) + pulls(TIMES[:300], at, moon=MOON_MU)
    apart += pulls(TIMES[:300], at, reflectivity=0.03)
    together = pulls(TIMES[:300], at, 0.03, SUN_MU, MOON_MU)
    np.testing.assert_allclose(together, apart, rtol=1e-13, atol=1e-20)


def test_lanes_are_alone():
    reflectivity = np.full(70, 0.02)
    check_runs_are_alone(
        lambda times, at, of_each: kernels.sky.acceleration(SKY, times, at, of_each, SUN_MU, MOON_MU, RADIUS),
        [TIMES[:70], positions(70), reflectivity],
    )
