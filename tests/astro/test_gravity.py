import numpy as np
import pytest
from gravity_in_lanes import acceleration, difference, gradient, harmonics
from plain_orbits import pulled

from relnav_sim import ForceModel
from relnav_sim.astro.constants import J2, J3, J4, MU_M3_S2, RADIUS_M
from relnav_sim.astro.gravity import Gravity

ZONALS = {"point mass": (), "J2": (J2,), "J2, J3": (J2, J3), "J2 to J4": (J2, J3, J4)}
GRAVITIES = [Gravity(MU_M3_S2, RADIUS_M, *zonals) for zonals in ZONALS.values()]
each_gravity = pytest.mark.parametrize("gravity", GRAVITIES, ids=list(ZONALS))


def exactly(gravity, positions):
    """Return the acceleration at positions (s, 3, ...) with 64 bits of mantissa."""
    return np.moveaxis(sum(pulled((gravity.j2, gravity.j3, gravity.j4), np.moveaxis(positions, 1, -1))), -1, 1)


@pytest.fixture
def positions():
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(4, 3, 5))
    return 7.1e6 * directions / np.linalg.norm(directions, axis=1, keepdims=True)


@each_gravity
def test_acceleration_is_the_truths(gravity, positions):
    force = ForceModel(MU_M3_S2, RADIUS_M, zonals=(gravity.j2, gravity.j3, gravity.j4))
    states = np.concatenate([np.moveaxis(positions, 1, -1), np.zeros((4, 5, 3))], axis=-1)
    expected = np.moveaxis(force.acceleration(states), -1, 1)
    np.testing.assert_allclose(acceleration(gravity, positions), expected, rtol=1e-14, atol=1e-15)


@each_gravity
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3, 1e5])
def test_difference_keeps_its_digits(gravity, size, positions):
    offset = size * np.random.default_rng(4).normal(size=positions.shape)
    chief, moved = positions.astype(np.longdouble), positions.astype(np.longdouble) + offset
    expected = exactly(gravity, moved) - exactly(gravity, chief)
    # The reference is good to 1e-19 of 8 m/s^2; in double precision it would be wrong by 1e-15 m/s^2. J2's own
    # difference is taken directly, at 1e-16 of 2e-2 m/s^2.
    atol = 3e-17 if gravity.j2 else 3e-18
    np.testing.assert_allclose(difference(gravity, positions, offset), expected.astype(float), rtol=2e-13, atol=atol)


@each_gravity
def test_gradient_is_the_slope_of_the_acceleration(gravity, positions):
    G = gradient(gravity, positions)
    scale = MU_M3_S2 / 7.1e6**3
    for j in range(3):
        aside = np.zeros((1, 3, 1))
        aside[0, j] = 1e3
        slope = (exactly(gravity, positions + aside) - exactly(gravity, positions - aside)).astype(float) / 2e3
        np.testing.assert_allclose(np.moveaxis(G[:, j], 0, 1), slope, atol=1e-6 * scale)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_each_harmonic_is_the_slope_of_its_potential(n, positions):
    """Potential -mu/r J_n (R/r)^n P_n(z/r), differentiated numerically with 64 bits of mantissa."""
    j = {2: J2, 3: J3, 4: J4}[n]
    gravity = Gravity(MU_M3_S2, RADIUS_M, **{f"j{n}": j})

    def potential(p):
        r = np.sqrt(np.square(p).sum(axis=1))
        polynomial = np.polynomial.legendre.leg2poly([0] * n + [1]).astype(np.longdouble)
        return -MU_M3_S2 / r * j * (RADIUS_M / r) ** n * sum(c * (p[:, 2] / r) ** k for k, c in enumerate(polynomial))

    exact = positions.astype(np.longdouble)
    found = harmonics(gravity, positions)
    for i in range(3):
        aside = np.zeros((1, 3, 1), dtype=np.longdouble)
        aside[0, i] = 10
        slope = ((potential(exact + aside) - potential(exact - aside)) / 20).astype(float)
        # The error of the central difference: 100 m^2 / 6 of a third derivative, some n^2 g j / r^2.
        np.testing.assert_allclose(found[:, i], slope, atol=1e-9 * abs(j))
