"""Covariances stay symmetric to the bit, and singular ones give the exact answer or a reason."""

import warnings

import numpy as np
import pytest
from exact_kalman import exact_kalman
from scipy.linalg import expm, solve_discrete_are
from scipy.stats import multivariate_normal
from taking_turns import taking_turns

from relnav_sim import (
    FunctionMeasurement,
    LinearDynamics,
    LinearMeasurement,
    MixtureNoise,
    create_filter,
    run_filter,
    smooth,
)
from relnav_sim.crlb.recursion import BoundRecursion, matrix_root
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.kalman import joseph_update
from relnav_sim.filters.registry import filter_kinds

I2, NONE = np.eye(2), np.zeros((2, 2))
CV, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
ONE, TWO = np.random.default_rng(1).normal(size=(6, 1)), np.random.default_rng(2).normal(size=(6, 2))
LIMITS = {  # of filters that tend to the Kalman filter
    "huber": {"threshold": 1e9},
    "student_t": {"degrees_of_freedom": 1e12},
    "mckf": {"bandwidth": 1e9},
}
KALMAN = ("kf", "ekf", "ud_ekf", "iekf", "ukf", "ckf", "sr_ukf", "imm", "gaussian_sum", *LIMITS)
NEED_NOISE = ("two_step", "adaptive_two_step", "adaptive_alpha_kf")

SINGULAR = {
    "noise_free": (CV, Q, [[1, 0]], [[0]], ONE, I2),
    "one_exact_channel": (CV, Q, I2, np.diag([0, 1]), TWO, I2),
    "the_other_exact": (CV, Q, I2, np.diag([1, 0]), TWO, I2),
    "duplicate_sensor": (CV, Q, [[1, 0], [1, 0]], [[1, 1], [1, 1]], ONE.repeat(2, axis=1), I2),
    "duplicate_exact": (CV, Q, [[1, 0], [1, 0]], NONE, ONE.repeat(2, axis=1), I2),
    "duplicate_then_another": (
        CV,
        Q,
        [[1, 0], [1, 0], [0.3, 1]],
        np.diag([0, 0, 0.5]),
        np.concatenate([ONE, ONE, TWO[:, :1]], axis=1),
        I2,
    ),
    "correlated_noise": (CV, Q, I2, [[1, 1], [1, 1]], TWO, I2),
    "exact_sum": (CV, Q, [[1, 1]], [[0]], ONE, I2),
    "same_exact_reading_again": (I2, NONE, [[1, 0]], [[0]], np.full((4, 1), 3.0), I2),
    "exact_line": (CV, NONE, [[1, 0]], [[0]], (2 + 0.3 * np.arange(1, 7))[:, None], I2),
}
TRUTH = np.array([np.linalg.matrix_power(CV, k + 1) @ [2.0, -1.0] for k in range(6)])
ROTATED = np.array([[1.0, 1.0], [1.0, -1.0]])
FROM_AFAR = {  # F, Q, H, R, z, mean0, cov0
    "same_exact_sum_again": (I2, NONE, [[0.1, 0.3]], [[0]], np.full((6, 1), 2.1), [0.3, 1e3], [[2, 0.3], [0.3, 1]]),
    "exact_positions_of_a_wide_prior": (CV, NONE, [[1, 0]], [[0]], TRUTH[:, :1], [1e3, 0], 1e8 * I2),
    "both_exact": (CV, NONE, ROTATED, NONE, TRUTH @ ROTATED.T, [0, 0], I2),
}
KNOWN = {
    "first_known": (I2, NONE, [[1, 1]], [[1]], ONE, np.diag([0, 1])),
    "second_known": (I2, NONE, [[1, 1]], [[1]], ONE, np.diag([1, 0])),
    "all_known": (CV, NONE, [[1, 0]], [[1]], ONE, NONE),
    "known_at_the_start": (CV, Q, [[1, 0]], [[1]], ONE, NONE),
    "line_known": (CV, NONE, [[1, 0]], [[1]], ONE, [[1, 1], [1, 1]]),
    "noise_of_rank_one": (CV, np.outer([0.5, 1], [0.5, 1]), [[1, 0]], [[1]], ONE, I2),
}
WIDE = {
    "first": ([[1, 0]], ONE),
    "both": (np.eye(2), TWO),
    "twice": ([[1, 0], [1, 0]], ONE.repeat(2, axis=1)),
}
PRECISE = (1e-4, 1e-6, 1e-8, 1e-10)
OF_A_WIDE_PRIOR = ("kf", "ekf", "ud_ekf", "srif", "iekf", "ukf", "ckf", "sr_ukf", "huber", "imm", "gaussian_sum")


def run(name, problem):
    F, noise, H, R, z, covariance = problem
    flt = create_filter(name, LinearDynamics(F, noise), LinearMeasurement(H, R), **LIMITS.get(name, {}))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # what `failures` says too
        return run_filter(flt, z[None], [0, 0], np.array(covariance, dtype=float))


def assert_exact(history, problem, sigmas):
    F, noise, H, R, z, covariance = problem
    mean, P = exact_kalman(F, noise, H, R, z, [0, 0], covariance)
    assert not history.failures
    sd = np.sqrt(np.einsum("kii->ki", P).clip(0))
    # A state known exactly is right to the rounding of the readings.
    assert (np.abs(history.mean[0] - mean) <= sigmas * sd + 1e-12 * np.abs(z).max()).all()
    assert (np.abs(history.covariance[0] - P) <= sigmas * sd[:, :, None] * sd[:, None] + 1e-15).all()
    assert np.isfinite(history.nis).all()
    assert np.isfinite(history.log_likelihood).all()


@pytest.mark.parametrize("name", KALMAN)
@pytest.mark.parametrize("case", [*SINGULAR, *KNOWN])
def test_singular_covariances_are_no_obstacle(name, case):
    problem = (SINGULAR | KNOWN)[case]
    assert_exact(run(name, problem), problem, 1e-11)


@pytest.mark.parametrize(
    "name, case, R", taking_turns([(name, case) for name in OF_A_WIDE_PRIOR for case in WIDE], PRECISE)
)
def test_a_wide_prior_meets_a_precise_reading(name, case, R):
    H, z = WIDE[case]
    problem = (I2, NONE, H, R * np.eye(len(H)), z, 1e8 * I2)
    assert_exact(run(name, problem), problem, 1e-6)


@pytest.mark.parametrize("name", ["kf", "ud_ekf", "iekf", "ukf", "ckf", "sr_ukf", "huber", "imm", "gaussian_sum"])
@pytest.mark.parametrize("case", FROM_AFAR)
def test_what_is_known_is_told_from_rounding(name, case):
    F, noise, H, R, z, mean0, covariance = FROM_AFAR[case]
    history = run_filter(
        create_filter(name, LinearDynamics(F, noise), LinearMeasurement(H, R)), z[None], mean0, covariance
    )
    mean, P = exact_kalman(F, noise, H, R, z, mean0, covariance)
    size = np.abs(mean).max() + np.abs(mean0).max()
    sd = np.sqrt(np.einsum("kii->ki", P).clip(0))
    assert not history.failures
    assert (np.abs(history.mean[0] - mean) <= 1e-3 * sd + 1e-11 * size).all()
    known = sd < 1e-9 * np.sqrt(np.max(covariance))
    variances = np.einsum("kii->ki", history.covariance[0])
    assert (variances[known] <= 1e-25 * np.max(covariance)).all()
    np.testing.assert_allclose(variances[~known], np.square(sd[~known]), rtol=1e-4)


@pytest.mark.parametrize("beside", [False, True], ids=["alone", "noisy_channel_beside"])
@pytest.mark.parametrize("name", KALMAN)
def test_what_is_known_is_told_from_the_rounding_of_many_runs(name, beside):
    """The same sum is read exactly four times, from 100 priors: each rounds in its own way, whatever the machine."""
    rng, runs, h, g, variance = np.random.default_rng(5), 100, np.array([0.7, -1.9]), np.array([1.1, 0.4]), 0.04
    A = rng.normal(size=(runs, 2, 2))
    cov0 = A @ A.swapaxes(1, 2) + 0.05 * I2
    mean0 = rng.normal(size=(runs, 2)) * 10 ** rng.uniform(-1, 4, size=(runs, 1))
    x = mean0 + np.einsum("bij,bj->bi", np.linalg.cholesky(cov0), rng.normal(size=(runs, 2)))
    z = np.stack([x @ h, x @ g], axis=1)[:, None] + np.sqrt(variance) * rng.normal(size=(runs, 4, 1)) * [0, 1]
    rows = [0, 1] if beside else [0]
    measurement = LinearMeasurement(np.array([h, g])[rows], np.diag([0, variance])[np.ix_(rows, rows)])
    flt = create_filter(name, LinearDynamics(I2, NONE), measurement, **LIMITS.get(name, {}))
    history = run_filter(flt, z[:, :, rows], mean0, cov0)
    # Conditioned on h x, what is left is one number, the state along n, which the other channel reads four times.
    n, Ph = np.array([-h[1], h[0]]) / np.linalg.norm(h), cov0 @ h
    mean = mean0 + Ph * ((z[:, 0, 0] - mean0 @ h) / (Ph @ h))[:, None]
    P = np.einsum("i,bij,j->b", n, cov0, n) - (Ph @ n) ** 2 / (Ph @ h)
    if beside:
        left = (z[:, :, 1] - (mean @ g)[:, None]).sum(axis=1)
        P = 1 / (1 / P + 4 * (g @ n) ** 2 / variance)
        mean = mean + np.outer(P * (g @ n) * left / variance, n)
    assert not history.failures
    error, size = history.mean[:, -1] - mean, np.abs(mean0).max(axis=1)
    assert (np.abs(error @ h) <= 1e-14 * (1 + size)).all()
    assert (np.abs(error @ n) <= 1e-5 * np.sqrt(P) + 1e-12 * size).all()
    np.testing.assert_allclose(history.covariance[:, -1], P[:, None, None] * np.outer(n, n), rtol=1e-5, atol=1e-13)


@pytest.mark.parametrize("R", [1e-8, 1e-12])
@pytest.mark.parametrize("name", ["kf", "iekf", "ukf", "two_step", "adaptive_alpha_kf", "huber", "imm"])
def test_a_velocity_that_drowns_in_rounding_is_refused(name, R):
    # Two positions to R tell the velocity to 2 R; the covariance before it, 5e7, ends at 1e-8.
    problem = (CV, NONE, [[1, 0]], [[R]], TRUTH[:, :1], 1e8 * I2)
    assert run(name, problem).failures[0].epoch == 1
    assert not run("sr_ukf", problem).failures
    assert not run("ud_ekf", problem).failures


def test_a_singular_innovation_has_scipys_degenerate_density():
    H, R = np.array([[1.0, 0.2], [1.0, 0.2], [0.3, 1.0]]), np.diag([0.0, 0.0, 0.5])
    P, nu = np.array([[2.0, 0.4], [0.4, 1.0]]), np.array([0.7, 0.7, -0.4])
    with np.errstate(all="ignore"):  # as `run_filter` does
        _, innovation = joseph_update(Gaussian(np.zeros((1, 2)), P[None]), nu[None], H, R)
    S = H @ P @ H.T + R
    assert innovation.nis[0] == pytest.approx(nu @ np.linalg.pinv(S) @ nu, rel=1e-9)
    # The density on the range of S: of the two readings that differ, in their own units.
    distinct = multivariate_normal.logpdf(nu[1:], np.zeros(2), S[1:, 1:])
    assert innovation.log_likelihood[0] == pytest.approx(distinct, abs=1e-10)


def test_components_of_a_state_known_in_part_merge():
    """With one state known the answer is that of the other state alone, which no singular matrix enters."""
    noise = MixtureNoise([0.8, 0.2], [[[1.0]], [[25.0]]])
    z = np.random.default_rng(3).normal(size=(2, 30, 1))
    both = create_filter("gaussian_sum", LinearDynamics(I2, np.diag([0.0, 0.1])), LinearMeasurement([[1, 1]], noise))
    alone = create_filter("gaussian_sum", LinearDynamics([[1.0]], [[0.1]]), LinearMeasurement([[1]], noise))
    found, expected = run_filter(both, z, [0, 0], np.diag([0.0, 1.0])), run_filter(alone, z, [0], [[1.0]])
    np.testing.assert_allclose(found.mean[..., 1], expected.mean[..., 0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.log_likelihood, expected.log_likelihood, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(found.covariance[..., 0, 0], 0.0)


def test_smoother_and_bound_are_symmetric_to_the_bit():
    F = 1.2 * np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    dynamics = LinearDynamics(F, I2)
    z = np.random.default_rng(0).normal(size=(2, 60, 1))
    history = run_filter(create_filter("kf", dynamics, LinearMeasurement([[1, 0]], [[1]])), z, [0, 0], I2)
    P = smooth(history, dynamics).covariance
    np.testing.assert_array_equal(P, P.swapaxes(-1, -2))
    recursion = BoundRecursion(np.eye(2))
    for _ in range(50):
        recursion.advance(F, matrix_root(Q), np.array([[1.0, 0.3]]))
        np.testing.assert_array_equal(recursion.covariance, recursion.covariance.T)


@pytest.mark.parametrize("name", ["mkf", "skf", "alpha_kf"])
@pytest.mark.parametrize("case", ["noise_free", "duplicate_exact", "same_exact_reading_again"])
def test_sampling_filters_fall_back_where_nothing_can_be_weighed(name, case):
    assert_exact(run(name, SINGULAR[case]), SINGULAR[case], 1e-11)


@pytest.mark.parametrize("name", NEED_NOISE)
@pytest.mark.parametrize("case", SINGULAR)
def test_filters_that_need_noise_say_so(name, case):
    history = run(name, SINGULAR[case])
    assert [(one.epoch, "this filter needs noise" in one.reason) for one in history.failures] == [(0, True)]
    assert np.isnan(history.mean).all()


@pytest.mark.parametrize("name", ["kf", "ekf", "ud_ekf", "iekf", "ukf", "sr_ukf", "huber", "skf", "imm"])
def test_a_reading_that_contradicts_what_is_known_fails_the_run_alone(name):
    z = np.array([[[0.0], [0.0]], [[0.0], [1e-3]]])
    flt = create_filter(name, LinearDynamics(I2, NONE), LinearMeasurement([[1, 0]], [[0.0]]))
    with pytest.warns(RuntimeWarning, match="run 1 at epoch 1"):
        history = run_filter(flt, z, [0, 0], np.diag([0.0, 1.0]))
    assert [(one.run, one.epoch) for one in history.failures] == [(1, 1)]
    np.testing.assert_array_equal(history.mean[0], 0.0)


@pytest.mark.parametrize("name", ["kf", "iekf", "ukf", "skf", "imm", "gaussian_sum"])
def test_digits_that_a_covariance_cannot_hold_are_refused(name):
    # The sum is known to 1e-4, position and velocity to 1e4 each: P must hold 1e-8 beside 1e8.
    problem = (CV, NONE, [[1, 1]], [[1e-8]], ONE, 1e8 * I2)
    history = run(name, problem)
    assert history.failures
    assert name in ("imm", "gaussian_sum") or "take sr_ukf" in history.failures[0].reason
    assert_exact(run("sr_ukf", problem), problem, 1e-3)


def test_an_exact_nonlinear_reading_is_met_exactly():
    beacon = FunctionMeasurement(lambda x, epoch: np.linalg.norm(x[..., :2], axis=-1, keepdims=True), [[0.0]])
    flt = create_filter("iekf", LinearDynamics(I2, NONE), beacon)
    history = run_filter(flt, np.full((1, 1, 1), 5.0), [2.0, 1.0], I2)
    assert not history.failures
    # The nearest point of the circle, by Lagrange: along the prior mean. The search ends within 1e-8 sigma.
    np.testing.assert_allclose(history.mean[0, 0], 5 * np.array([2, 1]) / np.sqrt(5), atol=1e-8)
    # Met once, it tells nothing when it comes again, however the first update was rounded.
    mean0 = np.array([3.0, 4.0]) + np.random.default_rng(6).normal(scale=0.1, size=(50, 2))
    again = run_filter(flt, np.full((50, 4, 1), 5.0), mean0, 0.01 * I2)
    assert not again.failures
    nearest = 5 * mean0 / np.linalg.norm(mean0, axis=1, keepdims=True)
    np.testing.assert_allclose(again.mean, np.repeat(nearest[:, None], 4, axis=1), rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", filter_kinds())
def test_covariances_are_symmetric_to_the_bit_where_modes_grow(name):
    c, s = np.cos(0.5), np.sin(0.5)
    F = 1.2 * np.array([[c, -s], [s, c]])
    z = np.random.default_rng(0).normal(size=(1, 100, 1))
    history = run_filter(create_filter(name, LinearDynamics(F, I2), LinearMeasurement([[1, 0]], [[1]])), z, [0, 0], I2)
    np.testing.assert_array_equal(history.covariance, history.covariance.swapaxes(-1, -2))
    assert np.isfinite(history.mean).all()
    if name in KALMAN and name not in LIMITS:
        mean, P = exact_kalman(F, I2, [[1, 0]], [[1]], z[0], [0, 0], I2)
        np.testing.assert_allclose(history.mean[0], mean, atol=1e-12)
        np.testing.assert_allclose(history.covariance[0], P, atol=1e-12)


@pytest.mark.parametrize("name", ["kf", "ukf"])
def test_a_long_chain_of_integrators_stays_on_riccatis_solution(name):
    n, A = 4, np.eye(4, k=1)
    E = expm(np.block([[-A, np.diag([0, 0, 0, 1e-8])], [np.zeros((n, n)), A.T]]))
    F, H, R = expm(A), np.eye(1, n), np.eye(1)
    noise = E[n:, n:].T @ E[:n, n:]
    noise = (noise + noise.T) / 2
    z = np.zeros((1, 4000, 1))
    history = run_filter(
        create_filter(name, LinearDynamics(F, noise), LinearMeasurement(H, R)), z, np.zeros(n), np.eye(n)
    )
    predicted = solve_discrete_are(F.T, H.T, noise, R)
    P = predicted - predicted @ H.T @ H @ predicted / (predicted[0, 0] + 1)
    sd = np.sqrt(np.diag(P))
    np.testing.assert_array_equal(history.covariance[0], history.covariance[0].swapaxes(-1, -2))
    np.testing.assert_allclose(history.covariance[0, -1] / np.outer(sd, sd), P / np.outer(sd, sd), atol=1e-9)


def test_a_reading_outside_the_gate_does_not_fail_a_run():
    flt = create_filter("kf", LinearDynamics(I2, NONE), LinearMeasurement([[1, 0]], [[0.0]]), gate_probability=0.999)
    history = run_filter(flt, np.array([[[0.0], [1e-3], [0.0]]]), [0, 0], np.diag([0.0, 1.0]))
    assert not history.failures
    np.testing.assert_array_equal(history.extras["rejected"][0], [0, 1, 0])
    np.testing.assert_array_equal(history.mean, 0.0)


def test_rare_runs_do_not_touch_the_bits_of_the_others():
    rng = np.random.default_rng(3)
    z, covariance = rng.normal(size=(3, 8, 2)), np.stack([I2, NONE, 1e9 * I2])
    for name in ("kf", "ud_ekf", "iekf", "ukf", "sr_ukf", "huber", "skf"):
        flt = create_filter(name, LinearDynamics(CV, Q), LinearMeasurement(I2, np.diag([1e-7, 1.0])))
        whole = run_filter(flt, z, [0, 0], covariance)
        for b in range(3):
            alone = run_filter(flt, z[b : b + 1], [0, 0], covariance[b : b + 1], runs=[b])
            np.testing.assert_array_equal(alone.mean[0], whole.mean[b])
            np.testing.assert_array_equal(alone.covariance[0], whole.covariance[b])
