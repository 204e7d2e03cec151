"""alpha_kf against closed forms, quadrature and the Kalman filter that it approximates."""

import numpy as np
import pytest
from radar_problem import polar, polar_jacobian, radar_problem

from relnav_sim import (
    FunctionMeasurement,
    LinearDynamics,
    LinearMeasurement,
    MixtureNoise,
    create_filter,
    run_filter,
)
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.gaussian_sampling import fixed_normals
from relnav_sim.filters.run import advance
from relnav_sim.streams import RandomSource

N_STATES = 3


class Still(LinearDynamics):
    """x_k = x_{k-1}: the belief before the first measurement is the prior itself."""

    def __init__(self, n=N_STATES):
        super().__init__(np.eye(n), np.zeros((n, n)))


class PolarOfPosition(FunctionMeasurement):
    depends_on = (0, 1, 2)


def one_update(kind, measurement, z, mean0, cov0, dynamics=None, **options):
    filter = create_filter(kind, dynamics or Still(len(cov0)), measurement, **options)
    history = run_filter(filter, np.asarray(z, dtype=float)[:, None], mean0, cov0)
    return history.mean[:, 0], history.covariance[:, 0], {k: v[:, 0] for k, v in history.extras.items()}


def linear_case(runs, n=N_STATES, m=2, seed=3):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, n))
    cov0 = root @ root.T + np.eye(n)
    H, R = rng.standard_normal((m, n)), np.diag([6.0, 4.0])
    z = np.broadcast_to(H @ np.linalg.cholesky(cov0) @ rng.standard_normal(n) + [0.4, -0.9], (runs, m))
    return H, R, cov0, z


def kalman(H, R, cov0, z):
    K = cov0 @ H.T @ np.linalg.inv(H @ cov0 @ H.T + R)
    return K @ z, (np.eye(len(cov0)) - K @ H) @ cov0


@pytest.mark.parametrize("sampling", ["random", "antithetic"])
@pytest.mark.parametrize("alpha", [1.0, 0.5, 0.1])
def test_linear_update_is_kalman_with_r_over_alpha_within_its_own_noise(alpha, sampling):
    runs, samples = 400, 2000
    H, R, cov0, z = linear_case(runs)
    mean, covariance = kalman(H, R / alpha, cov0, z[0])
    means, covariances, extras = one_update(
        "alpha_kf",
        LinearMeasurement(H, R),
        z,
        np.zeros(N_STATES),
        cov0,
        alpha=alpha,
        samples=samples,
        sampling=sampling,
    )
    # The mean of 400 runs: five standard errors, and the O(1/ESS) bias of self-normalised weights.
    sigma, ess = np.sqrt(np.diag(covariance)), extras["ess"].mean()
    assert (np.abs(means.mean(axis=0) - mean) < 5 * means.std(axis=0) / np.sqrt(runs) + 3 * sigma / ess).all()
    spread = covariances.std(axis=0) / np.sqrt(runs)
    assert (np.abs(covariances.mean(axis=0) - covariance) < 5 * spread + 3 * np.outer(sigma, sigma) / ess).all()
    # One run is off by sigma / sqrt(ESS), not more.
    assert (means.std(axis=0) < 1.3 * sigma / np.sqrt(ess)).all()
    assert not extras["fallback"].any()


def test_fixed_samples_converge_to_kalman_with_r_over_alpha():
    alpha = 0.5
    H, R, cov0, z = linear_case(1)
    mean, covariance = kalman(H, R / alpha, cov0, z[0])
    sigma = np.sqrt(np.diag(covariance))
    errors = []
    for samples in (2**9, 2**13, 2**17):
        means, covariances, _ = one_update(
            "alpha_kf",
            LinearMeasurement(H, R),
            z,
            np.zeros(N_STATES),
            cov0,
            alpha=alpha,
            samples=samples,
            sampling="fixed",
        )
        errors.append(
            max((np.abs(means[0] - mean) / sigma).max(), np.abs((covariances[0] - covariance) / sigma**2).max())
        )
    # 256 times the samples: more than the 16 times of random ones, which would be off by 1 / sqrt(ESS) = 0.4 %.
    assert errors[0] < 0.1
    assert errors[2] < errors[0] / 30
    assert errors[2] < 1e-3


def test_tracking_with_fixed_samples_equals_kf_with_r_scale():
    p = radar_problem(runs=20, steps=150)
    measurement = LinearMeasurement(np.eye(3, 6), 25.0 * np.eye(3))
    z = p.truth[..., :3] + 5.0 * np.random.default_rng(1).standard_normal(p.truth[..., :3].shape)
    kalman = run_filter(create_filter("kf", p.dynamics, measurement, r_scale=2.0), z, p.mean0, p.cov0)
    sampled = run_filter(
        create_filter("alpha_kf", p.dynamics, measurement, alpha=0.5, samples=512, sampling="fixed"), z, p.mean0, p.cov0
    )
    sigma = np.sqrt(np.einsum("...ii->...i", kalman.covariance))
    difference = ((sampled.mean - kalman.mean) / sigma)[:, 50:]
    assert np.sqrt(np.square(difference).mean()) < 0.05
    assert np.abs(np.einsum("...ii->...i", sampled.covariance) / sigma**2 - 1)[:, 50:].max() < 0.1
    # nis is the Kalman filter's with the measurement's own R, nis_tempered the one with R / alpha.
    assert np.allclose(sampled.extras["nis_tempered"].mean(), kalman.nis.mean(), rtol=0.02)
    assert sampled.nis.mean() > 1.2 * sampled.extras["nis_tempered"].mean()


@pytest.mark.parametrize("alpha", [0.25, 0.5, 0.9])
def test_fixed_point_gives_the_exact_posterior_for_any_alpha(alpha):
    H, R, cov0, z = linear_case(1)
    mean, covariance = kalman(H, R, cov0, z[0])
    sigma = np.sqrt(np.diag(covariance))
    for steps in (1, 2, 3 * int(np.ceil(3 / alpha))):
        # t steps leave (1 - alpha)^t of the way in precision.
        mean_t, covariance_t = kalman(H, R / (1 - (1 - alpha) ** steps), cov0, z[0])
        means, covariances, _ = one_update(
            "alpha_kf",
            LinearMeasurement(H, R),
            z,
            np.zeros(N_STATES),
            cov0,
            alpha=alpha,
            samples=2**14,
            sampling="fixed",
            fixed_point=steps,
        )
        assert np.allclose(means[0], mean_t, rtol=0, atol=0.01 * sigma.min())
        assert np.allclose(covariances[0], covariance_t, rtol=0, atol=0.01 * sigma.min() ** 2)
    assert np.allclose(means[0], mean, rtol=0, atol=0.01 * sigma.min())
    assert np.allclose(covariances[0], covariance, rtol=0, atol=0.01 * sigma.min() ** 2)


def bent(states, epoch):
    return states[..., :1] + 0.1 * np.square(states[..., :1])


def quadrature(log_density, low=-8.0, high=8.0, points=200_001):
    """Return mean and variance of a density on the line from its unnormalised logarithm."""
    x = np.linspace(low, high, points)
    log_p = log_density(x)
    p = np.exp(log_p - log_p.max())
    p /= p.sum()
    mean = (p * x).sum()
    return mean, (p * np.square(x - mean)).sum()


@pytest.mark.parametrize("proposal", ["prior", "posterior"])
@pytest.mark.parametrize("alpha", [0.3, 1.0])
def test_nonlinear_update_has_the_tempered_posterior_moments(alpha, proposal):
    z, R, P = 1.7, 0.5, 1.0
    expected = quadrature(lambda x: -0.5 * alpha * (z - x - 0.1 * x**2) ** 2 / R - 0.5 * x**2 / P)
    means, covariances, _ = one_update(
        "alpha_kf",
        FunctionMeasurement(bent, [[R]]),
        [[z]],
        np.zeros(1),
        P * np.eye(1),
        alpha=alpha,
        sampling="fixed",
        samples=2**14,
        proposal=proposal,
    )
    assert np.allclose([means[0, 0], covariances[0, 0, 0]], expected, rtol=2e-3)


def test_many_fixed_point_steps_reach_the_alpha_projection_of_a_skew_posterior():
    z, R, alpha = 1.7, 0.5, 0.5
    means, covariances, _ = one_update(
        "alpha_kf",
        FunctionMeasurement(bent, [[R]]),
        [[z]],
        np.zeros(1),
        np.eye(1),
        alpha=alpha,
        sampling="fixed",
        samples=2**14,
        fixed_point=20,
    )
    mean, variance = means[0, 0], covariances[0, 0, 0]

    def geometric_mixture(x):
        log_p = -0.5 * (z - x - 0.1 * x**2) ** 2 / R - 0.5 * x**2
        return alpha * log_p - (1 - alpha) * 0.5 * (x - mean) ** 2 / variance

    # Stationary: q has the moments of p^alpha q^(1 - alpha).
    assert np.allclose(quadrature(geometric_mixture), (mean, variance), rtol=2e-3)


def test_effective_sample_size_follows_its_closed_form():
    runs, samples, alpha = 60, 10_000, 0.5
    rng = np.random.default_rng(4)
    H, R, cov0, _ = linear_case(1)
    z = rng.standard_normal((runs, 2)) @ np.linalg.cholesky(H @ cov0 @ H.T + R).T
    *_, extras = one_update(
        "alpha_kf", LinearMeasurement(H, R), z, np.zeros(N_STATES), cov0, alpha=alpha, samples=samples
    )
    M = H @ cov0 @ H.T
    once, twice = np.linalg.inv(R + alpha * M), np.linalg.inv(R + 2 * alpha * M)
    volume = np.sqrt(np.linalg.det(R + 2 * alpha * M) * np.linalg.det(R)) / np.linalg.det(R + alpha * M)
    expected = samples * volume * np.exp(-alpha * np.einsum("bi,ij,bj->b", z, once - twice, z))
    relative = extras["ess"] / expected - 1
    # The scatter of an ESS estimate is a few times 1 / sqrt(ESS).
    assert (np.abs(relative) < 8 / np.sqrt(expected)).all()
    assert abs(np.median(relative)) < 0.02


def test_covariance_correction_is_unbiased_for_flat_weights():
    runs, samples = 6000, 64
    flat = LinearMeasurement(np.eye(N_STATES), 1e12 * np.eye(N_STATES))
    for sampling in ("random", "antithetic"):
        means, covariances, _ = one_update(
            "alpha_kf",
            flat,
            np.zeros((runs, N_STATES)),
            np.zeros(N_STATES),
            np.eye(N_STATES),
            samples=samples,
            sampling=sampling,
        )
        variance = np.einsum("bii->b", covariances) / N_STATES
        # Five standard errors; without the correction random samples would be 1 / 64 = 1.6 % low.
        assert abs(variance.mean() - 1) < 5 * variance.std() / np.sqrt(runs)
        assert 5 * variance.std() / np.sqrt(runs) < 0.8 / samples or sampling == "antithetic"
        if sampling == "antithetic":
            assert np.abs(means).max() < 1e-9


def test_unobserved_states_follow_by_exact_regression():
    rng = np.random.default_rng(8)
    root = rng.standard_normal((6, 6))
    cov0 = root @ root.T
    R = np.diag([5.0, 10.0, 20.0])
    z = 3 * rng.standard_normal((5, 3))
    dynamics = Still(6)
    H = np.eye(3, 6)[:, ::-1]  # observes states 3, 4, 5, which are not the first
    whole = FunctionMeasurement(lambda x, k: x @ H.T, R)  # taken to depend on all six
    options = {"alpha": 1.0, "sampling": "fixed", "samples": 2**16, "dynamics": dynamics}
    position_only = one_update("alpha_kf", LinearMeasurement(H, R), z, np.zeros(6), cov0, **options)
    all_states = one_update("alpha_kf", whole, z, np.zeros(6), cov0, **options)
    sigma = np.sqrt(np.diag(cov0))
    assert np.allclose(position_only[0] / sigma, all_states[0] / sigma, rtol=0, atol=0.01)
    assert np.allclose(
        position_only[1] / np.outer(sigma, sigma), all_states[1] / np.outer(sigma, sigma), rtol=0, atol=0.01
    )
    exact = [kalman(H, R, cov0, row) for row in z]
    assert np.allclose(position_only[0] / sigma, [mean for mean, _ in exact] / sigma, rtol=0, atol=2e-3)


def test_scattered_observed_states_may_be_named():
    class Ends(FunctionMeasurement):
        depends_on = (0, 3)

    H = np.array([[1.0, 0, 0, 0], [0, 0, 0, 2.0]])
    rng = np.random.default_rng(9)
    root = rng.standard_normal((4, 4))
    cov0, z = root @ root.T + np.eye(4), np.array([[0.3, -1.0]])
    means, covariances, _ = one_update(
        "alpha_kf",
        Ends(lambda x, k: np.einsum("ij,...j->...i", H, x), np.eye(2)),
        z,
        np.zeros(4),
        cov0,
        alpha=1.0,
        sampling="fixed",
        samples=2**14,
    )
    mean, covariance = kalman(H, np.eye(2), cov0, z[0])
    assert np.allclose(means[0], mean, atol=0.01)
    assert np.allclose(covariances[0], covariance, atol=0.02)


def test_thousandfold_prior_does_not_collapse():
    p = radar_problem(runs=20, steps=1, range_m=12_000.0)
    measurement = PolarOfPosition(polar, p.R, polar_jacobian, angles=(1, 2))
    wide = 1000**2 * p.cov0
    mean0 = p.mean0 + np.random.default_rng(2).standard_normal((20, 6)) * np.sqrt(np.diag(wide))
    # So wide a prior leaves the fix alone: the position that the reading points at, as accurate as the reading.
    rho, azimuth, elevation = np.moveaxis(p.z[:, 0], -1, 0)
    fix = np.stack(
        [
            rho * np.cos(elevation) * np.cos(azimuth),
            rho * np.cos(elevation) * np.sin(azimuth),
            -rho * np.sin(elevation),
        ],
        axis=-1,
    )
    J = np.linalg.inv(polar_jacobian(np.concatenate([fix, np.zeros((20, 3))], axis=1))[..., :3])
    expected = J @ p.R @ np.swapaxes(J, 1, 2)
    for options in ({"proposal": "posterior"}, {"proposal": "posterior", "sampling": "fixed", "samples": 1024}):
        history = run_filter(create_filter("alpha_kf", p.dynamics, measurement, alpha=1.0, **options), p.z, mean0, wide)
        samples = options.get("samples", 10_000)
        assert (history.extras["ess"] > 0.4 * samples).all()
        assert not history.extras["fallback"].any()
        white = np.einsum("bij,bj->bi", np.linalg.inv(np.linalg.cholesky(expected)), history.mean[:, 0, :3] - fix)
        assert np.abs(white).max() < 6 / np.sqrt(0.4 * samples)
    # Samples of the prediction itself: a handful count, so the update falls back, says so, and stays finite.
    history = run_filter(create_filter("alpha_kf", p.dynamics, measurement, alpha=1.0), p.z, mean0, wide)
    assert (history.extras["ess"] < 10).all()
    assert (history.extras["fallback"] == 1).all()
    assert np.allclose(history.mean[:, 0, :3], fix, atol=1.0)
    assert (np.linalg.eigvalsh(history.covariance[:, 0]) > 0).all()


def test_fewer_effective_samples_than_moments_fall_back():
    # M / R = 200 a channel: about 5 of 1000 samples count, where mean and covariance are 9 numbers.
    runs, R = 200, 0.005 * np.eye(N_STATES)
    z = np.full((runs, N_STATES), 0.3)
    means, covariances, extras = one_update(
        "alpha_kf",
        LinearMeasurement(np.eye(N_STATES), R),
        z,
        np.zeros(N_STATES),
        np.eye(N_STATES),
        alpha=0.5,
        samples=1000,
    )
    few = extras["ess"] <= 9
    assert 0.5 < few.mean() < 1
    assert np.array_equal(extras["fallback"] == 1, few)
    mean, covariance = kalman(np.eye(N_STATES), R / 0.5, np.eye(N_STATES), z[0])
    assert np.allclose(means[few], mean, rtol=0, atol=1e-9)
    assert np.allclose(covariances[few], covariance, rtol=0, atol=1e-9)


def test_mixture_likelihood_gives_the_moments_of_the_exact_posterior():
    weights, variances, P, z = np.array([0.8, 0.2]), np.array([0.2, 20.0]), 1.0, 2.5
    noise = MixtureNoise(weights, variances[:, None, None])
    # Exact: one Kalman update per component.
    S = P + variances
    posterior = weights * np.exp(-0.5 * z**2 / S) / np.sqrt(S)
    posterior /= posterior.sum()
    means, spread = P / S * z, P * variances / S
    mean = posterior @ means
    variance = posterior @ (spread + (means - mean) ** 2)
    got = one_update(
        "alpha_kf",
        LinearMeasurement([[1.0]], noise),
        [[z]],
        np.zeros(1),
        P * np.eye(1),
        alpha=1.0,
        sampling="fixed",
        samples=2**14,
        likelihood="mixture",
    )
    assert np.allclose([got[0][0, 0], got[1][0, 0, 0]], [mean, variance], rtol=2e-3)


def test_likelihood_without_support_falls_back():
    def nowhere(states, epoch):
        # Not a number away from the mean, where the samples are.
        return np.where(np.abs(states[..., :1]) < 1e-12, 0.0, np.nan)

    measurement = FunctionMeasurement(nowhere, [[1.0]], jacobian=lambda x, k: np.ones((*x.shape[:-1], 1, 1)))
    mean, covariance, extras = one_update("alpha_kf", measurement, [[0.0]], np.zeros(1), np.eye(1), alpha=1.0)
    assert extras["fallback"] == 1
    assert np.isfinite(mean).all()
    assert np.isfinite(covariance).all()


@pytest.mark.parametrize("sampling", ["random", "antithetic", "fixed"])
def test_a_run_does_not_depend_on_its_block(sampling):
    p = radar_problem(runs=5, steps=12)
    measurement = PolarOfPosition(polar, p.R, polar_jacobian, angles=(1, 2))
    p.z[1, 4] = np.nan
    mean0 = p.mean0.copy()
    mean0[2] += 3e3  # one run that needs the posterior proposal, and others that do not
    filter = create_filter("alpha_kf", p.dynamics, measurement, samples=600, sampling=sampling, proposal="posterior")
    together = run_filter(filter, p.z, mean0, p.cov0, seed=5)
    for run in range(5):
        alone = run_filter(filter, p.z[run : run + 1], mean0[run : run + 1], p.cov0, seed=5, runs=[run])
        assert np.array_equal(alone.mean[0], together.mean[run])
        assert np.array_equal(alone.covariance[0], together.covariance[run])
        assert np.array_equal(alone.extras["ess"][0], together.extras["ess"][run], equal_nan=True)


def test_nonlinear_dynamics_use_the_cubature_prediction():
    class Pendulum:
        dimension, linear = 2, False

        def propagate(self, states, step):
            angle, rate = states[..., 0], states[..., 1]
            return np.stack([angle + 0.1 * rate, rate - 0.1 * np.sin(angle)], axis=-1)

        def transition(self, mean, step):
            F = np.zeros((len(mean), 2, 2))
            F[:, 0, 0], F[:, 0, 1], F[:, 1, 1] = 1, 0.1, 1
            F[:, 1, 0] = -0.1 * np.cos(mean[:, 0])
            return F

        def process_noise(self, states, step):
            return 1e-4 * np.eye(2)

    measurement = LinearMeasurement([[1.0, 0.0]], [[0.04]])
    z = np.array([[[0.9], [0.8], [0.75], [0.6]]])
    sampled = run_filter(
        create_filter("alpha_kf", Pendulum(), measurement, alpha=1.0, sampling="fixed", samples=2**14),
        z,
        [1.0, 0.0],
        np.diag([0.3, 0.2]),
    )
    cubature = run_filter(create_filter("ukf", Pendulum(), measurement), z, [1.0, 0.0], np.diag([0.3, 0.2]))
    assert np.allclose(sampled.mean, cubature.mean, atol=2e-3)
    assert np.allclose(sampled.covariance, cubature.covariance, atol=2e-3)


def test_fixed_set_has_exact_moments_and_is_one_set():
    e = fixed_normals(3, 512)
    assert e is fixed_normals(3, 512)
    assert np.abs(e.mean(axis=2)).max() < 1e-15
    assert np.allclose(e[0] @ e[0].T / 512, np.eye(3), rtol=0, atol=1e-13)
    # Kurtosis 3 of a normal, within the error of a 512-point rule.
    assert np.allclose((e[0] ** 4).mean(axis=1), 3, atol=0.2)


def test_fixed_samples_are_drawn_before_the_first_step(monkeypatch):
    # SciPy is imported to draw them: 0.6 s of processor time that the first block of a campaign was charged for.
    filter = create_filter(
        "alpha_kf",
        LinearDynamics(np.eye(3), np.eye(3)),
        LinearMeasurement(np.eye(3), np.eye(3)),
        sampling="fixed",
        samples=64,
    )
    fixed_normals.cache_clear()
    belief = filter.start(Gaussian(np.zeros((1, 3)), np.eye(3)[None]), RandomSource(1, (0,)))
    drawn = fixed_normals.cache_info().misses
    advance(filter, belief, np.ones((1, 2, 3)), 1, 1.0)
    assert (drawn, fixed_normals.cache_info().misses) == (1, 1)


def test_options_are_checked():
    measurement = LinearMeasurement(np.eye(1), np.eye(1))
    for bad in (
        {"alpha": 0.0},
        {"alpha": 1.5},
        {"samples": 4},
        {"samples": 101, "sampling": "antithetic"},
        {"fixed_point": 0},
        {"sampling": "sobol"},
        {"proposal_spread": 0.5},
    ):
        with pytest.raises(ValueError, match="alpha_kf"):
            create_filter("alpha_kf", Still(1), measurement, **bad)
