"""The recursions against closed forms, and against one covariance of everything at once."""

import numpy as np
import pytest

from relnav_sim.budget.linearised import LinearFilter
from relnav_sim.budget.recursion import FixedSourceOfError, RandomSourceOfError, means, variances


def scalar(kept=0.6, transition=0.95, gain=0.4, left_out=0.3, epochs=400):
    """Return a scalar filter in its steady state: e_k = kept (transition e_{k-1} - left_out) + gain s_k."""
    one = np.ones((epochs, 1, 1))
    response = gain * one
    response[0] = 0.0
    return LinearFilter(
        times_s=np.arange(float(epochs)),
        transition=kept * transition * one,
        kept=kept * one,
        left_out=left_out * one[:, :, 0],
        response=response,
        offset=np.zeros(1),
        formal=one,
    )


A, G = 0.6 * 0.95, 0.4


def test_white_noise_leaves_the_steady_variance():
    found = variances(scalar(), [RandomSourceOfError("white", 0, 0.0, 2.0)], 1)
    assert found[0, -1, 0] == pytest.approx(4 * G**2 / (1 - A**2), rel=1e-12)


@pytest.mark.parametrize("phi", [0.3, 0.9, 0.99])
def test_correlated_noise_leaves_the_variance_of_a_filtered_markov_process(phi):
    found = variances(scalar(epochs=4000), [RandomSourceOfError("markov", 0, phi, 2.0)], 1)
    # e = A e + G s with a stationary s of correlation phi: G^2 sigma^2 (1 + A phi) / ((1 - A^2) (1 - A phi)).
    expected = 4 * G**2 * (1 + A * phi) / ((1 - A**2) * (1 - A * phi))
    assert found[0, -1, 0] == pytest.approx(expected, rel=1e-12)


def test_a_number_that_a_run_keeps_is_a_bias_of_random_size():
    drawn = variances(scalar(), [RandomSourceOfError("kept", 0, 1.0, 2.0)], 1)
    fixed = means(scalar(), [FixedSourceOfError("fixed", 0, 2.0)], 1)
    np.testing.assert_allclose(drawn, fixed**2, rtol=1e-12)
    assert fixed[0, -1, 0] == pytest.approx(2 * G / (1 - A), rel=1e-12)


def test_what_the_dynamics_leave_out():
    found = means(scalar(), [FixedSourceOfError("left out", left_out=True)], 1)
    assert found[0, -1, 0] == pytest.approx(-0.6 * 0.3 / (1 - A), rel=1e-12)


def test_a_scalar_kalman_filter_states_the_sum_of_its_parts():
    """With the process noise as a source too, prior and noises add up to the solution of the Riccati equation."""
    F, Q, R, P, T = 0.9, 0.5, 2.0, 3.0, 50
    transition, response, formal = np.zeros((T, 1, 1)), np.zeros((T, 1, 2)), np.zeros((T, 1, 1))
    formal[0], transition[0] = P, 1.0
    for k in range(1, T):
        predicted = F * P * F + Q
        K = predicted / (predicted + R)
        P = (1 - K) * predicted
        transition[k], response[k, 0], formal[k] = (1 - K) * F, (K, 1 - K), P
    filter = LinearFilter(np.arange(float(T)), transition, transition, np.zeros((T, 1)), response, np.zeros(1), formal)
    parts = [
        RandomSourceOfError("start", None, 0.0, 0.0, np.array([[3.0]])),
        RandomSourceOfError("readings", 0, 0.0, np.sqrt(R)),
        RandomSourceOfError("process noise", 1, 0.0, np.sqrt(Q)),
    ]
    np.testing.assert_allclose(variances(filter, parts, 1).sum(axis=0)[:, 0], formal[:, 0, 0], rtol=1e-12)


def test_parts_sum_to_the_covariance_of_everything_at_once():
    """Independent sources: the parts against one recursion of [e; s] with every s in it, as a text-book has it."""
    rng = np.random.default_rng(1)
    T, n, J = 60, 8, 5
    kept = np.eye(n) - 0.3 * rng.random((T, n, n)) / n
    response = rng.normal(size=(T, n, J))
    filter = LinearFilter(
        np.arange(float(T)), kept @ (np.eye(n) + 0.05 * rng.normal(size=(T, n, n))), kept, rng.normal(size=(T, n)),
        response, np.zeros(n), kept,
    )  # fmt: skip
    phi, sigma = np.array([0.0, 0.0, 0.8, 0.97, 1.0]), np.array([1.0, 2.0, 0.5, 3.0, 0.7])
    start = np.diag(rng.random(n))
    sources = [RandomSourceOfError(str(j), j, phi[j], sigma[j]) for j in range(J)]
    found = variances(filter, [*sources, RandomSourceOfError("start", None, 0.0, 0.0, start)]).sum(axis=0)
    whole = np.zeros((n + J, n + J))
    whole[n:, n:] = np.diag(sigma**2)
    whole[:n, n:] = response[0] @ whole[n:, n:]
    whole[n:, :n] = whole[:n, n:].T
    whole[:n, :n] = start + response[0] @ whole[n:, n:] @ response[0].T
    for k in range(T):
        if k:
            step = np.zeros_like(whole)
            step[:n, :n], step[:n, n:], step[n:, n:] = filter.transition[k], response[k] * phi, np.diag(phi)
            noise = np.concatenate([response[k], np.eye(J)]) * np.sqrt(1 - phi**2) * sigma
            whole = step @ whole @ step.T + noise @ noise.T
        np.testing.assert_allclose(found[k], np.diag(whole)[:6], rtol=1e-10)
