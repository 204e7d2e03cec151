"""Shapes of relative motion: they close after a revolution, and are where and as large as their names say."""

from math import pi, radians, sqrt

import numpy as np
import pytest

from relnav_sim.astro import drift_free
from relnav_sim.astro.constants import J2, J3, J4, MU_M3_S2, RADIUS_M
from relnav_sim.astro.frames import rtn_from_eci
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.kepler import eccentric_anomaly
from relnav_sim.astro.orbits import Elements, elements_from_state, state_from_elements
from relnav_sim.truth import ForceModel, propagate

POINT = Gravity(MU_M3_S2)
ZONAL = Gravity(MU_M3_S2, RADIUS_M, J2, J3, J4)
SHAPES = {
    "trailing": lambda chief, gravity: drift_free.trailing(chief, -10_000.0, gravity),
    "hold point": lambda chief, gravity: drift_free.nearest_to_rest(chief, np.array([0.0, 200.0, 0.0]), gravity),
    "below": lambda chief, gravity: drift_free.nearest_to_rest(chief, np.array([-100.0, 50.0, 30.0]), gravity),
    "ellipse": lambda chief, gravity: drift_free.ellipse(chief, 100.0, 150.0, -500.0, 0.4, gravity),
}
ORBITS = {"circular": (0.0, 51.6), "near-circular": (1e-3, 97.8), "eccentric": (0.6, 63.4), "equatorial": (0.0, 0.0)}


def chief_on(orbit, a=7.5e6):
    e, i_deg = ORBITS[orbit]
    return state_from_elements(Elements(a / (1 - e), e, radians(i_deg), 0.3, 0.4, 1.0), MU_M3_S2)


def flown(chief, deputy, revolutions=1.0, points=201, zonals=()):
    """Return relative states (points, 6) over some revolutions."""
    a = float(elements_from_state(chief, MU_M3_S2).semi_major_axis_m)
    times = np.linspace(0, revolutions * 2 * pi * sqrt(a**3 / MU_M3_S2), points)
    force = ForceModel(MU_M3_S2, RADIUS_M, zonals)
    chiefs, deputies = propagate(np.stack([chief, deputy]), times, force, rtol=1e-13)
    return rtn_from_eci(chiefs, deputies)


@pytest.mark.parametrize("orbit", ORBITS)
@pytest.mark.parametrize("shape", SHAPES)
def test_shapes_close_after_a_revolution(shape, orbit):
    """About a point mass, to rounding: an ulp of a, 2e-9 m, drifts 3 pi times as far, some of which are lost."""
    chief = chief_on(orbit)
    deputy = SHAPES[shape](chief, POINT)
    a = [float(elements_from_state(each, MU_M3_S2).semi_major_axis_m) for each in (chief, deputy)]
    assert a[1] == pytest.approx(a[0], rel=2e-15 / (1 - ORBITS[orbit][0]))
    track = flown(chief, deputy, points=2)
    assert np.linalg.norm(track[1, :3] - track[0, :3]) < 1e-6


def kepler_trailing(chief, metres):
    orbit = elements_from_state(chief, MU_M3_S2)
    a = float(orbit.semi_major_axis_m)
    return state_from_elements(
        Elements(a, 0.0, orbit.inclination_rad, orbit.raan_rad, 0.0, orbit.true_anomaly_rad + metres / a), MU_M3_S2
    )


def test_a_zonal_field_counts_in_the_energy():
    """With equal semi-major axes alone, short-period J2 drives neighbours 10 km apart away by tens of metres."""
    chief = chief_on("circular")
    zonals = (J2, J3, J4)
    drift = []
    for deputy in (drift_free.trailing(chief, -10_000.0, ZONAL), kepler_trailing(chief, -10_000.0)):
        track = flown(chief, deputy, points=2, zonals=zonals)
        drift.append(np.linalg.norm(track[1, :3] - track[0, :3]))
    assert drift[0] < 0.5
    assert drift[1] > 20.0


@pytest.mark.parametrize("orbit", ORBITS)
@pytest.mark.parametrize("distance", [-10_000.0, 250.0, 1e6])
def test_trailing_is_on_the_same_orbit_at_that_distance(orbit, distance):
    chief = chief_on(orbit)
    deputy = drift_free.trailing(chief, distance, POINT)
    assert np.linalg.norm(deputy[:3] - chief[:3]) == pytest.approx(abs(distance), rel=1e-9)
    for own, other in zip(
        (np.cross(chief[:3], chief[3:]), laplace(chief)),
        (np.cross(deputy[:3], deputy[3:]), laplace(deputy)),
        strict=True,
    ):
        np.testing.assert_allclose(other, own, atol=1e-13 * np.linalg.norm(np.cross(chief[:3], chief[3:])))
    assert np.sign(rtn_from_eci(chief, deputy)[1]) == np.sign(distance)


def laplace(state):
    """The eccentricity vector, scaled to the size of the angular momentum."""
    r, v = state[:3], state[3:]
    h = np.cross(r, v)
    return (np.cross(v, h) / MU_M3_S2 - r / np.linalg.norm(r)) * np.linalg.norm(h)


def test_a_distance_that_no_orbit_has_is_refused():
    with pytest.raises(ValueError, match=r"more than the perigee's distance from the centre, 7\.5e\+06 m"):
        drift_free.trailing(chief_on("eccentric"), 8e6, POINT)


def test_a_hold_point_holds():
    """On a circular orbit the deputy leaves its point by the second order alone: d^2 / r."""
    chief = chief_on("circular")
    track = flown(chief, drift_free.nearest_to_rest(chief, np.array([0.0, -200.0, 0.0]), POINT))
    np.testing.assert_allclose(track[0, :3], [0, -200, 0], atol=1e-8)
    assert np.abs(track[:, :3] - [0, -200, 0]).max() < 3 * 200**2 / 7.5e6


def test_below_the_chief_begins_an_ellipse_forwards():
    """Clohessy-Wiltshire: 100 m below, free of drift, vy = -2 n x; highest after half a revolution."""
    chief = chief_on("circular")
    track = flown(chief, drift_free.nearest_to_rest(chief, np.array([-100.0, 0.0, 0.0]), POINT))
    n = sqrt(MU_M3_S2 / 7.5e6**3)
    np.testing.assert_allclose(track[0, 3:], [0, 200 * n, 0], atol=1e-4 * 200 * n)
    np.testing.assert_allclose(track[100, :3], [100, 0, 0], atol=0.02)
    np.testing.assert_allclose(track[50, :3], [0, 200, 0], atol=0.02)


@pytest.mark.parametrize("phase_deg", [0.0, 90.0, 200.0])
def test_a_safety_ellipse_has_its_sizes_and_never_crosses_v_bar(phase_deg):
    """Linear motion: x = -A cos(nt + phase), y = centre + 2 A sin(nt + phase), z = B sin(nt + phase)."""
    chief, A, B, centre = chief_on("circular"), 100.0, 150.0, -500.0
    track = flown(chief, drift_free.ellipse(chief, A, B, centre, radians(phase_deg), POINT))
    angle = np.linspace(0, 2 * pi, len(track)) + radians(phase_deg)
    expected = np.stack([-A * np.cos(angle), centre + 2 * A * np.sin(angle), B * np.sin(angle)], axis=-1)
    assert np.abs(track[:, :3] - expected).max() < 6 * 700**2 / 7.5e6
    assert np.hypot(track[:, 0], track[:, 2]).min() > 0.99 * A


def test_potential_is_that_of_the_acceleration():
    position = np.array([4.1e6, -3.2e6, 4.9e6])
    h = 10.0
    slope = [(ZONAL.potential(position + h * e) - ZONAL.potential(position - h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(slope, ZONAL.acceleration(position), atol=1e-8)


def test_too_far_above_there_is_no_such_velocity():
    with pytest.raises(ValueError, match="too far above"):
        drift_free.nearest_to_rest(chief_on("circular"), np.array([8e6, 0.0, 0.0]), POINT)


def test_the_anomalies_of_the_ellipse_are_keplers():
    """Of the mean longitude that the ellipse keeps: deputy minus chief, centre / a."""
    chief = chief_on("near-circular")
    deputy = drift_free.ellipse(chief, 100.0, 0.0, -500.0, 0.4, POINT)
    longitudes = []
    for state in (chief, deputy):
        orbit = elements_from_state(state, MU_M3_S2)
        e, nu = float(orbit.eccentricity), float(orbit.true_anomaly_rad)
        E = 2 * np.arctan2(sqrt(1 - e) * np.sin(nu / 2), sqrt(1 + e) * np.cos(nu / 2))
        M = E - e * np.sin(E)
        assert np.cos(eccentric_anomaly(np.array(M), e)[0] - E) == pytest.approx(1)
        longitudes.append(M + float(orbit.argument_of_perigee_rad))
    turn = (longitudes[1] - longitudes[0] + pi) % (2 * pi) - pi
    assert turn * 7.5e6 / (1 - 1e-3) == pytest.approx(-500.0, abs=1e-6)
