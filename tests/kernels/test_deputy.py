"""The chief seen from the deputy against the frame's definition, and its derivatives against differences."""

import numpy as np
import pytest
from checks import check_runs_are_alone

from relnav_sim import kernels

CHIEFS = [(7.0e6, 0.0, 1.0780e-3), (8.1e6, -1.3e3, 1.1e-3)]  # R, its rate, n


def problem(points, n):
    rng = np.random.default_rng([points, n])
    return rng.standard_normal((points, n)) * np.resize([900.0] * 3 + [0.5] * 3, n)


def seen(state, R, climb, n):
    """The same from inertial vectors of both craft."""
    chief, rotation = np.array([R, 0.0, 0.0]), np.array([0.0, 0.0, n])
    d = chief + state[:3]
    velocity = np.array([climb, 0.0, 0.0]) + state[3:6] + np.cross(rotation, d)
    radial, normal = d / np.linalg.norm(d), np.cross(d, velocity)
    normal = normal / np.linalg.norm(normal)
    return np.array([radial, np.cross(normal, radial), normal]) @ (chief - d)


@pytest.mark.parametrize("chief", CHIEFS)
@pytest.mark.parametrize(("points", "n"), [(1, 6), (7, 8), (33, 12), (1000, 6)])
def test_where_the_chief_is_seen(points, n, chief):
    states = problem(points, n)
    expected = np.array([seen(state, *chief) for state in states])
    np.testing.assert_allclose(kernels.deputy.chief_seen(states, *chief), expected, rtol=1e-12, atol=1e-9)
    c, J = kernels.deputy.chief_seen_with_jacobian(states, *chief)
    np.testing.assert_array_equal(c, kernels.deputy.chief_seen(states, *chief))
    width = np.repeat([10.0, 0.1], 3)  # the map is almost linear
    for j in range(6):
        ahead, behind = states.copy(), states.copy()
        ahead[:, j] += width[j]
        behind[:, j] -= width[j]
        difference = (kernels.deputy.chief_seen(ahead, *chief) - kernels.deputy.chief_seen(behind, *chief)) / (
            2 * width[j]
        )
        np.testing.assert_allclose(J[:, :, j], difference, rtol=1e-7, atol=1e-9 / width[j])
    if points > 1:
        check_runs_are_alone(kernels.deputy.chief_seen_with_jacobian, (states,), *chief)
