import numpy as np
import pytest

from relnav_sim import ForceModel
from relnav_sim.models.gravity import Gravity
from relnav_sim.truth.constants import J2, MU_M3_S2, RADIUS_M

GRAVITIES = [Gravity(MU_M3_S2), Gravity(MU_M3_S2, RADIUS_M, J2)]


@pytest.fixture
def positions():
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(4, 3, 5))
    return 7.1e6 * directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("gravity", GRAVITIES, ids=["point mass", "J2"])
def test_acceleration_is_the_truths(gravity, positions):
    force = ForceModel(MU_M3_S2, RADIUS_M, zonals=(gravity.j2,) if gravity.j2 else ())
    states = np.concatenate([np.moveaxis(positions, 1, -1), np.zeros((4, 5, 3))], axis=-1)
    expected = np.moveaxis(force.acceleration(states), -1, 1)
    np.testing.assert_allclose(gravity.acceleration(positions), expected, rtol=1e-14, atol=1e-15)


@pytest.mark.parametrize("gravity", GRAVITIES, ids=["point mass", "J2"])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3, 1e5])
def test_difference_keeps_its_digits(gravity, size, positions):
    offset = size * np.random.default_rng(4).normal(size=positions.shape)
    chief, moved = positions.astype(np.longdouble), positions.astype(np.longdouble) + offset
    expected = gravity.acceleration(moved) - gravity.acceleration(chief)
    # The reference is good to 1e-19 of 8 m/s^2; in double precision it would be wrong by 1e-15 m/s^2. J2's own
    # difference is taken directly, at 1e-16 of 2e-2 m/s^2.
    atol = 3e-17 if gravity.j2 else 3e-18
    np.testing.assert_allclose(gravity.difference(positions, offset), expected.astype(float), rtol=2e-13, atol=atol)


@pytest.mark.parametrize("gravity", GRAVITIES, ids=["point mass", "J2"])
def test_gradient_is_the_slope_of_the_acceleration(gravity, positions):
    G = gravity.gradient(positions)
    scale = MU_M3_S2 / 7.1e6**3
    for j in range(3):
        aside = np.zeros((1, 3, 1))
        aside[0, j] = 1e3
        slope = (gravity.acceleration(positions + aside) - gravity.acceleration(positions - aside)) / 2e3
        np.testing.assert_allclose(np.moveaxis(G[:, j], 0, 1), slope, atol=1e-6 * scale)
