"""Accelerations against the gradient of the potential, and drag against its formula."""

import numpy as np
import pytest
from numpy.polynomial import legendre

from relnav_sim.truth import ExponentialAtmosphere, ForceModel, propagate


def potential(position, mu, radius, zonals):
    """Return mu / r (1 - sum J_n (R/r)^n P_n(z/r)), in the precision of the position (..., 3)."""
    r = np.sqrt((position * position).sum(-1))
    sine = position[..., 2] / r
    total = np.ones_like(r)
    for n, j in enumerate(zonals, start=2):
        total -= j * (radius / r) ** n * legendre.legval(sine, [0] * n + [1])
    return mu / r * total


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5])
def test_gravity_is_the_gradient_of_the_potential(orbits, count):
    """Central differences of order four in 80-bit arithmetic, good to about 1e-12."""
    zonals = (*orbits.zonals, -2e-7, 5e-7)[:count]
    position = np.random.default_rng(3).normal(size=(50, 3))
    position *= 7.5e6 / np.linalg.norm(position, axis=1)[:, None]
    states = np.hstack([position, np.zeros((50, 3))])
    step, gradient = np.longdouble(2000.0), np.empty((50, 3))
    for axis in range(3):
        shift = np.zeros(3, dtype=np.longdouble)
        shift[axis] = step
        u = [potential(position + k * shift, orbits.mu, orbits.radius, zonals) for k in (-2, -1, 1, 2)]
        gradient[:, axis] = (u[0] - 8 * u[1] + 8 * u[2] - u[3]) / (12 * step)
    force = ForceModel(orbits.mu, orbits.radius, zonals)
    assert np.abs(force.acceleration(states) - gradient).max() < 2e-12 * 7.1


def test_on_the_equator_and_over_the_pole(orbits):
    """J2 there in closed form: 1 + 3/2 J2 (R/r)^2, and 1 - 3 J2 (R/r)^2."""
    force = ForceModel(orbits.mu, orbits.radius, orbits.zonals[:1])
    r = 7e6
    q = orbits.zonals[0] * (orbits.radius / r) ** 2
    pull = force.acceleration([[r, 0, 0, 0, 0, 0], [0, 0, r, 0, 0, 0]])
    expected = -orbits.mu / r**2 * np.array([[1 + 1.5 * q, 0, 0], [0, 0, 1 - 3 * q]])
    np.testing.assert_allclose(pull, expected, rtol=1e-15, atol=1e-18)


def test_drag_against_its_formula(orbits):
    state = orbits.orbit()
    still = ForceModel(orbits.mu, orbits.radius, ())
    air = ForceModel(orbits.mu, orbits.radius, (), ExponentialAtmosphere(400e3, 3.7e-12, 58e3), 7.3e-5)
    wind = state[3:] - np.cross([0, 0, 7.3e-5], state[:3])
    density = 3.7e-12 * np.exp(-(np.linalg.norm(state[:3]) - orbits.radius - 400e3) / 58e3)
    expected = -0.5 * 0.02 * density * np.linalg.norm(wind) * wind
    drag = air.acceleration(state, 0.02) - still.acceleration(state)
    np.testing.assert_allclose(drag, expected, atol=4e-15)


def test_no_drag_without_wind_and_ballistic_broadcasts(orbits):
    force = orbits.force()
    r = orbits.radius + 4e5
    turning = [r, 0, 0, 0, r * 7.292115e-5, 0]
    assert np.array_equal(force.acceleration(turning, 0.02), orbits.force(drag=False).acceleration(turning))
    states = orbits.dispersed(6).reshape(2, 3, 6)
    coefficients = np.array([0.01, 0.02, 0.03])
    together = force.acceleration(states, coefficients)
    assert together.shape == (2, 3, 3)
    assert np.array_equal(together[1, 2], force.acceleration(states[1, 2], 0.03))


def test_normal_acceleration_is_the_part_along_the_orbit_normal(orbits):
    states, force = orbits.dispersed(20, e=0.1, spread=100), orbits.force()
    normal = np.cross(states[:, :3], states[:, 3:])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    expected = (force.acceleration(states, 0.02) * normal).sum(1)
    np.testing.assert_allclose(force.normal_acceleration(states, 0.02), expected, atol=1e-15)
    assert force.normal_acceleration(list(states[3]), 0.02) == pytest.approx(expected[3], abs=1e-15)
    assert np.abs(expected).max() > 1e-3


def test_energy_and_polar_momentum_are_conserved_for_a_day(orbits):
    """Zonal gravity has a potential and an axis: E and h_z stay to 1e-14 of themselves, about the state's rounding."""
    states = np.stack([orbits.orbit(e=0.01), orbits.orbit(a=2.7e7, e=0.7, i=np.pi / 2), orbits.orbit(i=2.0)])
    force = orbits.force(4, drag=False)
    path = propagate(states, np.linspace(0, 86400, 97), force)
    energy = (path[..., 3:] ** 2).sum(-1) / 2 - potential(path[..., :3], orbits.mu, orbits.radius, orbits.zonals)
    assert np.abs(energy / energy[:, :1] - 1).max() < 1e-13
    polar = path[..., 0] * path[..., 4] - path[..., 1] * path[..., 3]
    momentum = np.linalg.norm(np.cross(states[:, :3], states[:, 3:]), axis=1)[:, None]
    assert np.abs((polar - polar[:, :1]) / momentum).max() < 1e-13


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: ForceModel(0.0, 6.4e6), "mu_m3_s2 is 0.0; it must be a positive number"),
        (lambda: ForceModel(4e14, -1.0), "radius_m is -1.0; it must be a positive number"),
        (lambda: ForceModel(4e14, 6.4e6, (np.nan,)), "zonals and rotation_rad_s must be finite"),
        (lambda: ExponentialAtmosphere(4e5, -1e-12, 6e4), "density_kg_m3 is -1e-12; it must be a positive number"),
        (lambda: ExponentialAtmosphere(4e5, 1e-12, 0.0), "scale_height_m is 0.0; it must be a positive number"),
        (lambda: ExponentialAtmosphere(np.inf, 1e-12, 6e4), "base_altitude_m is inf"),
    ],
)
def test_bad_constants_are_named(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()
