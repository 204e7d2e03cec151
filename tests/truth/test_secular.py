"""Slow drifts over days against first-order theory."""

import numpy as np
import pytest

from relnav_sim.astro.orbits import elements_from_state
from relnav_sim.truth import ExponentialAtmosphere, ForceModel, eci_from_rtn, propagate, rtn_from_eci


@pytest.mark.parametrize("i", [0.5, 1.1071487, 1.7])
def test_node_and_perigee_turn_at_the_j2_rates(orbits, i):
    """Kozai (1959), first order in J2: rates within a per cent of the node's, the size of J2 times a few."""
    a, e, j2 = 8.2e6, 0.12, orbits.zonals[0]
    force = ForceModel(orbits.mu, orbits.radius, (j2,))
    period = 2 * np.pi * np.sqrt(a**3 / orbits.mu)
    times = np.linspace(0, 30 * period, 30 * 64 + 1)
    path = propagate(orbits.orbit(a=a, e=e, i=i)[None], times, force, rtol=1e-10)[0]
    elements = elements_from_state(path, orbits.mu)
    # Means over whole revolutions remove the short-period terms.
    mean_a, mean_e, mean_i = (
        np.mean(np.asarray(x)[:-1])
        for x in (elements.semi_major_axis_m, elements.eccentricity, elements.inclination_rad)
    )
    factor = 1.5 * j2 * np.sqrt(orbits.mu / mean_a**3) * (orbits.radius / (mean_a * (1 - mean_e**2))) ** 2
    node_rate = -factor * np.cos(mean_i)
    perigee_rate = factor * (2 - 2.5 * np.sin(mean_i) ** 2)

    def rate(angle):
        revolutions = np.unwrap(angle)[:-1].reshape(30, 64).mean(axis=1)
        return (revolutions[-1] - revolutions[0]) / (29 * period)

    assert rate(np.asarray(elements.raan_rad)) == pytest.approx(node_rate, abs=0.01 * factor)
    assert rate(np.asarray(elements.argument_of_perigee_rad)) == pytest.approx(perigee_rate, abs=0.02 * factor)


@pytest.mark.parametrize("i", [0.1, 1.5707963])
def test_a_circular_orbit_decays_at_the_rate_of_its_drag(orbits, i):
    """da/dt = -2 a^2 / mu * (drag power): -rho B sqrt(mu a), with the wind of the turning air to second order."""
    a, ballistic = orbits.radius + 4e5, 0.02
    air = ExponentialAtmosphere(400e3, 3.7e-12, 58e3)
    force = ForceModel(orbits.mu, orbits.radius, (), air)
    day = propagate(orbits.orbit(a=a, i=i)[None], np.linspace(0, 43200, 481), force, ballistic)[0]
    decay = np.diff(np.asarray(elements_from_state(day, orbits.mu).semi_major_axis_m)[[0, -1]])[0] / 43200
    mean_a = a + decay * 43200 / 2
    speed = np.sqrt(orbits.mu / mean_a)
    density = air.density(np.array(mean_a - orbits.radius))
    # Mean over a revolution of |w| w.v / v^2 for the wind w = v - omega x r.
    turn = 7.292115e-5 * mean_a / speed
    wind_factor = 1 - 2 * turn * np.cos(i) + turn**2 * (1 + 3 * np.cos(i) ** 2) / 4
    expected = -density * ballistic * speed * mean_a * wind_factor
    assert decay == pytest.approx(expected, rel=1e-3)


def test_the_clohessy_wiltshire_limit(orbits):
    """A metre of separation about a point mass follows the linear solution up to its square over the radius."""
    a = 7e6
    n = np.sqrt(orbits.mu / a**3)
    chief = orbits.orbit(a=a)
    start = np.array([1.0, -2.0, 0.5, 1e-3, -1.5e-3, 2e-3])
    times = np.linspace(0, 6000, 61)
    path = propagate(np.stack([chief, eci_from_rtn(chief, start)]), times, orbits.force(0, drag=False))
    relative = rtn_from_eci(path[0], path[1])
    x, y, z, vx, vy, vz = start
    s, c = np.sin(n * times), np.cos(n * times)
    expected = [
        (4 - 3 * c) * x + s / n * vx + 2 / n * (1 - c) * vy,
        6 * (s - n * times) * x + y - 2 / n * (1 - c) * vx + (4 * s / n - 3 * times) * vy,
        c * z + s / n * vz,
    ]
    size = np.abs(expected).max()
    assert np.abs(relative[:, :3].T - expected).max() < 5 * size**2 / a + 1e-6
