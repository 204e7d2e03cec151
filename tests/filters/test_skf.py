"""skf against the Kalman filter and the variational optimum found by other means."""

import numpy as np
import pytest
from radar_problem import polar, polar_jacobian, radar_problem
from scipy.optimize import minimize
from test_kalman_filters import linear_problem, plain_kalman

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter

STILL = LinearDynamics(np.eye(1), np.zeros((1, 1)))


class PolarOfPosition(FunctionMeasurement):
    depends_on = (0, 1, 2)


def test_linear_problem_is_exact_with_few_samples():
    dynamics, measurement, z, mean0, cov0, (F, Q, H, R) = linear_problem()
    history = run_filter(create_filter("skf", dynamics, measurement, samples=32), z, mean0, cov0)
    for run in range(len(z)):
        means, covariances, log_likelihood = plain_kalman(z[run], mean0[run], cov0, F, Q, H, R)
        # Nothing is sampled but rounding: the control variate is the measurement itself.
        assert np.allclose(history.mean[run], means, rtol=0, atol=1e-9)
        assert np.allclose(history.covariance[run], covariances, rtol=0, atol=1e-9)
        assert np.allclose(history.log_likelihood[run], log_likelihood, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("P", "R"), [(1.0, 4.0), (2.0, 1.0), (4.0, 1.0)])
def test_search_from_the_prior_goes_to_the_kalman_update(P, R):
    z, posterior = 1.5, P * R / (P + R)
    errors = []
    for iterations in (20, 2000):
        history = run_filter(
            create_filter(
                "skf", STILL, LinearMeasurement([[1.0]], [[R]]), samples=32, start="prior", iterations=iterations
            ),
            [[[z]]],
            [0.0],
            [[P]],
        )
        errors.append(history.covariance[0, 0, 0, 0] - posterior)
    assert np.isclose(history.mean[0, 0, 0], z * P / (P + R), rtol=1e-3)
    # Steps of 1/t on a gradient of half the exact size leave (20 / 2000)^(1/2) of what is left after 20.
    assert abs(errors[0]) < 0.15 * posterior
    assert np.isclose(errors[1] / errors[0], 0.1, rtol=0.15)


@pytest.mark.parametrize("z", [pytest.param(1.2, marks=pytest.mark.slow), 3.0])
def test_nonlinear_update_is_the_variational_optimum(z):
    R, m, P = 0.3, 1.0, 0.4

    def h(x):
        return x + 0.3 * x**2

    points, weights = np.polynomial.hermite_e.hermegauss(60)
    weights = weights / weights.sum()

    def negative_bound(parameters):
        mean, log_sigma = parameters
        x = mean + np.exp(log_sigma) * points
        fit = weights @ (0.5 * (z - h(x)) ** 2 / R)
        return fit + 0.5 * ((mean - m) ** 2 + np.exp(2 * log_sigma)) / P - log_sigma

    best = minimize(negative_bound, [m, np.log(np.sqrt(P))], tol=1e-12).x
    runs = 40
    history = run_filter(
        create_filter(
            "skf", STILL, FunctionMeasurement(lambda x, k: h(x[..., :1]), [[R]]), iterations=200, samples=1000
        ),
        np.full((runs, 1, 1), z),
        [m],
        [[P]],
    )
    sigma = np.exp(best[1])
    means, variances = history.mean[:, 0, 0], history.covariance[:, 0, 0, 0]
    assert abs(means.mean() - best[0]) < 5 * means.std() / np.sqrt(runs) + 2e-3 * sigma
    assert abs(variances.mean() / sigma**2 - 1) < 5 * (variances.std() / sigma**2) / np.sqrt(runs) + 0.01
    assert means.std() < 0.03 * sigma


def test_locks_to_one_of_two_modes_and_does_not_span_them():
    z, R, m, P = 4.0, 0.5, 0.3, 2.0
    measurement = FunctionMeasurement(lambda x, k: np.square(x[..., :1]), [[R]])
    history = run_filter(create_filter("skf", STILL, measurement), np.full((50, 1, 1), z), [m], [[P]])
    assert np.allclose(history.mean[:, 0, 0], 2.0, atol=0.1)
    assert (history.covariance[:, 0, 0, 0] < 0.1).all()


def test_prior_as_wide_as_the_range():
    p = radar_problem(runs=20, steps=10, range_m=12_000.0)
    measurement = PolarOfPosition(polar, p.R, polar_jacobian, angles=(1, 2))
    wide = 1000**2 * p.cov0
    mean0 = p.mean0 + np.random.default_rng(2).standard_normal((20, 6)) * np.sqrt(np.diag(wide))
    history = run_filter(create_filter("skf", p.dynamics, measurement), p.z, mean0, wide)
    iterated = run_filter(create_filter("iekf", p.dynamics, measurement), p.z, mean0, wide)
    sigma = np.sqrt(np.einsum("...ii->...i", iterated.covariance))
    assert np.abs((history.mean - iterated.mean) / sigma).max() < 0.3
    assert not history.extras["fallback"].any()


def test_breakdown_falls_back():
    def cliff(states, epoch):
        return np.where(states[..., :1] < 0.5, states[..., :1], np.nan)

    measurement = FunctionMeasurement(cliff, [[1.0]], jacobian=lambda x, k: np.ones((*x.shape[:-1], 1, 1)))
    history = run_filter(create_filter("skf", STILL, measurement), [[[0.2]]], [0.0], [[1.0]])
    assert history.extras["fallback"][0, 0] == 1
    assert np.allclose([history.mean[0, 0, 0], history.covariance[0, 0, 0, 0]], [0.1, 0.5])


def test_a_run_does_not_depend_on_its_block():
    p = radar_problem(runs=4, steps=6)
    measurement = PolarOfPosition(polar, p.R, polar_jacobian, angles=(1, 2))
    p.z[1, 2] = np.nan
    for start in ("posterior", "prior"):
        filter = create_filter("skf", p.dynamics, measurement, samples=100, iterations=5, start=start)
        together = run_filter(filter, p.z, p.mean0, p.cov0, seed=5)
        for run in range(4):
            alone = run_filter(filter, p.z[run : run + 1], p.mean0[run : run + 1], p.cov0, seed=5, runs=[run])
            assert np.array_equal(alone.mean[0], together.mean[run])
            assert np.array_equal(alone.covariance[0], together.covariance[run])
