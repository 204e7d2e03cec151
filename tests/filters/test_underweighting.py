"""Underweighting of the extended Kalman filter."""

from __future__ import annotations

import numpy as np
import pytest

from relnav_sim import FunctionMeasurement, LinearDynamics, create_filter, run_filter

F = np.eye(6) + np.diag([1.0] * 3, 3)
Q = np.diag([1e-4] * 3 + [1e-6] * 3)
P0 = np.diag([900.0] * 3 + [1.0] * 3)
R = np.diag([1.0, 1e-6, 1e-6])


def h(states, epoch):
    x, y, z = states[..., 0], states[..., 1], states[..., 2]
    return np.stack([np.sqrt(x * x + y * y + z * z), np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))], axis=-1)


def made(**options):
    return create_filter("ekf", LinearDynamics(F, Q), FunctionMeasurement(h, R), **options)


def problem(runs=5, epochs=12):
    rng = np.random.default_rng(2)
    start = np.array([800.0, 300.0, -200.0, 0.5, -0.2, 0.1])
    mean0 = start + rng.standard_normal((runs, 6)) @ np.sqrt(P0)
    truth = np.stack([np.linalg.matrix_power(F, k + 1) @ start for k in range(epochs)])
    z = h(truth, 0) + rng.standard_normal((runs, epochs, 3)) @ np.sqrt(R)
    return z, mean0


def test_inactive_it_is_the_ekf_to_the_bit():
    z, mean0 = problem()
    plain = run_filter(made(), z, mean0, P0)
    idle = run_filter(made(underweighting={"above_m": 1e6}), z, mean0, P0)
    for name in ("mean", "covariance", "nis", "log_likelihood"):
        assert np.array_equal(getattr(plain, name), getattr(idle, name))
    assert not idle.extras["underweighted"].any()


def test_active_it_is_the_text_books_and_ends_by_itself():
    """Zanetti, DeMars and Bishop (2010): S = (1 + beta) H P H^T + R, Joseph's form with the true R."""
    z, mean0 = problem()
    beta, above = 0.3, 20.0
    history = run_filter(made(underweighting={"beta": beta, "above_m": above}), z, mean0, P0)
    measurement = FunctionMeasurement(h, R)
    for run in range(len(z)):
        m, P = mean0[run], P0
        for k, reading in enumerate(z[run]):
            m, P = F @ m, F @ P @ F.T + Q
            J = measurement.jacobian(m[None], k)[0]
            wide = np.sqrt(np.trace(P[:3, :3])) > above
            nu, S = reading - h(m, k), J @ P @ J.T + R
            K = P @ J.T @ np.linalg.inv(S + (beta * J @ P @ J.T if wide else 0))
            np.testing.assert_allclose(history.nis[run, k], nu @ np.linalg.inv(S) @ nu, rtol=1e-6)
            m, P = m + K @ nu, (np.eye(6) - K @ J) @ P @ (np.eye(6) - K @ J).T + K @ R @ K.T
            np.testing.assert_allclose(history.mean[run, k], m, rtol=1e-7, atol=1e-7)
            np.testing.assert_allclose(history.covariance[run, k], P, rtol=1e-6, atol=1e-9)
            assert history.extras["underweighted"][run, k] == wide
    assert history.extras["underweighted"][:, 0].all() and not history.extras["underweighted"][:, -1].any()


def test_bits_of_a_run_do_not_depend_on_the_block():
    z, mean0 = problem()
    options = {"underweighting": {"above_m": 20.0}}
    whole = run_filter(made(**options), z, mean0, P0)
    alone = run_filter(made(**options), z[[3]], mean0[[3]], P0, runs=[3])
    assert np.array_equal(alone.mean[0], whole.mean[3]) and np.array_equal(alone.covariance[0], whole.covariance[3])


@pytest.mark.parametrize("wrong", [{}, {"above_m": 0}, {"above_m": 5, "beta": 0}, {"above_m": 5, "gamma": 1}])
def test_wrong_options_are_refused(wrong):
    with pytest.raises(ValueError, match="underweighting"):
        made(underweighting=wrong)
