import numpy as np
import pytest
from scipy.integrate import solve_ivp

from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.elliptic import YamanakaAnkersenOptions, elliptic_transition
from relnav_sim.dynamics.interface import Step


def numerical_transition(orbit, start_s, end_s):
    """Return the transition matrix of the linear equations in time, integrated with the true anomaly beside them."""
    e, mu = orbit.eccentricity, orbit.mu_m3_s2
    parameter = orbit.semi_major_axis_m * (1 - e * e)
    h = np.sqrt(mu * parameter)

    def slope(t, y):
        rho = 1 + e * np.cos(y[0])
        rate, k = h * rho**2 / parameter**2, mu * rho**3 / parameter**3
        spin_up = -2 * rate**2 * e * np.sin(y[0]) / rho
        A = np.zeros((6, 6))
        A[:3, 3:] = np.eye(3)
        A[3, 0], A[3, 1], A[3, 4] = rate**2 + 2 * k, spin_up, 2 * rate
        A[4, 0], A[4, 1], A[4, 3] = -spin_up, rate**2 - k, -2 * rate
        A[5, 2] = -k
        return np.concatenate([[rate], (A @ y[1:].reshape(6, 6)).ravel()])

    y = np.concatenate([[orbit.true_anomaly_rad], np.eye(6).ravel()])
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-16}
    if start_s > 0:
        y[0] = solve_ivp(slope, (0, start_s), y, **options).y[0, -1]
    return solve_ivp(slope, (start_s, end_s), y, **options).y[1:, -1].reshape(6, 6)


@pytest.mark.parametrize("e", [0.0, 0.05, 0.3, 0.7])
@pytest.mark.parametrize(("start", "share"), [(0.0, 0.01), (0.2, 0.3), (0.6, 1.0)])
def test_matches_a_numerical_transition_matrix(scene, e, start, share):
    s = scene(e)
    expected = numerical_transition(s.orbit, start * s.period_s, (start + share) * s.period_s)
    F = elliptic_transition(s.orbit, np.array([start * s.period_s]), share * s.period_s)[0]
    # In units of one over the perigee's rate, which makes the entries comparable.
    units = np.repeat([1.0, 1e3], 3)
    scaled, reference = (matrix * units[:, None] / units for matrix in (F, expected))
    assert np.abs(scaled - reference).max() < 1e-9 * np.abs(reference).max()


def test_circular_orbit_gives_clohessy_and_wiltshire(scene):
    orbit = scene(0.0).orbit
    for step_s in (0.2, 60.0, 3000.0):
        F = elliptic_transition(orbit, np.array([0.0, 1234.5]), step_s)
        expected = cw_transition(orbit.mean_motion_rad_s, step_s)
        np.testing.assert_allclose(F, np.broadcast_to(expected, F.shape), atol=1e-11)


@pytest.mark.parametrize("e", [0.1, 0.7])
@pytest.mark.parametrize("i_deg", [0.5, 51.6, 97.6])
def test_one_period_against_the_truth(scene, e, i_deg):
    s = scene(e, i_deg)
    step, steps = s.period_s / 300, 300
    x0 = np.concatenate([s.deputies(100.0), s.deputies(50.0)])
    truth = s.truth(x0, np.arange(steps + 1) * step)[1][:, -1]
    dynamics, x = YamanakaAnkersenOptions().build(DynamicsContext(s.orbit, s.noise, step)), x0
    for k in range(1, steps + 1):
        x = dynamics.propagate(x, Step(k))
    # What a linear model leaves out is of second order.
    far, near = np.linalg.norm((x - truth)[:, :3], axis=1).reshape(2, -1)
    assert far.max() < (0.05 if e < 0.5 else 1.0)
    np.testing.assert_allclose(far / near, 4, rtol=0.02)
