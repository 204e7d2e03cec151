"""Forces about the Earth as it is: the sum of its parts, and what is refused."""

import re

import numpy as np
import pytest

from relnav_sim import ForceModel, GravityField
from relnav_sim.astro.atmosphere import LayeredAtmosphere
from relnav_sim.astro.constants import MU_M3_S2, RADIUS_M
from relnav_sim.astro.earth_orientation import itrf_from_eci
from relnav_sim.astro.sun_moon import MOON_MU, SUN_MU, moon_position, sun_position
from relnav_sim.truth import ExponentialAtmosphere

EPOCH = "2010-07-27T00:00:00 GPS"
FIELD = GravityField.load("ggm05s", 12, 12)
AIR = ExponentialAtmosphere(400e3, 3.7e-12, 58e3)


def of_field(**others):
    return ForceModel(FIELD.mu_m3_s2, FIELD.radius_m, **({"zonals": (), "gravity": FIELD, "epoch": EPOCH} | others))


@pytest.fixture
def states():
    rng = np.random.default_rng(4)
    position, velocity = rng.normal(size=(2, 40, 3))
    position *= rng.uniform(6.7e6, 8e6, (40, 1)) / np.linalg.norm(position, axis=1, keepdims=True)
    return np.concatenate([position, 4e3 * velocity], axis=1)


def test_the_field_turns_with_the_earth(states):
    """Turned to Earth-fixed axes, the acceleration is the field's there; the axes are checked elsewhere."""
    times = np.linspace(0.0, 2e5, 40)
    pull = of_field().acceleration(states, times_s=times)
    turned = itrf_from_eci(np.concatenate([pull, states[:, :3]], axis=1), times, EPOCH)
    at = itrf_from_eci(states, times, EPOCH)[:, :3]
    np.testing.assert_allclose(turned[:, :3], FIELD.acceleration(at), rtol=0, atol=1e-13)


def test_a_zonal_field_hardly_feels_where_the_earth_is_turned_to(states):
    """Precession moves the pole by 9e-4 rad in ten years, and J2's 1e-2 m/s^2 with it."""
    field = GravityField.load("ggm05s", 4, 0)
    n = np.arange(2, 5)
    zonal = ForceModel(field.mu_m3_s2, field.radius_m, tuple(-field.C[2:, 0] * np.sqrt(2 * n + 1)))
    turned = ForceModel(field.mu_m3_s2, field.radius_m, zonals=(), gravity=field, epoch=EPOCH)
    apart = np.abs(turned.acceleration(states) - zonal.acceleration(states)).max()
    assert 1e-6 < apart < 9e-4 * 5e-2


@pytest.mark.parametrize("bodies", [("sun",), ("moon",), ("sun", "moon")])
@pytest.mark.parametrize("zonal", [False, True])
def test_third_bodies_pull_at_craft_and_earth(bodies, zonal, states):
    plain = ForceModel(MU_M3_S2, RADIUS_M) if zonal else of_field()
    both = ForceModel(MU_M3_S2, RADIUS_M, epoch=EPOCH, third_bodies=bodies) if zonal else of_field(third_bodies=bodies)
    times, expected = np.linspace(-1e5, 1e6, 40), np.zeros((40, 3))
    for name, mu, position in (("sun", SUN_MU, sun_position), ("moon", MOON_MU, moon_position)):
        if name in bodies:
            to_earth = position(times, EPOCH).astype(np.longdouble)
            to_craft = to_earth - states[:, :3]
            for sign, d in ((1, to_craft), (-1, to_earth)):
                expected += sign * (mu * d / np.sqrt(np.square(d).sum(axis=1, keepdims=True)) ** 3).astype(float)
    found = both.acceleration(states, times_s=times) - plain.acceleration(states, times_s=times)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_sunlight_pushes_each_craft_by_its_own_area(states):
    """1361 W/m^2 over the speed of light, in July 3 % less; away from the Sun, and not at all in the shadow."""
    areas = np.where(np.arange(40) % 2, 0.02, 0.0)
    found = of_field(radiation=True).acceleration(states, radiation_m2_kg=areas) - of_field().acceleration(states)
    assert not found[::2].any()
    sun = sun_position(0.0, EPOCH)
    away = -sun / np.linalg.norm(sun)
    along = states[1::2, :3] @ away
    aside = np.linalg.norm(states[1::2, :3] - along[:, None] * away, axis=1)
    dark = (along > 0) & (aside < 6.2e6)
    lit = (along < 0) | (aside > 6.6e6)
    assert dark.any() and lit.sum() > 10
    assert not found[1::2][dark].any()
    # Differences of 8 m/s^2 round by 1e-15.
    np.testing.assert_allclose(found[1::2][lit] @ away, 0.02 * 4.54e-6 * 0.967, rtol=3e-3)


@pytest.mark.parametrize("air", [AIR, LayeredAtmosphere()])
@pytest.mark.parametrize("zonal", [False, True])
def test_drag_is_the_same_in_every_field(air, zonal, states):
    with_air = ForceModel(FIELD.mu_m3_s2, FIELD.radius_m, atmosphere=air) if zonal else of_field(atmosphere=air)
    without = ForceModel(FIELD.mu_m3_s2, FIELD.radius_m) if zonal else of_field()
    wind = states[:, 3:] - np.cross([0.0, 0.0, with_air.rotation_rad_s], states[:, :3])
    density = air.density(np.linalg.norm(states[:, :3], axis=1) - FIELD.radius_m)
    expected = -0.5 * 0.01 * (density * np.linalg.norm(wind, axis=1))[:, None] * wind
    found = with_air.acceleration(states, 0.01) - without.acceleration(states)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=5e-15)


def test_any_shapes_that_broadcast(states):
    force, times = of_field(third_bodies=("sun",)), np.arange(5) * 1e4
    whole = force.acceleration(states.reshape(8, 5, 6), times_s=times)
    assert np.array_equal(whole[3, 2], force.acceleration(states[17], times_s=times[2]))
    lost = force.acceleration(states[:2], times_s=[times[2], np.nan])
    assert np.isfinite(lost[0]).all()
    assert np.isnan(lost[1]).all()
    assert force.acceleration(np.zeros((0, 6))).shape == (0, 3)
    normal = force.normal_acceleration(states.reshape(8, 5, 6), times_s=times)
    axis = np.cross(states[17, :3], states[17, 3:])
    assert normal[3, 2] == pytest.approx(whole[3, 2] @ axis / np.linalg.norm(axis), rel=1e-9)


@pytest.mark.parametrize(
    "given, message",
    [
        ({"zonals": (1e-3,)}, "the gravity field GGM05S has zonal harmonics of its own: give zonals=()"),
        ({"epoch": None}, "a gravity field, third_bodies and radiation need an epoch, which times count from"),
        ({"epoch": "2010-07-27T00:00:00"}, "names no time scale"),
        ({"third_bodies": ("mars",)}, "third_bodies has 'mars'; known are sun and moon"),
    ],
)
def test_what_does_not_go_with_a_field_is_refused(given, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        of_field(**given)


def test_other_constants_beside_a_field_are_refused():
    with pytest.raises(ValueError, match=r"mu_m3_s2 is 39860044\d+.0; the gravity field GGM05S has its own"):
        ForceModel(MU_M3_S2, FIELD.radius_m, zonals=(), gravity=FIELD, epoch=EPOCH)
    with pytest.raises(ValueError, match=r"radius_m is 6378137.0; the gravity field GGM05S has its own"):
        ForceModel(FIELD.mu_m3_s2, RADIUS_M, zonals=(), gravity=FIELD, epoch=EPOCH)


@pytest.mark.parametrize("given", [{"third_bodies": ("sun",)}, {"radiation": True}])
def test_what_the_calendar_moves_needs_an_epoch(given):
    with pytest.raises(ValueError, match="need an epoch"):
        ForceModel(MU_M3_S2, RADIUS_M, **given)
