"""alpha_kf with the paper's own choices: all states sampled, the weighted covariance as it is."""

import numpy as np
import pytest
from radar_problem import polar, polar_jacobian

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.filters.particle_set import standard_normals
from relnav_sim.streams import RandomSource

PUBLISHED = {"sampled_states": "all", "covariance_correction": False, "sampling": "random"}


def one_update(measurement, z, mean0, cov0, **options):
    n = len(cov0)
    still = LinearDynamics(np.eye(n), np.zeros((n, n)))
    filter = create_filter("alpha_kf", still, measurement, **options)
    history = run_filter(filter, np.asarray(z, dtype=float)[:, None], mean0, cov0)
    return history.mean[:, 0], history.covariance[:, 0], history.extras["ess"][:, 0]


class PolarOfPosition(FunctionMeasurement):
    depends_on = (0, 1, 2)


def test_one_update_is_the_one_printed():
    """Shi et al. (2025), eqs. 18 to 25: draw, weigh by the likelihood to the power alpha, take mean and covariance."""
    runs, N, alpha = 3, 400, 0.5
    rng = np.random.default_rng(2)
    root = rng.standard_normal((6, 6))
    scale = np.array([20.0, 20.0, 20.0, 0.1, 0.1, 0.1])
    P0 = (root @ root.T + np.eye(6)) * np.outer(scale, scale) / 6
    mean0 = np.array([300.0, -500.0, 200.0, 0.1, 0.2, -0.1])
    R = np.diag([4.0, 1e-3, 1e-3])
    z = polar(mean0, 0) + rng.standard_normal((runs, 3)) @ np.sqrt(R)
    measurement = PolarOfPosition(polar, R, polar_jacobian, angles=(1, 2))
    mean, covariance, ess = one_update(measurement, z, mean0, P0, alpha=alpha, samples=N, **PUBLISHED)
    normals = standard_normals(RandomSource(0, range(runs)).streams("filter.alpha_kf.samples"), 6, N)
    for run in range(runs):
        X = mean0 + (np.linalg.cholesky(P0) @ normals[run]).T
        r = z[run] - polar(X, 0)
        r[:, 1:] = (r[:, 1:] + np.pi) % (2 * np.pi) - np.pi
        w = np.exp(-alpha * np.einsum("ni,ij,nj->n", r, np.linalg.inv(R), r) / 2)
        w /= w.sum()
        mu = w @ X
        np.testing.assert_allclose(mean[run], mu, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(covariance[run], np.einsum("n,ni,nj->ij", w, X - mu, X - mu), rtol=1e-7, atol=1e-9)
        assert ess[run] == pytest.approx(1 / (w**2).sum(), rel=1e-9)


@pytest.mark.parametrize("sampled", ["observed", "all"])
def test_without_correction_flat_weights_leave_the_covariance_too_small_by_one_in_n(sampled):
    """E[sum w (x - mu)(x - mu)^T] = (1 - 1/N) P for equal weights; with the correction it is P."""
    runs, N = 5000, 32
    P0 = np.array([[2.0, 0.5], [0.5, 1.0]])
    says_nothing = LinearMeasurement(np.array([[1.0, 0.3]]), np.array([[1e12]]))
    z = np.zeros((runs, 1))
    for corrected, expected in ((False, (1 - 1 / N) * P0), (True, P0)):
        _, covariance, ess = one_update(
            says_nothing, z, np.zeros(2), P0, samples=N, sampled_states=sampled, covariance_correction=corrected
        )
        np.testing.assert_allclose(ess, N)
        standard_error = covariance.std(axis=0) / np.sqrt(runs)
        assert (np.abs(covariance.mean(axis=0) - expected) < 4 * standard_error).all()
        # The two differ by nine standard errors and more.
        assert (P0.diagonal() / N > 8 * standard_error.diagonal()).all()


@pytest.mark.parametrize("sampling", ["random", "antithetic"])
def test_the_correction_is_the_factor_that_it_says(sampling):
    H, R, P0 = np.array([[1.0, -0.5, 0.2]]), np.array([[0.5]]), np.diag([1.0, 2.0, 0.5])
    given = LinearMeasurement(H, R), np.full((4, 1), 0.7), np.zeros(3), P0
    same = {"samples": 64, "sampling": sampling, "sampled_states": "all"}
    mean, covariance, ess = one_update(*given, **same)
    plain_mean, plain, plain_ess = one_update(*given, **same, covariance_correction=False)
    np.testing.assert_array_equal(plain_mean, mean)
    np.testing.assert_array_equal(plain_ess, ess)
    if sampling == "random":
        np.testing.assert_allclose(plain, covariance * (1 - 1 / ess)[:, None, None], rtol=1e-12)
    else:
        shares = plain / covariance
        np.testing.assert_allclose(shares, np.broadcast_to(shares[:, :1, :1], shares.shape), rtol=1e-9)
        assert (shares < 1).all() and (shares > 1 - 1.0001 / (ess / 2)[:, None, None]).all()


def test_fixed_samples_have_nothing_to_correct():
    given = LinearMeasurement(np.eye(1, 2), np.eye(1)), np.full((2, 1), 0.7), np.zeros(2), np.eye(2)
    for found, expected in zip(
        one_update(*given, sampling="fixed", samples=64, covariance_correction=False),
        one_update(*given, sampling="fixed", samples=64),
        strict=True,
    ):
        np.testing.assert_array_equal(found, expected)


def test_sampling_all_states_gives_the_same_update_with_more_noise():
    """A state that is not measured follows by regression exactly; sampled, its mean scatters by sqrt(P / ESS) too."""
    runs, N, alpha = 2000, 200, 0.5
    P0 = np.array([[1.0, 0.6], [0.6, 4.0]])

    class OfTheFirst(LinearMeasurement):
        depends_on = (0,)

    H, R = np.eye(1, 2), np.array([[1.0]])
    z = np.full((runs, 1), 0.8)
    K = P0 @ H.T / (P0[0, 0] + R[0, 0] / alpha)
    expected, left = (K * 0.8)[:, 0], P0 - K @ H @ P0
    spread = {}
    for sampled in ("observed", "all"):
        mean, covariance, ess = one_update(
            OfTheFirst(H, R), z, np.zeros(2), P0, alpha=alpha, samples=N, sampled_states=sampled
        )
        # Self-normalised weights are biased by O(1 / ESS).
        bias = 3 * np.sqrt(left.diagonal()) / ess.mean()
        assert (np.abs(mean.mean(axis=0) - expected) < 5 * mean.std(axis=0) / np.sqrt(runs) + bias).all()
        error = 5 * covariance.std(axis=0) / np.sqrt(runs) + 3 * np.sqrt(np.outer(*[left.diagonal()] * 2)) / ess.mean()
        assert (np.abs(covariance.mean(axis=0) - left) < error).all()
        spread[sampled] = mean.std(axis=0)
    assert spread["all"][0] == pytest.approx(spread["observed"][0], rel=0.1)
    # Given the first state the second varies by 3.64, all of which is sampled, for ESS of 0.9 N or so.
    assert spread["all"][1] > 3 * spread["observed"][1]
    assert spread["all"][1] == pytest.approx(np.sqrt(left[1, 1] / ess.mean()), rel=0.15)
