"""Linear problems, consistency, missing rows, blocks and breakdowns of kf, ekf and ukf."""

import numpy as np
import pytest
from radar_problem import polar, polar_jacobian, radar_problem
from scipy.stats import chi2

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, MixtureNoise, create_filter, run_filter

KINDS = ["kf", "ekf", "ukf"]


def linear_problem(runs=3, steps=40, n=4, m=2, seed=3):
    rng = np.random.default_rng(seed)
    F = np.eye(n) + 0.1 * rng.standard_normal((n, n))
    root = rng.standard_normal((n, n))
    Q = 0.01 * root @ root.T
    H = rng.standard_normal((m, n))
    R = np.diag(rng.uniform(0.5, 2.0, m))
    cov0 = np.diag(rng.uniform(1, 4, n))
    x = rng.standard_normal((runs, n)) @ np.sqrt(cov0)
    z = np.empty((runs, steps, m))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, n)) @ np.linalg.cholesky(Q).T
        z[:, k] = x @ H.T + rng.standard_normal((runs, m)) @ np.sqrt(R)
    return LinearDynamics(F, Q), LinearMeasurement(H, R), z, np.zeros((runs, n)), cov0, (F, Q, H, R)


def plain_kalman(z, mean, P, F, Q, H, R):
    """The text-book recursion for one run, with explicit inverses, on the channels that each reading has."""
    means, covariances, log_likelihood = [], [], []
    for row in z:
        mean, P = F @ mean, F @ P @ F.T + Q
        there = np.flatnonzero(~np.isnan(row))
        if len(there):
            SH = H[there]
            S = SH @ P @ SH.T + R[np.ix_(there, there)]
            K = P @ SH.T @ np.linalg.inv(S)
            nu = row[there] - SH @ mean
            mean, P = mean + K @ nu, (np.eye(len(P)) - K @ SH) @ P
            log_likelihood.append(
                -0.5 * (nu @ np.linalg.inv(S) @ nu + np.log(np.linalg.det(S)) + len(nu) * np.log(2 * np.pi))
            )
        else:
            log_likelihood.append(0.0)
        means.append(mean)
        covariances.append(P)
    return np.array(means), np.array(covariances), np.array(log_likelihood)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("missing", [False, True])
def test_linear_problem_equals_plain_recursion(kind, missing):
    dynamics, measurement, z, mean0, cov0, (F, Q, H, R) = linear_problem()
    if missing:
        z[0, 5:9] = np.nan
        z[1, 7, 1] = np.nan
        z[2, 11, 0] = np.nan
        z[:, 20] = np.nan
    history = run_filter(create_filter(kind, dynamics, measurement), z, mean0, cov0)
    assert np.array_equal(history.dof, (~np.isnan(z)).sum(axis=2))
    for run in range(len(z)):
        means, covariances, log_likelihood = plain_kalman(z[run], mean0[run], cov0, F, Q, H, R)
        assert np.allclose(history.mean[run], means, rtol=0, atol=1e-11)
        assert np.allclose(history.covariance[run], covariances, rtol=0, atol=1e-11)
        assert np.allclose(history.log_likelihood[run], log_likelihood, rtol=0, atol=1e-10)
    gone = np.isnan(z).all(axis=2)
    assert np.array_equal(np.isnan(history.nis), gone)
    assert (history.log_likelihood[gone] == 0).all()


def test_one_state_one_measurement():
    z = np.array([[[1.0], [2.0], [np.nan], [1.5]]])
    dynamics, measurement = LinearDynamics([[1.0]], [[0.1]]), LinearMeasurement([[1.0]], [[0.5]])
    histories = [run_filter(create_filter(kind, dynamics, measurement), z, [0.0], [[1.0]]) for kind in KINDS]
    means, covariances, _ = plain_kalman(
        z[0], np.zeros(1), np.eye(1), np.eye(1), 0.1 * np.eye(1), np.eye(1), 0.5 * np.eye(1)
    )
    for history in histories:
        assert np.allclose(history.mean[0], means, atol=1e-14)
        assert np.allclose(history.covariance[0], covariances, atol=1e-14)


@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_nees_and_nis_within_chi_square_bounds(kind):
    """Truth driven by the filter's own Q: over independent runs the sums are chi-square (99.9 % bounds)."""
    runs = 200
    problem = radar_problem(runs=runs, steps=60)
    history = run_filter(
        create_filter(kind, problem.dynamics, problem.measurement), problem.z, problem.mean0, problem.cov0
    )
    error = history.mean - problem.truth
    for epoch in (9, 29, 59):
        nees = np.einsum(
            "bi,bi->b",
            error[:, epoch],
            np.linalg.solve(history.covariance[:, epoch], error[:, epoch][..., None])[..., 0],
        )
        low, high = chi2.ppf([0.0005, 0.9995], 6 * runs)
        assert low < nees.sum() < high
    low, high = chi2.ppf([0.0005, 0.9995], 3 * history.nis.size)
    assert low < history.nis.sum() < high


@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_bits_do_not_depend_on_the_block(kind):
    problem = radar_problem(runs=9, steps=50)
    problem.z[2, 10:20] = np.nan

    def run(rows):
        return run_filter(
            create_filter(kind, problem.dynamics, problem.measurement),
            problem.z[rows],
            problem.mean0[rows],
            problem.cov0,
        )

    whole = run(slice(None))
    for rows in (slice(0, 1), slice(2, 3), slice(1, 4), slice(5, 9)):
        part = run(rows)
        for name in ("mean", "covariance", "nis", "log_likelihood"):
            assert np.array_equal(getattr(part, name), getattr(whole, name)[rows], equal_nan=True), (name, rows)


@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_a_broken_run_leaves_the_others_alone_and_says_when_and_why(kind):
    problem = radar_problem(runs=3, steps=20)
    good = run_filter(
        create_filter(kind, problem.dynamics, problem.measurement), problem.z, problem.mean0, problem.cov0
    )
    z = problem.z.copy()
    z[1, 7] = 1e300
    with pytest.warns(RuntimeWarning, match="the filter failed in run 11 at epoch 8: .*grew beyond"):
        bad = run_filter(
            create_filter(kind, problem.dynamics, problem.measurement),
            z,
            problem.mean0,
            problem.cov0,
            runs=(10, 11, 12),
        )
    [failure] = bad.failures
    assert (failure.run, failure.epoch) == (11, 8)
    for series in (bad.mean, bad.covariance, bad.nis, bad.log_likelihood):
        assert np.isnan(series[1, 8:]).all() and np.isfinite(series[1, :7]).all()
    for run in (0, 2):
        assert np.array_equal(bad.mean[run], good.mean[run])


def test_small_alpha_keeps_its_digits():
    """At alpha = 1e-3 the text-book weights are about -1e6; deviations from the centre keep the mean to 1e-5 m."""
    problem = radar_problem(runs=2, steps=200)
    wide = run_filter(
        create_filter("ukf", problem.dynamics, problem.measurement, alpha=1e-3, beta=2.0),
        problem.z,
        problem.mean0,
        problem.cov0,
    )
    narrow = run_filter(
        create_filter("ukf", problem.dynamics, problem.measurement, alpha=3e-2, beta=2.0),
        problem.z,
        problem.mean0,
        problem.cov0,
    )
    assert np.abs(wide.mean - narrow.mean)[..., :3].max() < 1e-4
    assert np.isfinite(wide.covariance).all()


def test_finite_difference_jacobian_equals_the_analytic():
    problem = radar_problem(runs=5, steps=1)
    states = problem.truth[:, 0]
    plain = FunctionMeasurement(polar, problem.R, angles=(1, 2))
    assert np.allclose(plain.jacobian(states, 0), polar_jacobian(states), rtol=1e-7, atol=1e-8)
    history = run_filter(create_filter("ekf", problem.dynamics, plain), problem.z, problem.mean0, problem.cov0)
    exact = run_filter(
        create_filter("ekf", problem.dynamics, problem.measurement), problem.z, problem.mean0, problem.cov0
    )
    assert np.abs(history.mean - exact.mean).max() < 1e-5


def test_ukf_on_nonlinear_dynamics_is_exact_for_a_quadratic():
    """y = x^2 with x ~ N(m, s^2): mean m^2 + s^2; the unscented rule with kappa = 2 also gets the variance."""

    class Square:
        dimension, linear = 1, False

        def propagate(self, states, step):
            return states**2

        def transition(self, mean, step):
            return 2 * mean[..., None]

        def process_noise(self, states, step):
            return np.zeros((1, 1))

    m, s = 1.5, 0.3
    ukf = create_filter("ukf", Square(), LinearMeasurement([[1.0]], [[1.0]]), kappa=2.0)
    history = run_filter(ukf, np.full((1, 1, 1), np.nan), [m], [[s**2]])
    assert history.mean[0, 0, 0] == pytest.approx(m**2 + s**2, rel=1e-14)
    assert history.covariance[0, 0, 0, 0] == pytest.approx(4 * m**2 * s**2 + 2 * s**4, rel=1e-13)


def test_gate_rejects_an_outlier_and_counts_it():
    dynamics, measurement, z, mean0, cov0, _ = linear_problem(runs=2)
    z[0, 10] += 1e3
    history = run_filter(create_filter("kf", dynamics, measurement, gate_probability=0.999999), z, mean0, cov0)
    assert history.extras["rejected"][0, 10] == 1
    assert history.extras["rejected"].sum() == 1
    z[0, 10] = np.nan
    skipped = run_filter(create_filter("kf", dynamics, measurement), z, mean0, cov0)
    assert np.array_equal(history.mean, skipped.mean)


def test_prior_14_orders_wider_than_the_noise_stays_positive_definite():
    problem = radar_problem(runs=2, steps=30)
    H, R = np.eye(3, 6), 1e-4 * np.eye(3)
    z = problem.truth[..., :3]
    history = run_filter(
        create_filter("kf", problem.dynamics, LinearMeasurement(H, R)), z, np.zeros(6), 1e10 * np.eye(6)
    )
    assert (np.linalg.eigvalsh(history.covariance) > 0).all()
    assert np.abs(history.mean - problem.truth)[:, -1, :3].max() < 0.1


def test_r_scale_is_a_larger_noise():
    dynamics, measurement, z, mean0, cov0, (_F, _Q, H, R) = linear_problem()
    scaled = run_filter(create_filter("kf", dynamics, measurement, r_scale=4.0), z, mean0, cov0)
    wider = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, 4 * R)), z, mean0, cov0)
    assert np.array_equal(scaled.mean, wider.mean)


def test_noise_and_matrices_per_epoch_and_per_run():
    _dynamics, _measurement, z, mean0, cov0, (F, Q, H, R) = linear_problem(runs=2, steps=6)
    scale = np.arange(1.0, 13.0).reshape(2, 6, 1, 1)
    varying = LinearMeasurement(H, scale * R)
    per_epoch = LinearDynamics(
        np.stack([F * (1 + 0.01 * k) for k in range(6)]), np.stack([Q * (1 + k) for k in range(6)])
    )
    history = run_filter(create_filter("kf", per_epoch, varying), z, mean0, cov0)
    for run in range(2):
        mean, P = mean0[run], cov0
        for k in range(6):
            step = plain_kalman(z[run, k : k + 1], mean, P, F * (1 + 0.01 * k), Q * (1 + k), H, scale[run, k] * R)
            mean, P = step[0][0], step[1][0]
            assert np.allclose(history.mean[run, k], mean, atol=1e-11)


def test_mixture_noise_enters_with_its_total_covariance():
    mixture = MixtureNoise(np.array([0.9, 0.1]), np.stack([np.eye(2), 100 * np.eye(2)]))
    assert np.allclose(mixture.covariance, 10.9 * np.eye(2))
    dynamics, _, z, mean0, cov0, (_F, _Q, H, _R) = linear_problem()
    a = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, mixture)), z, mean0, cov0)
    b = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, 10.9 * np.eye(2))), z, mean0, cov0)
    assert np.allclose(a.mean, b.mean, atol=1e-12)


@pytest.mark.parametrize(
    "call, sentence",
    [
        (lambda d, m: create_filter("ekv", d, m), "did you mean 'ekf'"),
        (lambda d, m: create_filter("ekf", d, m, gait=1), "gait"),
        (lambda d, m: create_filter("kf", d, m, r_scale=-1.0), "r_scale"),
        (lambda d, m: create_filter("ukf", d, m, kappa=-10.0), "kappa"),
        (lambda d, m: run_filter(create_filter("kf", d, m), np.zeros((2, 5)), [0] * 4, np.eye(4)), "z has shape"),
        (lambda d, m: run_filter(create_filter("kf", d, m), np.zeros((2, 5, 3)), [0] * 4, np.eye(4)), "components"),
        (lambda d, m: run_filter(create_filter("kf", d, m), np.zeros((2, 5, 2)), [0] * 3, np.eye(4)), "mean0"),
        (lambda d, m: LinearDynamics(np.eye(3), np.eye(2)), "states"),
        (lambda d, m: LinearMeasurement(np.eye(2), np.eye(3)), "components"),
    ],
)
def test_wrong_input_is_named(call, sentence):
    dynamics, measurement, *_ = linear_problem()
    with pytest.raises(ValueError, match=sentence):
        call(dynamics, measurement)
