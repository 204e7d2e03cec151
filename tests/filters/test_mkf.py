"""mkf: the posterior's own moments, and its place in the family."""

import numpy as np
import pytest
from radar_problem import radar_problem

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter

STILL = LinearDynamics(np.eye(1), np.zeros((1, 1)))


def squared(states, epoch):
    return np.square(states[..., :1])


def test_moments_of_a_posterior_with_two_modes():
    # z = x^2 = 4: modes near +-2; the prior mean 0.3 tells them apart a little.
    z, R, m, P = 4.0, 0.5, 0.3, 2.0
    x = np.linspace(-8, 8, 200_001)
    p = np.exp(-0.5 * (z - x**2) ** 2 / R - 0.5 * (x - m) ** 2 / P)
    p /= p.sum()
    mean = (p * x).sum()
    variance = (p * np.square(x - mean)).sum()
    measurement = FunctionMeasurement(squared, [[R]])
    fixed = run_filter(create_filter("mkf", STILL, measurement, sampling="fixed", samples=2**15), [[[z]]], [m], [[P]])
    assert np.isclose(fixed.mean[0, 0, 0], mean, atol=3e-3)
    assert np.isclose(fixed.covariance[0, 0, 0, 0], variance, rtol=3e-3)
    runs = 200
    random = run_filter(create_filter("mkf", STILL, measurement), np.full((runs, 1, 1), z), [m], [[P]])
    # The mean over runs, five standard errors; 1/ESS bounds the bias.
    ess = random.extras["ess"].mean()
    assert abs(random.mean.mean() - mean) < 5 * random.mean.std() / np.sqrt(runs) + np.sqrt(variance) / ess
    # A single run: the mean is off by sqrt(variance / ESS), give or take.
    assert 0.5 < random.mean.std() / np.sqrt(variance / ess) < 2


def test_is_alpha_kf_at_alpha_one():
    p = radar_problem(runs=2, steps=10)
    options = {"samples": 1000, "sampling": "antithetic", "proposal": "posterior", "gate_probability": 0.999}
    mkf = run_filter(create_filter("mkf", p.dynamics, p.measurement, **options), p.z, p.mean0, p.cov0)
    alpha = run_filter(create_filter("alpha_kf", p.dynamics, p.measurement, alpha=1.0, **options), p.z, p.mean0, p.cov0)
    assert np.array_equal(mkf.mean, alpha.mean)
    assert np.array_equal(mkf.covariance, alpha.covariance)
    assert np.array_equal(mkf.nis, mkf.extras["nis_tempered"])
    assert "rejected" in mkf.extras
    with pytest.raises(ValueError, match="alpha"):
        create_filter("mkf", p.dynamics, p.measurement, alpha=0.5)


def test_linear_tracking_is_the_kalman_filter():
    p = radar_problem(runs=10, steps=100)
    measurement = LinearMeasurement(np.eye(3, 6), 25.0 * np.eye(3))
    z = p.truth[..., :3] + 5.0 * np.random.default_rng(1).standard_normal(p.truth[..., :3].shape)
    kalman = run_filter(create_filter("kf", p.dynamics, measurement), z, p.mean0, p.cov0)
    sampled = run_filter(
        create_filter("mkf", p.dynamics, measurement, sampling="fixed", samples=4096), z, p.mean0, p.cov0
    )
    sigma = np.sqrt(np.einsum("...ii->...i", kalman.covariance))
    assert np.sqrt(np.square((sampled.mean - kalman.mean) / sigma)[:, 20:].mean()) < 0.02
    assert np.array_equal(sampled.nis[:, 0], kalman.nis[:, 0])


def test_tracks_the_radar_problem_as_well_as_the_extended_filter():
    p = radar_problem(runs=10, steps=100)
    settled = np.s_[:, 30:, :3]
    rms = {}
    for kind, options in (("ekf", {}), ("mkf", {"samples": 2000, "sampling": "fixed"})):
        history = run_filter(create_filter(kind, p.dynamics, p.measurement, **options), p.z, p.mean0, p.cov0)
        rms[kind] = np.sqrt(np.square(history.mean - p.truth)[settled].mean())
    assert abs(rms["mkf"] / rms["ekf"] - 1) < 0.05
