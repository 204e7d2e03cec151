"""Kalman prediction and update against plain NumPy, over sizes and numbers of runs."""

import numpy as np
import pytest
from checks import assert_close, check_runs_are_alone, covariances

from relnav_sim import kernels

SIZES = [(1, 1, 1), (2, 1, 3), (6, 3, 1), (6, 3, 50), (8, 3, 33), (9, 6, 32), (12, 12, 5), (6, 3, 1000)]


def problem(n, m, runs, seed=1):
    rng = np.random.default_rng(seed)
    return {
        "m": rng.normal(size=(runs, n)),
        "P": covariances(rng, runs, n),
        "nu": rng.normal(size=(runs, m)),
        "H": rng.normal(size=(runs, m, n)),
        "R": covariances(rng, runs, m),
    }


def plain_update(m, P, nu, H, R):
    """K = P H^T S^-1 run by run, with Joseph's form."""
    mean, covariance, nis, log_likelihood = [], [], [], []
    for b in range(len(m)):
        h, r = H[b if len(H) > 1 else 0], R[b if len(R) > 1 else 0]
        S = h @ P[b] @ h.T + r
        K = np.linalg.solve(S, h @ P[b]).T
        A = np.eye(len(P[b])) - K @ h
        mean.append(m[b] + K @ nu[b])
        covariance.append(A @ P[b] @ A.T + K @ r @ K.T)
        nis.append(nu[b] @ np.linalg.solve(S, nu[b]))
        log_likelihood.append(-0.5 * (nis[-1] + len(S) * np.log(2 * np.pi) + np.linalg.slogdet(S)[1]))
    return map(np.array, (mean, covariance, nis, log_likelihood))


@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_update_against_plain_numpy(n, m, runs):
    given = problem(n, m, runs)
    *found, lost = kernels.kalman.update(*given.values())
    for one, expected in zip(found, plain_update(**given), strict=True):
        assert_close(one, expected)
    assert len(lost) == 0
    assert (found[1] == found[1].swapaxes(1, 2)).all()


@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_prediction_against_plain_numpy(n, m, runs):
    rng = np.random.default_rng(2)
    P, F, Q = covariances(rng, runs, n), rng.normal(size=(runs, n, n)), covariances(rng, runs, n)
    found = kernels.kalman.predict(P, F, Q)
    assert_close(found, F @ P @ F.swapaxes(1, 2) + Q)
    assert (found == found.swapaxes(1, 2)).all()
    m = rng.normal(size=(runs, n))
    mean, covariance = kernels.kalman.predict_linear(m, P, F, Q)
    assert_close(mean, np.einsum("bij,bj->bi", F, m))
    np.testing.assert_array_equal(covariance, found)
    F[0] *= rng.random((n, n)) < 0.5  # zeros are passed over
    np.testing.assert_array_equal(
        kernels.kalman.predict(P, F[:1], Q[:1]),
        kernels.kalman.predict(P, np.repeat(F[:1], runs, axis=0), np.repeat(Q[:1], runs, axis=0)),
    )


def test_covariance_of_a_reading_against_plain_numpy():
    given = problem(6, 3, 40)
    P, H, R = (given[name] for name in ("P", "H", "R"))
    assert_close(kernels.kalman.predict(P, H, R), H @ P @ H.swapaxes(1, 2) + R)
    check_runs_are_alone(kernels.kalman.predict, (P, H, R))


def test_update_by_moments_is_the_update_where_the_measurement_is_linear():
    given = problem(6, 3, 70)
    C = given["H"] @ given["P"]
    S = C @ given["H"].swapaxes(1, 2) + given["R"]
    S = (S + S.swapaxes(1, 2)) / 2
    found = kernels.kalman.update_by_moments(given["m"], given["P"], given["nu"], C, S, given["R"])
    for one, expected in zip(found[:4], plain_update(**given), strict=True):
        assert_close(one, expected)
    moments = given["m"], given["P"], given["nu"], C, S
    check_runs_are_alone(lambda *given: kernels.kalman.update_by_moments(*given)[:4], moments, given["R"][:1])


@pytest.mark.parametrize("share", [1.0, 1e-7, 1e-9])
def test_precise_readings_keep_their_variance_with_a_wide_prior(share):
    """A prior much wider than the noise: the variance along the reading is that of the noise, to Joseph's accuracy."""
    given = problem(6, 3, 40)
    given["R"] = share * given["R"]
    _, covariance, _, _, lost = kernels.kalman.update(*given.values())
    assert len(lost) == 0
    for b in range(40):
        # The information form has no cancellation here.
        h, r = given["H"][b], given["R"][b]
        information = np.linalg.inv(given["P"][b]) + h.T @ np.linalg.solve(r, h)
        along = h @ np.linalg.inv(information) @ h.T
        np.testing.assert_allclose(h @ covariance[b] @ h.T, along, atol=2e-2 * np.abs(along).max())


def test_runs_without_digits_are_lost_and_no_others():
    given = problem(6, 3, 40)
    given["R"][7] *= 1e-16
    given["R"][9], given["H"][9, 1] = 0.0, given["H"][9, 0]  # S is singular
    *_, lost = kernels.kalman.update(*given.values())
    assert lost.tolist() == [7, 9]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1e3])
def test_a_run_that_is_no_covariance_stays_alone(bad):
    given = problem(6, 3, 40)
    sound = kernels.kalman.update(*given.values())
    np.fill_diagonal(given["P"][5], bad)
    found = kernels.kalman.update(*given.values())
    others = np.arange(40) != 5
    for one, expected in zip(found[:4], sound[:4], strict=True):
        np.testing.assert_array_equal(one[others], expected[others])
    assert not np.isfinite(found[3][5])
    assert set(found[4].tolist()) <= {5}


@pytest.mark.parametrize("runs", [1, 31, 32, 33, 64])
def test_bits_do_not_depend_on_the_block(runs):
    given = problem(6, 3, 100)
    given["R"][::3] *= 1e-8  # some by Joseph's form
    whole = kernels.kalman.update(*given.values())
    for first in (0, 17, 36):
        part = kernels.kalman.update(*(one[first : first + runs] for one in given.values()))
        for one, expected in zip(part[:4], whole[:4], strict=True):
            np.testing.assert_array_equal(one, expected[first : first + runs])
    S = covariances(np.random.default_rng(3), 100, 3)
    whole = kernels.kalman.innovation(S, given["nu"])
    part = kernels.kalman.innovation(S[9 : 9 + runs], given["nu"][9 : 9 + runs])
    for one, expected in zip(part[:2], whole[:2], strict=True):
        np.testing.assert_array_equal(one, expected[9 : 9 + runs])


def test_innovation_against_plain_numpy():
    for m, runs in ((1, 1), (3, 50), (12, 7)):
        rng = np.random.default_rng(m)
        S, nu = covariances(rng, runs, m), rng.normal(size=(runs, m))
        S[0, :, 0] = S[0, 0, :] = 0.0
        nis, log_likelihood, singular = kernels.kalman.innovation(S, nu)
        expected = np.einsum("bi,bi->b", nu[1:], np.linalg.solve(S[1:], nu[1:, :, None])[..., 0])
        np.testing.assert_allclose(nis[1:], expected, rtol=1e-12)
        constant = m * np.log(2 * np.pi) + np.linalg.slogdet(S[1:])[1]
        np.testing.assert_allclose(log_likelihood[1:], -0.5 * (expected + constant), rtol=1e-12, atol=1e-12)
        assert singular.tolist() == [0]
