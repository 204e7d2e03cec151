import numpy as np
import pytest
from gravity_in_lanes import difference
from scipy.integrate import solve_ivp

from relnav_sim.astro.constants import MU_M3_S2
from relnav_sim.astro.gravity import Gravity
from relnav_sim.dynamics.clohessy_wiltshire import CwOptions, cw_system
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.quadratic import CwSecondOrderOptions, quadratic_acceleration
from relnav_sim.dynamics.two_body import NonlinearOptions

RADIUS = 7e6
RATE = np.sqrt(MU_M3_S2 / RADIUS**3)


def remainder(position):
    """Return the acceleration beyond Clohessy and Wiltshire's."""
    chief = np.array([RADIUS, 0, 0])[None, :, None]
    full = difference(Gravity(MU_M3_S2), chief, np.array(position, dtype=float)[None, :, None])[0, :, 0]
    return full - RATE**2 * np.array([2.0, -1.0, -1.0]) * position


def quadratic(position):
    return np.einsum("kij,i,j->k", quadratic_acceleration(RATE, RADIUS)[:, :3, :3], position, position)


@pytest.mark.parametrize(
    ("position", "axis", "expected"),
    [([0, 12e3, 0], 0, 3.586e-5), ([12e3, 0, 0], 0, -7.16e-5), ([0, 0, 12e3], 0, 3.59e-5)],
)
def test_size_of_the_quadratic_terms(position, axis, expected):
    assert quadratic(position)[axis] == pytest.approx(expected, rel=2e-3)


def test_what_is_left_out_is_of_third_order():
    # Along-track the cubic terms are 3 n^2 y^3 / (2 R^2).
    left = remainder([0, 12e3, 0]) - quadratic([0, 12e3, 0])
    assert np.linalg.norm(left) == pytest.approx(1.5 * RATE**2 * 12e3**3 / RADIUS**2, rel=1e-3)
    for direction in np.random.default_rng(2).normal(size=(5, 3)):
        near, far = (np.linalg.norm(remainder(d) - quadratic(d)) for d in (1e3 * direction, 2e3 * direction))
        assert far / near == pytest.approx(8, rel=0.01)


@pytest.mark.parametrize("step_s", [1.0, 60.0, 300.0])
def test_error_falls_with_the_cube_of_the_separation(scene, step_s):
    s = scene(0.0)
    second, exact = (
        o().build(DynamicsContext(s.orbit, s.noise, step_s)) for o in (CwSecondOrderOptions, NonlinearOptions)
    )
    errors = []
    for separation in (10e3, 20e3):
        x = s.deputies(separation)
        errors.append(np.abs(second.propagate(x, Step(1)) - exact.propagate(x, Step(1)))[:, :3].max())
    # The velocities after a step of 1 s differ by less than rounding shows in the positions.
    if step_s > 1:
        assert errors[1] / errors[0] == pytest.approx(8, rel=0.3)
    assert errors[0] < 1e-6 * step_s**2


def test_map_solves_the_quadratic_equations(scene):
    """The quadratic map of many short steps is the flow of the equations it comes from."""
    s = scene(0.0)
    n, radius = s.orbit.mean_motion_rad_s, s.orbit.semi_major_axis_m
    A, a2 = cw_system(n), quadratic_acceleration(n, radius)
    x0 = s.deputies(12e3, 1)[0]

    def slope(t, x):
        bend = np.einsum("kij,i,j->k", a2, x, x)
        return A @ x + np.concatenate([np.zeros(3), bend])

    expected = solve_ivp(slope, (0, 3000.0), x0, method="DOP853", rtol=1e-13, atol=1e-10).y[:, -1]
    dynamics, x = CwSecondOrderOptions().build(DynamicsContext(s.orbit, s.noise, 1.0)), x0[None]
    for k in range(1, 3001):
        x = dynamics.propagate(x, Step(k))
    np.testing.assert_allclose(x[0, :3], expected[:3], atol=1e-5)
    np.testing.assert_allclose(x[0, 3:], expected[3:], atol=1e-8)


@pytest.mark.parametrize(("separation", "tolerance"), [(1e2, 3e-5), (1e3, 3e-2), (12e3, 50.0)])
@pytest.mark.parametrize("i_deg", [0.5, 97.6])
def test_one_period(scene, separation, tolerance, i_deg):
    s = scene(0.0, i_deg)
    step, steps = s.period_s / 500, 500
    x0 = s.deputies(separation)
    truth = s.truth(x0, np.arange(steps + 1) * step)[1][:, -1]
    errors = {}
    for options in (CwOptions(), CwSecondOrderOptions()):
        dynamics, x = options.build(DynamicsContext(s.orbit, s.noise, step)), x0
        for k in range(1, steps + 1):
            x = dynamics.propagate(x, Step(k))
        errors[options.kind] = np.linalg.norm((x - truth)[:, :3], axis=1).max()
    assert errors["cw_second_order"] < tolerance
    assert errors["cw_second_order"] < 0.1 * errors["cw"]
