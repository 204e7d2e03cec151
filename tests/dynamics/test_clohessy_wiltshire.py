"""The first-order discretisation I + A dt beside the exact transition matrix."""

import numpy as np
import pytest
from scipy.linalg import expm

from relnav_sim import Step, dynamics
from relnav_sim.dynamics.clohessy_wiltshire import cw_system

N = 1.1e-3
# In these units all entries of A dt are of the size of n dt.
UNITS = np.diag([N, N, N, 1.0, 1.0, 1.0])


def transition(step_s, discretisation):
    motion = dynamics.cw(mean_motion_rad_s=N, step_s=step_s, acceleration_psd_m2_s3=1e-6, discretisation=discretisation)
    return motion.transition(np.zeros((1, 6)), Step(0, step_s)), motion.process_noise(np.zeros((1, 6)), Step(0, step_s))


def error(step_s, discretisation):
    F, _ = transition(step_s, discretisation)
    return UNITS @ (F - expm(step_s * cw_system(N))) @ np.linalg.inv(UNITS)


def test_the_error_of_first_order_falls_with_the_square_of_the_step():
    sizes = [np.abs(error(step_s, "euler")).max() for step_s in (80.0, 40.0, 20.0, 10.0)]
    orders = np.log2(sizes[:-1]) - np.log2(sizes[1:])
    np.testing.assert_allclose(orders, 2, atol=0.02)
    assert np.abs(error(80.0, "exact")).max() < 1e-12


def test_its_leading_term_is_half_the_square_of_a_dt():
    A = UNITS @ cw_system(N) @ np.linalg.inv(UNITS)
    leading = -(A @ A) * 10.0**2 / 2
    assert np.abs(error(10.0, "euler") - leading).max() < 0.02 * np.abs(leading).max()


def test_free_motion_grows_as_the_eigenvalues_of_first_order_say():
    """|1 + i n dt| = 1 + (n dt)^2 / 2: across the orbit plane the amplitude grows by exp(n^2 dt t / 2)."""
    step_s, steps = 10.0, 600
    F, _ = transition(step_s, "euler")
    state = np.linalg.matrix_power(F, steps) @ [0, 0, 100.0, 0, 0, 0]
    amplitude = np.hypot(state[2], state[5] / N)
    assert amplitude == pytest.approx(100 * np.exp(N**2 * step_s * steps * step_s / 2), rel=1e-4)


def test_the_process_noise_is_that_of_the_exact_matrix():
    np.testing.assert_array_equal(transition(0.2, "euler")[1], transition(0.2, "exact")[1])
