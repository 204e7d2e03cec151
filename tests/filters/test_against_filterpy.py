"""The batched filters against filterpy, an independent library that filters one run at a time."""

import numpy as np
import pytest
from radar_problem import polar, polar_jacobian, radar_problem

from relnav_sim import create_filter, run_filter

filterpy_kalman = pytest.importorskip("filterpy.kalman")

SHORT = 750
"""Epochs in which the azimuth crosses +-pi."""
UNSCENTED = {"alpha": 0.5, "beta": 2.0, "kappa": 1.0}


def wrapped(a, b):
    difference = a - b
    difference[1:] = np.mod(difference[1:] + np.pi, 2 * np.pi) - np.pi
    return difference


@pytest.fixture(scope="module")
def problem():
    problem = radar_problem(runs=2, steps=3000, step_s=4.0)
    azimuth = problem.z[0, :SHORT, 1]
    assert (np.abs(np.diff(azimuth)) > np.pi).any(), "the problem must cross +-pi"
    return problem


def run_peer(problem, run, kind, epochs):
    if kind == "ekf":
        peer = filterpy_kalman.ExtendedKalmanFilter(dim_x=6, dim_z=3)
    else:
        points = filterpy_kalman.MerweScaledSigmaPoints(6, **UNSCENTED)
        peer = filterpy_kalman.UnscentedKalmanFilter(
            dim_x=6, dim_z=3, dt=1.0, hx=polar, fx=lambda x, dt: problem.F @ x, points=points
        )
        peer.residual_z = wrapped
        peer.z_mean = lambda sigmas, weights: sigmas[0] + weights @ np.array([wrapped(s, sigmas[0]) for s in sigmas])
    peer.x, peer.P = problem.mean0[run].copy(), problem.cov0.copy()
    peer.F, peer.Q, peer.R = problem.F, problem.Q, problem.R
    means, log_likelihoods = [], []
    for z in problem.z[run, :epochs]:
        peer.predict()
        if kind == "ekf":
            # filterpy passes the predicted state to both functions.
            peer.update(z, polar_jacobian, polar, residual=wrapped)
        else:
            # filterpy keeps the propagated points; drawing them again is what relnav does by default.
            peer.sigmas_f = points.sigma_points(peer.x, peer.P)
            peer.update(z)
        means.append(peer.x.copy())
        residual, S = np.asarray(peer.y).ravel(), peer.S
        log_likelihoods.append(
            -0.5 * (residual @ np.linalg.solve(S, residual) + np.linalg.slogdet(S)[1] + 3 * np.log(2 * np.pi))
        )
    return np.array(means), np.array(log_likelihoods)


@pytest.mark.parametrize(
    "kind, options, runs, epochs",
    [
        ("ekf", {}, 1, 2 * SHORT),
        ("ukf", UNSCENTED, 1, SHORT),
        pytest.param("ekf", {}, 2, 3000, marks=pytest.mark.slow),
        pytest.param("ukf", UNSCENTED, 2, 3000, marks=pytest.mark.slow),
    ],
)
def test_agrees_with_filterpy_over_hundreds_of_steps(problem, kind, options, runs, epochs):
    filter = create_filter(kind, problem.dynamics, problem.measurement, **options)
    history = run_filter(filter, problem.z[:runs, :epochs], problem.mean0[:runs], problem.cov0)
    for run in range(runs):
        means, log_likelihoods = run_peer(problem, run, kind, epochs)
        mean = history.mean[run]
        assert np.abs(mean[:, :3] - means[:, :3]).max() < 1e-8
        assert np.abs(mean[:, 3:] - means[:, 3:]).max() < 1e-10
        assert np.abs(history.log_likelihood[run] - log_likelihoods).max() < 1e-6
