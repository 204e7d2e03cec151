"""Moments, mixing and weights of Gaussian mixtures, against plain NumPy."""

import numpy as np
import pytest
from checks import assert_close, check_runs_are_alone, covariances
from mixtures import mixture, plain_moments

from relnav_sim import kernels


@pytest.mark.parametrize(("n", "c", "runs"), [(1, 1, 1), (3, 2, 40), (8, 4, 33), (6, 8, 300)])
def test_moments_of_mixtures(n, c, runs):
    given = mixture(np.random.default_rng(4), runs, c, n)
    found = kernels.components.moment_match(*given)
    expected = [plain_moments(*one) for one in zip(*given, strict=True)]
    for one, other in zip(found, zip(*expected, strict=True), strict=True):
        assert_close(one, np.array(other))


def test_models_mix_by_the_chain():
    rng = np.random.default_rng(5)
    w, x, P = mixture(rng, 30, 3, 4)
    chain = rng.uniform(size=(3, 3))
    chain /= chain.sum(axis=1, keepdims=True)
    log_weights, means, covariances = kernels.components.mix(np.log(w), chain, x, P)
    assert_close(np.exp(log_weights), w @ chain)
    for run in range(30):
        for j in range(3):
            share = w[run] * chain[:, j] / (w[run] @ chain[:, j])
            mean, covariance = plain_moments(share, x[run], P[run])
            assert_close(means[run, j][None], mean[None])
            assert_close(covariances[run, j][None], covariance[None])


def test_expected_reading_of_a_mixture():
    rng = np.random.default_rng(6)
    w, _, P = mixture(rng, 30, 3, 5)
    offsets, H, R = rng.normal(size=(30, 3, 2)), rng.normal(size=(30, 3, 2, 5)), covariances(rng, 30, 3, 2)
    found = kernels.components.expected_reading(w, offsets, H, P, R)
    S = H @ P @ H.swapaxes(2, 3) + R
    expected = [plain_moments(*one) for one in zip(w, offsets, S, strict=True)]
    for one, other in zip(found, zip(*expected, strict=True), strict=True):
        assert_close(one, np.array(other))


def test_weights_follow_bayes_and_a_broken_component_weighs_nothing():
    rng = np.random.default_rng(7)
    w, x, P = mixture(rng, 30, 4, 3)
    before = mixture(rng, 30, 2, 3)
    log_likelihood = rng.normal(size=(30, 4)) - 500
    P[3, 2, 0, 1] = np.nan
    likelihood = np.exp(log_likelihood + 500)
    likelihood[3, 2] = 0
    log_weights, total = kernels.components.reweigh(np.log(w), x, P, log_likelihood, before[1], before[2])
    joint = w * likelihood
    assert_close(np.exp(log_weights), joint / joint.sum(axis=1, keepdims=True))
    np.testing.assert_allclose(total, np.log(joint.sum(axis=1)) - 500, rtol=1e-12)
    np.testing.assert_array_equal(P[3, 2], before[2][3, 1])
    np.testing.assert_array_equal(x[3, 2], before[1][3, 1])


def test_a_run_is_its_own():
    rng = np.random.default_rng(16)
    runs, n, m, c = 70, 6, 3, 4
    w, x, P = mixture(rng, runs, c, n)
    check_runs_are_alone(kernels.components.moment_match, (w, x, P))
    chain = np.full((c, c), 1 / c)
    check_runs_are_alone(lambda w, x, P: kernels.components.mix(np.log(w), chain, x, P), (w, x, P))
    reading = w, rng.normal(size=(runs, c, m)), rng.normal(size=(runs, c, m, n)), P, covariances(rng, runs, c, m)
    check_runs_are_alone(kernels.components.expected_reading, reading)
    _, x_before, P_before = mixture(rng, runs, 2, n)

    def weighed(prior, log_likelihood):
        return kernels.components.reweigh(prior, x.copy(), P.copy(), log_likelihood, x_before, P_before)

    log_likelihood = rng.normal(size=(runs, c))
    whole = weighed(np.log(w), log_likelihood.copy())
    log_likelihood[1] = np.nan
    for broken, sound in zip(weighed(np.log(w), log_likelihood), whole, strict=True):
        np.testing.assert_array_equal(np.delete(broken, 1, axis=0), np.delete(sound, 1, axis=0))
