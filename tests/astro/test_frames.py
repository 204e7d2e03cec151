"""RTN and ECI, the rate of the orbit frame, and other axes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from relnav_sim.astro.frames import rtn_from_shi2025, shi2025_from_rtn
from relnav_sim.truth import eci_from_rtn, propagate, rtn_from_eci

relative_states = hnp.arrays(float, (4, 6), elements=st.floats(-1e5, 1e5))


@settings(deadline=None, max_examples=50)
@given(relative_states, st.floats(-0.02, 0.02), st.integers(0, 1000))
def test_the_two_directions_are_inverses(orbits, relative, normal, seed):
    """To the rounding of an inertial state: 1e-9 m and 1e-12 m/s, times a few."""
    chief = orbits.dispersed(4, seed, e=0.3, spread=100)
    back = rtn_from_eci(chief, eci_from_rtn(chief, relative, normal), normal)
    scale = np.repeat([1e-8, 1e-11], 3) * 2
    assert (np.abs(back - relative) < scale + 1e-14 * np.abs(relative).max()).all()


def test_the_axes(orbits):
    """x along the radius, z along r x v, y to complete them."""
    chief = orbits.orbit(e=0.2)
    for axis in range(3):
        unit = np.zeros(6)
        unit[axis] = 1000.0
        direction = (eci_from_rtn(chief, unit) - chief)[:3] / 1000.0
        normal = np.cross(chief[:3], chief[3:])
        expected = [chief[:3], np.cross(normal, chief[:3]), normal][axis]
        np.testing.assert_allclose(direction, expected / np.linalg.norm(expected), atol=1e-12)


def test_relative_velocity_is_the_derivative_of_the_components(orbits):
    """Central differences of order six of the RTN position over a second; without a_N the error is 1e-3 m/s."""
    force, ballistic = orbits.force(), 0.02
    chief = orbits.orbit(e=0.05)
    deputy = eci_from_rtn(chief, np.array([300.0, -900.0, 700.0, 0.3, -0.2, 0.4]))
    centres = np.linspace(10, 6000, 50)
    times = (centres[:, None] + np.arange(-3, 4)).ravel()
    path = propagate(np.stack([chief, deputy]), times, force, ballistic).reshape(2, 50, 7, 6)
    normal = force.normal_acceleration(path[0], ballistic)
    relative = rtn_from_eci(path[0], path[1], normal)
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60
    derivative = np.einsum("k,tkc->tc", weights, relative[..., :3])
    error = np.abs(relative[:, 3, 3:] - derivative).max()
    assert error < 3e-9
    naive = rtn_from_eci(path[0], path[1])[:, 3, 3:]
    assert np.abs(naive - derivative).max() > 5e-4


def test_leading_axes_broadcast(orbits):
    chief = orbits.dispersed(3)
    deputy = orbits.dispersed(6, 1).reshape(2, 3, 6)
    together = rtn_from_eci(chief, deputy, np.array([0.0, 1e-3, 2e-3]))
    assert together.shape == (2, 3, 6)
    assert np.array_equal(together[1, 2], rtn_from_eci(chief[2], deputy[1, 2], 2e-3))


def test_nan_states_stay_alone(orbits):
    chief = orbits.dispersed(2)
    chief[0] = np.nan
    relative = rtn_from_eci(chief, orbits.dispersed(2, 1))
    assert np.isnan(relative[0]).all() and np.isfinite(relative[1]).all()


def test_a_chief_without_an_orbit_plane_is_refused():
    with pytest.raises(ValueError, match="span no orbit plane"):
        rtn_from_eci([7e6, 0, 0, 1.0, 0, 0], np.zeros(6))
    with pytest.raises(ValueError, match=r"shape \(5,\); it must be \(\.\.\., 6\)"):
        rtn_from_eci(np.ones(5), np.ones(6))


def test_the_axes_of_shi_et_al():
    """x along-track, y minus orbit normal, z nadir: right-handed, and back."""
    rtn = np.random.default_rng(0).normal(size=(5, 6))
    other = shi2025_from_rtn(rtn)
    np.testing.assert_array_equal(
        other, np.stack([rtn[:, 1], -rtn[:, 2], -rtn[:, 0], rtn[:, 4], -rtn[:, 5], -rtn[:, 3]], 1)
    )
    assert np.array_equal(rtn_from_shi2025(other), rtn)
    matrix = shi2025_from_rtn(np.hstack([np.eye(3), np.zeros((3, 3))]))[:, :3].T
    assert np.linalg.det(matrix) == 1
