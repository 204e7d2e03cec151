import numpy as np
import pytest

from relnav_sim.models.cw import CwOptions
from relnav_sim.models.cw_second_order import CwSecondOrderOptions, quadratic_acceleration
from relnav_sim.models.dynamics import Step
from relnav_sim.models.gravity import Gravity
from relnav_sim.models.nonlinear import NonlinearOptions
from relnav_sim.truth.constants import MU_M3_S2

RADIUS = 7e6
RATE = np.sqrt(MU_M3_S2 / RADIUS**3)


def remainder(position):
    """Return the acceleration beyond Clohessy and Wiltshire's."""
    chief = np.array([RADIUS, 0, 0])[None, :, None]
    full = Gravity(MU_M3_S2).difference(chief, np.array(position, dtype=float)[None, :, None])[0, :, 0]
    return full - RATE**2 * np.array([2.0, -1.0, -1.0]) * position


def quadratic(position):
    return np.einsum("kij,i,j->k", quadratic_acceleration(RATE, RADIUS)[:, :3, :3], position, position)


@pytest.mark.parametrize(
    ("position", "axis", "expected"), [([0, 12e3, 0], 0, 3.586e-5), ([12e3, 0, 0], 0, -7.16e-5), ([0, 0, 12e3], 0, 3.59e-5)]
)
def test_size_of_the_quadratic_terms(position, axis, expected):
    assert quadratic(position)[axis] == pytest.approx(expected, rel=2e-3)


def test_what_is_left_out_is_of_third_order():
    # At y = 12 km: 3.6e-5 m/s^2 in the quadratic terms, 6e-8 beyond them.
    left = remainder([0, 12e3, 0]) - quadratic([0, 12e3, 0])
    assert np.linalg.norm(left) == pytest.approx(9.2e-8, rel=0.05)
    for direction in np.random.default_rng(2).normal(size=(5, 3)):
        near, far = (np.linalg.norm(remainder(d) - quadratic(d)) for d in (1e3 * direction, 2e3 * direction))
        assert far / near == pytest.approx(8, rel=0.01)


@pytest.mark.parametrize("step_s", [1.0, 60.0, 300.0])
def test_error_falls_with_the_cube_of_the_separation(scene, step_s):
    s = scene(0.0)
    second, exact = (o().build(s.orbit, s.noise, step_s) for o in (CwSecondOrderOptions, NonlinearOptions))
    errors = []
    for separation in (10e3, 20e3):
        x = s.deputies(separation)
        errors.append(np.abs(second.propagate(x, Step(1)) - exact.propagate(x, Step(1)))[:, :3].max())
    # The velocities after a step of 1 s differ by less than rounding shows in the positions.
    if step_s > 1:
        assert errors[1] / errors[0] == pytest.approx(8, rel=0.3)
    assert errors[0] < 1e-6 * step_s**2


@pytest.mark.parametrize("e_tolerance", [(1e2, 3e-5), (1e3, 1e-2), (12e3, 20.0)])
def test_one_period(scene, e_tolerance):
    separation, tolerance = e_tolerance
    s = scene(0.0)
    step, steps = s.period_s / 500, 500
    x0 = s.deputies(separation)
    truth = s.truth(x0, np.arange(steps + 1) * step)[1][:, -1]
    errors = {}
    for options in (CwOptions(), CwSecondOrderOptions()):
        dynamics, x = options.build(s.orbit, s.noise, step), x0
        for k in range(1, steps + 1):
            x = dynamics.propagate(x, Step(k))
        errors[options.kind] = np.linalg.norm((x - truth)[:, :3], axis=1).max()
    assert errors["cw_second_order"] < tolerance
    assert errors["cw_second_order"] < 0.05 * errors["cw"]
