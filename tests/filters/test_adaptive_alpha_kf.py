"""adaptive_alpha_kf on glint, on drifting noise, and against closed forms."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import chi2, multivariate_normal

from relnav_sim import LinearDynamics, LinearMeasurement, MixtureNoise, create_filter, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.filters.noise_scale import modes, scale_for

SIGMA_M = 4.0
H = np.eye(3, 6)
R = SIGMA_M**2 * np.eye(3)
SCHEMES = ["gate", "student_t", "responsibilities", "windowed_nis"]


def relative_orbit(runs, steps, seed, psd=1e-4):
    """Return dynamics, true states, and a prior, for position readings every second."""
    rng = np.random.default_rng(seed)
    F, Q = van_loan(cw_system(1.078e-3), np.vstack([np.zeros((3, 3)), np.eye(3)]), psd * np.eye(3), 1.0)
    x = np.broadcast_to([500.0, 0.0, 200.0, 0.0, -1.0, 0.0], (runs, 6)).copy()
    sigmas = np.array([SIGMA_M] * 3 + [0.1] * 3)
    mean0 = x + sigmas * rng.standard_normal((runs, 6))
    root = np.linalg.cholesky(Q)
    truth = np.empty((runs, steps, 6))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 6)) @ root.T
        truth[:, k] = x
    return LinearDynamics(F, Q), truth, mean0, np.diag(sigmas**2), rng


@pytest.fixture(scope="module")
def glint():
    """One switch for all channels: deviations ten times the nominal in a tenth of the readings."""
    dynamics, truth, mean0, cov0, rng = relative_orbit(runs=40, steps=400, seed=1)
    outlier = rng.random(truth.shape[:2]) < 0.1
    scale = np.where(outlier, 10.0, 1.0)
    z = truth[..., :3] + SIGMA_M * scale[..., None] * rng.standard_normal((*truth.shape[:2], 3))

    def rms(kind, noise=R, settle=220, **options):
        filter = create_filter(kind, dynamics, LinearMeasurement(H, noise), **options)
        error = run_filter(filter, z, mean0, cov0).mean - truth
        return np.sqrt(np.square(error[:, settle:, :3]).sum(axis=-1).mean())

    rms.mixture = MixtureNoise(np.array([0.9, 0.1]), np.stack([R, 100 * R]))
    rms.oracle = rms("kf", scale[..., None, None] ** 2 * R)
    return rms


def test_gate_and_responsibilities_match_the_oracle_under_glint(glint):
    assert glint("adaptive_alpha_kf", scheme="gate") < 1.03 * glint.oracle
    assert glint("adaptive_alpha_kf", glint.mixture, scheme="responsibilities") < 1.03 * glint.oracle


def test_student_t_is_near_the_oracle_under_glint(glint):
    per_channel = glint("adaptive_alpha_kf", scheme="student_t")
    joint = glint("adaptive_alpha_kf", scheme="student_t", per_channel=False)
    assert per_channel < 1.10 * glint.oracle
    # With one switch for all channels the three residuals together tell more.
    assert glint.oracle < joint < per_channel


def test_no_fixed_alpha_helps_under_glint(glint):
    fixed = [glint("kf", r_scale=1 / alpha) for alpha in (1.0, 0.5, 0.2, 0.1, 1 / 10.9, 0.05, 0.02)]
    assert 2 * glint.oracle < min(fixed)
    assert max(fixed) < 3.5 * glint.oracle


@pytest.mark.slow
def test_windowed_nis_does_not_help_under_glint(glint):
    windowed = glint("adaptive_alpha_kf", scheme="windowed_nis")
    # It finds the total variance, 10.9 R, and is then what a fixed R of that size is, and a little worse.
    total = glint("kf", r_scale=10.9)
    assert 0.98 * total < windowed < 1.2 * total
    assert windowed > 2 * glint.oracle


def test_windowed_nis_tracks_a_slow_drift_of_the_noise_scale():
    runs, steps, window = 20, 900, 75
    dynamics, truth, mean0, cov0, rng = relative_orbit(runs, steps, seed=2)
    profile = 1 + 3 * np.sin(np.pi * np.arange(steps) / steps) ** 2  # to fourfold and back in 12 windows
    z = truth[..., :3] + SIGMA_M * profile[:, None] * rng.standard_normal((runs, steps, 3))

    def history(kind, noise=R, **options):
        return run_filter(create_filter(kind, dynamics, LinearMeasurement(H, noise), **options), z, mean0, cov0)

    def rms(h):
        return np.sqrt(np.square((h.mean - truth)[:, window:, :3]).sum(axis=-1).mean())

    oracle, fixed = rms(history("kf", profile[:, None, None] ** 2 * R)), rms(history("kf"))
    adapted = history("adaptive_alpha_kf", scheme="windowed_nis", window=window)
    assert rms(adapted) < 1.01 * oracle
    assert fixed > 1.1 * oracle
    deviation = 1 / np.sqrt(adapted.extras["alpha"][:, 2 * window :])
    expected = profile[2 * window :]
    # The window's mean lags by W / 2; the mean of 20 runs scatters by 1 / sqrt(2 m W 20) = 1 %.
    lag = np.sqrt(np.convolve(profile**2, np.ones(window) / window, mode="full")[: len(profile)])[2 * window - 1 : -1]
    assert np.abs(deviation.mean(axis=0) / lag - 1).max() < 0.06
    assert np.abs(deviation.mean(axis=0) / expected - 1).max() < 0.25
    assert adapted.extras["white"][:, window:].mean() > 0.95


def test_window_is_frozen_while_innovations_are_correlated():
    dynamics, truth, mean0, cov0, rng = relative_orbit(runs=10, steps=300, seed=3, psd=1e-8)
    # An unmodelled acceleration of 0.05 m/s^2 that turns every 30 s: the readings are as good as stated.
    k = np.arange(300.0)
    manoeuvre = np.cumsum(np.cumsum(0.05 * np.sign(np.sin(2 * np.pi * k / 60))))
    z = truth[..., :3] + manoeuvre[:, None] + SIGMA_M * rng.standard_normal((10, 300, 3))
    filter = create_filter("adaptive_alpha_kf", dynamics, LinearMeasurement(H, R), scheme="windowed_nis")
    history = run_filter(filter, z, mean0, cov0)
    assert history.nis[:, 150:].mean() > 2 * 3
    assert history.extras["white"][:, 150:].max() == 0
    assert (history.extras["alpha"][:, 150:] == 1).mean() == 1


def test_alpha_above_one_where_the_noise_is_stated_too_large():
    dynamics, truth, mean0, cov0, rng = relative_orbit(runs=10, steps=350, seed=4)
    z = truth[..., :3] + SIGMA_M * rng.standard_normal((10, 350, 3))
    measurement = LinearMeasurement(H, 2 * R)
    options = {"scheme": "windowed_nis", "window": 150}
    free = run_filter(
        create_filter("adaptive_alpha_kf", dynamics, measurement, alpha_max=4.0, **options), z, mean0, cov0
    )
    capped = run_filter(create_filter("adaptive_alpha_kf", dynamics, measurement, **options), z, mean0, cov0)
    assert np.isclose(free.extras["alpha"][:, 200:].mean(), 2.0, rtol=0.1)
    assert (capped.extras["alpha"] <= 1).all()
    assert capped.extras["alpha"][:, 200:].mean() > 0.98


def one_update(z, cov0, noise, **options):
    n = len(cov0)
    filter = create_filter(
        "adaptive_alpha_kf",
        LinearDynamics(np.eye(n), np.zeros((n, n))),
        LinearMeasurement(np.eye(2, n), noise),
        **options,
    )
    return run_filter(filter, np.asarray(z, dtype=float)[:, None], np.zeros(n), cov0)


def test_gate_brings_the_nis_to_its_threshold():
    cov0 = np.array([[2.0, 0.3, 0.5], [0.3, 0.4, 0.1], [0.5, 0.1, 1.0]])
    noise = np.array([[1.0, 0.4], [0.4, 3.0]])
    z = [[0.5, -0.5], [9.0, 2.0], [3.0, -25.0], [1e4, 0.0]]
    history = one_update(z, cov0, noise, scheme="gate")
    c = chi2.ppf(0.95, 2)
    M = cov0[:2, :2]
    for run, nu in enumerate(np.array(z)):

        def nis(b, nu=nu):
            return nu @ np.linalg.solve(M + b * noise, nu)

        alpha = 1.0 if nis(1.0) <= c else max(1 / brentq(lambda b: nis(b) - c, 1.0, 1e12), 1e-3)
        assert np.isclose(history.extras["alpha"][run, 0], alpha, rtol=1e-8)
        S = M + noise / alpha
        assert np.allclose(history.mean[run, 0], cov0[:, :2] @ np.linalg.solve(S, nu), rtol=1e-8)
        assert np.allclose(history.covariance[run, 0], cov0 - cov0[:, :2] @ np.linalg.solve(S, cov0[:2]), atol=1e-8)
        assert np.isclose(history.nis[run, 0], nis(1.0))
        assert np.isclose(history.log_likelihood[run, 0], multivariate_normal.logpdf(nu, cov=M + noise))


def test_responsibilities_average_the_precisions():
    cov0 = np.array([[2.0, 0.3], [0.3, 0.4]])
    components = np.array([[[1.0, 0.4], [0.4, 3.0]], [[60.0, 0.0], [0.0, 20.0]]])
    weights = np.array([0.7, 0.3])
    z = np.array([4.0, -2.0])
    history = one_update([z], cov0, MixtureNoise(weights, components), scheme="responsibilities")
    densities = weights * [multivariate_normal.pdf(z, cov=cov0 + component) for component in components]
    used = np.linalg.inv(np.einsum("j,jab->ab", densities / densities.sum(), np.linalg.inv(components)))
    assert np.allclose(history.mean[0, 0], cov0 @ np.linalg.solve(cov0 + used, z), rtol=1e-10)
    assert np.isclose(history.log_likelihood[0, 0], np.log(densities.sum()))
    assert np.isclose(history.extras["alpha"][0, 0], np.sqrt(np.linalg.det(components[0]) / np.linalg.det(used)))
    # Channels that switch by themselves: two scalar updates.
    variances = np.array([[1.0, 3.0], [60.0, 20.0]])
    apart = MixtureNoise(weights, np.stack([np.diag(row) for row in variances]), shared=False)
    prior = np.diag([2.0, 0.4])
    history = one_update([z], prior, apart, scheme="responsibilities")
    for i in range(2):
        density = weights * np.exp(-0.5 * z[i] ** 2 / (prior[i, i] + variances[:, i]))
        density /= np.sqrt(prior[i, i] + variances[:, i])
        effective = density.sum() / (density / variances[:, i]).sum()
        assert np.isclose(history.mean[0, 0, i], prior[i, i] / (prior[i, i] + effective) * z[i])


def test_student_t_settles_at_its_fixed_point_within_the_limits():
    cov0, noise, df = np.array([[2.0, 0.3], [0.3, 0.4]]), np.diag([1.0, 3.0]), 4.0
    z = np.array([[6.0, -2.0], [1e6, 0.0], [0.0, 0.0]])
    one = one_update(z, cov0, noise, scheme="student_t", iterations=50, per_channel=False, alpha_max=4.0)
    alpha = one.extras["alpha"][0, 0]
    mean, P = one.mean[0, 0], one.covariance[0, 0]
    e = z[0] - mean
    assert np.isclose(alpha, (df + 2) / (df + np.trace(np.linalg.solve(noise, np.outer(e, e) + P))), rtol=1e-6)
    assert np.allclose(P, np.linalg.inv(np.linalg.inv(cov0) + alpha * np.linalg.inv(noise)))
    assert one.extras["alpha"][1, 0] == 1e-3
    assert 1 < one.extras["alpha"][2, 0] < 1.5
    each = one_update(z, cov0, noise, scheme="student_t", iterations=50)
    e, variances = z[0] - each.mean[0, 0], np.diag(each.covariance[0, 0])
    weights = (df + 1) / (df + (e**2 + variances) / np.diag(noise))
    assert np.isclose(each.extras["alpha"][0, 0], weights.min(), rtol=1e-6)
    assert each.extras["alpha"][2, 0] == 1


@pytest.mark.parametrize("scheme", SCHEMES)
def test_gaussian_residuals_leave_the_extended_filter(scheme):
    dynamics, truth, mean0, cov0, rng = relative_orbit(runs=3, steps=60, seed=5)
    z = truth[..., :3] + 0.1 * SIGMA_M * rng.standard_normal((3, 60, 3))  # far within the stated noise
    options = {"degrees_of_freedom": 1e9} if scheme == "student_t" else {}
    adapted = run_filter(
        create_filter("adaptive_alpha_kf", dynamics, LinearMeasurement(H, R), scheme=scheme, **options), z, mean0, cov0
    )
    plain = run_filter(create_filter("ekf", dynamics, LinearMeasurement(H, R)), z, mean0, cov0)
    assert np.allclose(adapted.mean, plain.mean, rtol=0, atol=1e-6)
    assert np.allclose(adapted.extras["alpha"], 1.0)
    assert np.allclose(adapted.nis, plain.nis)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_run_does_not_depend_on_its_block_and_missing_rows_are_predicted(scheme):
    dynamics, truth, mean0, cov0, rng = relative_orbit(runs=4, steps=60, seed=6)
    z = truth[..., :3] + 3 * SIGMA_M * rng.standard_normal((4, 60, 3))
    z[0, 10:20] = np.nan
    z[2, 30] = np.nan
    mixture = MixtureNoise(np.array([0.8, 0.2]), np.stack([R, 25 * R]))
    noise = mixture if scheme == "responsibilities" else R
    filter = create_filter("adaptive_alpha_kf", dynamics, LinearMeasurement(H, noise), scheme=scheme, window=20)
    together = run_filter(filter, z, mean0, cov0)
    for run in range(4):
        alone = run_filter(filter, z[run : run + 1], mean0[run : run + 1], cov0)
        assert np.array_equal(alone.mean[0], together.mean[run])
        assert np.array_equal(alone.covariance[0], together.covariance[run])
    assert np.isnan(together.extras["alpha"][0, 10:20]).all()
    if scheme == "windowed_nis":
        # Missing rows do not count: run 0 fills its window ten readings later than the others.
        assert (together.extras["alpha"][0, 20:30] == 1).all()
        assert (together.extras["alpha"][1, 20:] < 1).any()


def test_scale_for_solves_over_ten_decades_and_survives_nan():
    rng = np.random.default_rng(7)
    s, d = 10 ** rng.uniform(-4, 6, (500, 5)), 10 ** rng.uniform(-5, 5, (500, 5))
    target = 5.0
    b = scale_for(s, d, target, 0.25, 1e12)
    f = (s / (d + b[:, None])).sum(axis=1)
    inside = b > 0.25
    assert inside.sum() > 100
    assert np.allclose(f[inside], target, rtol=1e-9)
    assert ((s / (d + 0.25)).sum(axis=1)[~inside] <= target).all()
    M = np.eye(2)[None].repeat(2, axis=0)
    M[1, 0, 0] = np.nan
    squares, _ = modes(np.ones((2, 2)), M, np.eye(2)[None].repeat(2, axis=0))
    assert np.allclose(squares[0], 1)


def test_options_are_checked():
    measurement = LinearMeasurement(np.eye(1), np.eye(1))
    dynamics = LinearDynamics(np.eye(1), np.zeros((1, 1)))
    for bad in ({"scheme": "bank"}, {"alpha_max": 5.0}, {"alpha_min": 0.0}, {"window": 2}, {"degrees_of_freedom": 0.0}):
        with pytest.raises(ValueError, match="adaptive_alpha_kf"):
            create_filter("adaptive_alpha_kf", dynamics, measurement, **bad)
