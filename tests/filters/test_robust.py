"""The robust filters: the Kalman filter when the noise is Gaussian, far better under glint."""

from itertools import combinations

import numpy as np
import pytest
from radar_problem import MEAN_MOTION, radar_problem
from scipy.optimize import minimize

from relnav_sim import LinearDynamics, LinearMeasurement, MixtureNoise, create_filter, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.filters.gaussian_sum import GaussianSum, reduced

OFF = {
    "huber": {"threshold": 1e9},
    "mckf": {"bandwidth": 1e9},
    "student_t": {"degrees_of_freedom": 1e15},
    "gaussian_sum": {},
    "imm": {},
}


@pytest.mark.parametrize("kind", OFF)
def test_equals_the_extended_filter_when_the_tuning_constant_is_off(kind):
    problem = radar_problem(runs=3, steps=80)
    problem.z[1, 30:35] = np.nan
    robust = run_filter(
        create_filter(kind, problem.dynamics, problem.measurement, **OFF[kind]), problem.z, problem.mean0, problem.cov0
    )
    plain = run_filter(
        create_filter("ekf", problem.dynamics, problem.measurement), problem.z, problem.mean0, problem.cov0
    )
    assert np.abs(robust.mean - plain.mean).max() < 1e-8
    assert np.abs(robust.log_likelihood - plain.log_likelihood).max() < 1e-8
    assert np.nanmax(np.abs(robust.nis - plain.nis)) < 1e-8


GLINT_SCALE, GLINT_SHARE = 10.0, 0.1


@pytest.fixture(scope="module")
def glint():
    """Linear measurement of position; one switch for all channels makes a tenth of the epochs ten times as noisy."""
    rng = np.random.default_rng(11)
    runs, steps, sigma, step_s = 24, 300, 10.0, 1.0
    F, Q = van_loan(cw_system(MEAN_MOTION), np.vstack([np.zeros((3, 3)), np.eye(3)]), 1e-4 * np.eye(3), step_s)
    cov0 = np.diag([10.0] * 3 + [0.1] * 3) ** 2
    x = rng.standard_normal((runs, 6)) @ np.sqrt(cov0)
    truth = np.empty((runs, steps, 6))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 6)) @ np.linalg.cholesky(Q).T
        truth[:, k] = x
    hit = rng.random((runs, steps)) < GLINT_SHARE
    scale = np.where(hit, GLINT_SCALE, 1.0)[..., None]
    z = truth[..., :3] + sigma * scale * rng.standard_normal((runs, steps, 3))
    R = sigma**2 * np.eye(3)

    def rms(kind, noise, outliers=1.0, **options):
        """Position error, with outliers so many times larger still."""
        measurement = LinearMeasurement(np.eye(3, 6), noise)
        filter = create_filter(kind, LinearDynamics(F, Q), measurement, **options)
        seen = np.where(hit[..., None], truth[..., :3] + outliers * (z - truth[..., :3]), z)
        error = run_filter(filter, seen, np.zeros((runs, 6)), cov0).mean - truth
        return float(np.sqrt(np.square(error[:, 50:, :3]).sum(axis=-1).mean()))

    oracle = rms("kf", scale[..., None] ** 2 * R)
    mixture = MixtureNoise(np.array([1 - GLINT_SHARE, GLINT_SHARE]), np.stack([R, GLINT_SCALE**2 * R]))
    return rms, R, mixture, oracle


def test_the_kalman_filter_is_far_from_the_oracle(glint):
    rms, R, mixture, oracle = glint
    assert rms("kf", R) > 2.0 * oracle
    assert rms("kf", mixture.covariance) > 1.8 * oracle


@pytest.mark.parametrize(
    "kind, options, margin",
    [
        ("gaussian_sum", {}, 1.03),
        ("gaussian_sum", {"components": 1}, 1.03),
        ("imm", {}, 1.03),
    ],
)
def test_filters_that_know_the_mixture_come_within_3_percent_of_the_oracle(glint, kind, options, margin):
    """The oracle is told at every epoch which component the noise came from."""
    rms, _, mixture, oracle = glint
    assert rms(kind, mixture, **options) < margin * oracle


@pytest.mark.parametrize(
    "kind, options, margin",
    [("huber", {}, 1.25), ("mckf", {}, 1.10), ("student_t", {"per_channel": False}, 1.10)],
)
def test_filters_that_know_only_the_nominal_noise_stay_near_the_oracle(glint, kind, options, margin):
    rms, R, _, oracle = glint
    assert rms(kind, R, **options) < margin * oracle


@pytest.mark.parametrize(
    "kind, options, margin",
    [
        ("huber", {}, 1.3),
        ("mckf", {}, 1.03),
        ("mckf", {"weigh_prior": True}, 1.03),
        ("student_t", {"per_channel": False}, 1.1),
    ],
)
def test_outliers_of_a_thousand_sigma_do_no_more_harm(glint, kind, options, margin):
    """Ten times as large as before; the Kalman filter is 28 times worse than the oracle."""
    rms, R, _, oracle = glint
    assert rms(kind, R, outliers=10.0, **options) < margin * oracle


@pytest.mark.parametrize("weigh_prior", [False, True])
def test_huber_finds_the_minimum_of_its_own_cost(weigh_prior):
    """One update of two states by two correlated channels, the second 30 sigma off, against a general minimiser."""
    P, R = np.array([[4.0, 1.0], [1.0, 2.0]]), np.array([[1.0, 0.3], [0.3, 0.5]])
    H, z, c = np.array([[1.0, 0.5], [0.2, 1.0]]), np.array([0.7, 20.0]), 1.345
    options = {"threshold": c, "iterations": 50, "weigh_prior": weigh_prior}
    filter = create_filter("huber", LinearDynamics(np.eye(2), np.zeros((2, 2))), LinearMeasurement(H, R), **options)
    mean = run_filter(filter, z[None, None], np.zeros(2), P).mean[0, 0]

    def loss(e):
        return np.where(np.abs(e) <= c, e**2 / 2, c * np.abs(e) - c**2 / 2).sum()

    def cost(x):
        white = np.linalg.solve(np.linalg.cholesky(P), x)
        prior = loss(white) if weigh_prior else (white**2).sum() / 2
        return prior + loss(np.linalg.solve(np.linalg.cholesky(R), z - H @ x))

    best = minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12})
    assert np.abs(mean - best.x).max() < 1e-6


@pytest.mark.parametrize("per_channel", [False, True])
def test_student_t_solves_the_variational_equations(per_channel):
    """Mean, covariance and weights of one update, iterated here in information form (Agamennoni et al. 2012)."""
    P, R, nu = np.array([[4.0, 1.0], [1.0, 2.0]]), np.diag([1.0, 0.25]), 4.0
    H, z = np.array([[1.0, 0.5], [0.2, 1.0]]), np.array([0.7, 6.0])
    options = {"degrees_of_freedom": nu, "per_channel": per_channel, "iterations": 50}
    filter = create_filter("student_t", LinearDynamics(np.eye(2), np.zeros((2, 2))), LinearMeasurement(H, R), **options)
    history = run_filter(filter, z[None, None], np.zeros(2), P)
    scale = np.ones(2)
    for _ in range(200):
        information = H.T @ np.diag(scale / np.diag(R))
        covariance = np.linalg.inv(np.linalg.inv(P) + information @ H)
        mean = covariance @ information @ z
        expected = ((z - H @ mean) ** 2 + np.diag(H @ covariance @ H.T)) / np.diag(R)
        scale = (nu + 1) / (nu + expected) if per_channel else np.full(2, (nu + 2) / (nu + expected.sum()))
    assert np.allclose(history.mean[0, 0], mean, atol=1e-9)
    assert np.allclose(history.covariance[0, 0], covariance, atol=1e-9)
    assert history.extras["lowest_weight"][0, 0] == pytest.approx(scale.min(), abs=1e-9)


def test_gaussian_sum_is_exact_while_nothing_is_merged():
    """Two epochs of a scalar problem: the four posterior components by hand, from Bayes' rule on a fine grid."""
    noise = MixtureNoise(np.array([0.7, 0.3]), np.array([[[1.0]], [[25.0]]]))
    filter = create_filter(
        "gaussian_sum", LinearDynamics([[1.0]], [[0.5]]), LinearMeasurement([[1.0]], noise), components=4
    )
    z = np.array([[[0.5], [6.0]]])
    history = run_filter(filter, z, [0.0], [[2.0]])
    x = np.linspace(-60, 60, 240001)
    density = np.exp(-0.5 * x**2 / 2.0)
    evidence = []
    for value in z[0, :, 0]:
        # A Gaussian random walk in density form: convolution by the characteristic function.
        frequency = np.fft.rfftfreq(len(x), x[1] - x[0])
        density = np.fft.irfft(np.fft.rfft(density) * np.exp(-0.5 * 0.5 * (2 * np.pi * frequency) ** 2), len(x))
        density /= density.sum()
        residual = value - x
        likelihood = 0.7 * np.exp(-0.5 * residual**2) / np.sqrt(2 * np.pi)
        likelihood += 0.3 * np.exp(-0.5 * residual**2 / 25) / np.sqrt(2 * np.pi * 25)
        evidence.append(np.log((density * likelihood).sum()))
        density *= likelihood
        density /= density.sum()
    mean = (x * density).sum()
    variance = ((x - mean) ** 2 * density).sum()
    assert history.mean[0, 1, 0] == pytest.approx(mean, abs=1e-7)
    assert history.covariance[0, 1, 0, 0] == pytest.approx(variance, abs=1e-6)
    assert np.allclose(history.log_likelihood[0], evidence, atol=1e-7)


def test_merging_keeps_the_moments():
    rng = np.random.default_rng(5)
    weights = rng.random((4, 6))
    weights /= weights.sum(axis=1, keepdims=True)
    roots = rng.standard_normal((4, 6, 3, 3))
    mixture = GaussianSum(weights, rng.standard_normal((4, 6, 3)), roots @ roots.swapaxes(-1, -2) + np.eye(3))
    small = reduced(mixture, 2)
    assert small.weights.shape == (4, 2)
    assert np.allclose(small.weights.sum(axis=1), 1)
    assert np.allclose(small.mean, mixture.mean)
    assert np.allclose(small.covariance, mixture.covariance)


def test_merging_takes_the_cheapest_pair_first():
    """Runnalls' greedy reduction written as a plain loop, for one run with a weightless component."""
    rng = np.random.default_rng(3)
    weights = np.array([0.3, 0.25, 0.2, 0.15, 0.1, 0.0])
    means, roots = rng.standard_normal((6, 2)), rng.standard_normal((6, 2, 2))
    covariances = roots @ roots.swapaxes(-1, -2) + 0.2 * np.eye(2)
    parts = list(zip(weights, means, covariances, strict=True))

    def merged(a, b):
        weight = a[0] + b[0]
        mean = (a[0] * a[1] + b[0] * b[1]) / weight
        spread = sum(w * (P + np.outer(m - mean, m - mean)) for w, m, P in (a, b)) / weight
        return weight, mean, spread

    def log_volume(part):
        return part[0] * np.log(np.linalg.det(part[2]))

    while len(parts) > 3:
        pairs = list(combinations(range(len(parts)), 2))
        bounds = [
            log_volume(merged(parts[i], parts[j])) - log_volume(parts[i]) - log_volume(parts[j]) for i, j in pairs
        ]
        i, j = pairs[int(np.argmin(bounds))]
        parts = [part for k, part in enumerate(parts) if k not in (i, j)] + [merged(parts[i], parts[j])]
    small = reduced(GaussianSum(weights[None], means[None], covariances[None]), 3)
    parts.sort(key=lambda part: -part[0])
    assert np.allclose(small.weights[0], [part[0] for part in parts])
    assert np.allclose(small.means[0], [part[1] for part in parts])
    assert np.allclose(small.covariances[0], [part[2] for part in parts])


def test_imm_with_persistence_beats_independent_epochs_on_bursts():
    rng = np.random.default_rng(2)
    runs, steps = 60, 300
    state = np.zeros(runs, dtype=bool)
    hits = np.empty((runs, steps), dtype=bool)
    for k in range(steps):
        state = np.where(state, rng.random(runs) < 0.9, rng.random(runs) < 0.05)
        hits[:, k] = state
    truth = np.cumsum(0.3 * rng.standard_normal((runs, steps, 1)), axis=1)
    z = truth + np.where(hits, 3.0, 1.0)[..., None] * rng.standard_normal((runs, steps, 1))
    noise = MixtureNoise(np.array([2 / 3, 1 / 3]), np.array([[[1.0]], [[9.0]]]))

    def squared(persistence):
        filter = create_filter(
            "imm", LinearDynamics([[1.0]], [[0.09]]), LinearMeasurement([[1.0]], noise), persistence=persistence
        )
        return np.square(run_filter(filter, z, [0.0], [[1.0]]).mean - truth).mean(axis=(1, 2))

    gain = squared(0.0) - squared(0.85)
    assert gain.mean() > 3 * gain.std() / np.sqrt(runs)
