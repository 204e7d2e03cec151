"""What is known afterwards: smoothers and batch least squares, beside dense least squares over all states at once."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import kstest

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter, smooth
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.registry import filter_kinds

RUNS, EPOCHS, N = 3, 25, 4
H, R = np.array([[1.0, 0.2, 0.0, 0.0], [0.0, 0.5, 1.0, -0.3]]), np.diag([0.5, 0.2])
MEAN0, P0 = np.array([0.3, -0.5, 0.2, 1.0]), np.diag([1.0, 2.0, 0.5, 3.0])


def problem(noise, seed=1):
    """Return F and Q by epoch and readings with gaps; the states follow the model."""
    rng = np.random.default_rng(seed)
    F = np.eye(N) + 0.2 * rng.normal(size=(EPOCHS, N, N))
    root = noise * rng.normal(size=(EPOCHS, N, N))
    x = MEAN0 + rng.normal(size=(RUNS, N)) @ np.sqrt(P0)
    z = np.empty((RUNS, EPOCHS, 2))
    for k in range(EPOCHS):
        x = x @ F[k].T + rng.normal(size=(RUNS, N)) @ root[k].T
        z[:, k] = x @ H.T + rng.normal(size=(RUNS, 2)) @ np.sqrt(R)
    z[0, 3:9] = np.nan
    z[1, :4] = np.nan
    z[2, 7, 1] = np.nan
    return F, root @ root.swapaxes(1, 2), z


def rows_of(blocks, place, values, root):
    row = np.zeros((len(values), blocks * N))
    row[:, N * place : N * place + N] = values
    return np.linalg.solve(root, row)


def over_all_states(F, Q, z):
    """Return every state of a run and its covariance by one dense least squares problem over all of them."""
    rows, sides = [rows_of(EPOCHS + 1, 0, np.eye(N), np.sqrt(P0))], [np.linalg.solve(np.sqrt(P0), MEAN0)]
    for k in range(EPOCHS):
        L = np.linalg.cholesky(Q[k])
        rows.append(rows_of(EPOCHS + 1, k + 1, np.eye(N), L) - rows_of(EPOCHS + 1, k, F[k], L))
        sides.append(np.zeros(N))
        there = np.isfinite(z[k])
        root = np.sqrt(R[np.ix_(there, there)])
        rows.append(rows_of(EPOCHS + 1, k + 1, H[there], root))
        sides.append(np.linalg.solve(root, z[k, there]) if there.any() else np.zeros(0))
    q, r = np.linalg.qr(np.concatenate(rows))
    inverse = np.linalg.inv(r)
    x, P = inverse @ (q.T @ np.concatenate(sides)), inverse @ inverse.T
    return x.reshape(-1, N)[1:], np.array([P[i : i + N, i : i + N] for i in range(N, len(P), N)])


def over_the_first_state(F, z):
    """Return the same without process noise, by dense least squares for the state before the first epoch."""
    rows, sides, Phi, through = [np.linalg.inv(np.sqrt(P0))], [np.linalg.solve(np.sqrt(P0), MEAN0)], np.eye(N), []
    for k in range(EPOCHS):
        Phi = F[k] @ Phi
        through.append(Phi)
        there = np.isfinite(z[k])
        root = np.sqrt(R[np.ix_(there, there)])
        rows.append(np.linalg.solve(root, H[there] @ Phi))
        sides.append(np.linalg.solve(root, z[k, there]))
    A = np.concatenate(rows)
    x = np.linalg.lstsq(A, np.concatenate(sides))[0]
    P = np.linalg.inv(A.T @ A)
    return np.array([Phi @ x for Phi in through]), np.array([Phi @ P @ Phi.T for Phi in through])


def apart(mean, covariance, expected, P):
    """Return the largest difference in sigmas, of means and covariances."""
    sigma = np.sqrt(np.einsum("tii->ti", P))
    return max(
        np.abs((mean - expected) / sigma).max(),
        np.abs((covariance - P) / (sigma[:, :, None] * sigma[:, None, :])).max(),
    )


@pytest.mark.parametrize("kind", ["kf", "ukf", "sr_ukf"])
def test_batch_over_all_states_is_the_smoother_and_the_filter_at_the_last_epoch(kind):
    F, Q, z = problem(noise=0.3)
    dynamics = LinearDynamics(F, Q)
    history = run_filter(create_filter(kind, dynamics, LinearMeasurement(H, R)), z, MEAN0, P0)
    smoothed = smooth(history, dynamics)
    for run in range(RUNS):
        mean, covariance = over_all_states(F, Q, z[run])
        assert apart(smoothed.mean[run], smoothed.covariance[run], mean, covariance) < 1e-9
        assert apart(history.mean[run, -1:], history.covariance[run, -1:], mean[-1:], covariance[-1:]) < 1e-9


def test_batch_without_process_noise_is_the_smoother_and_the_filter_at_the_last_epoch():
    F, Q, z = problem(noise=0.0)
    dynamics, measurement = LinearDynamics(F, Q), LinearMeasurement(H, R)
    history = run_filter(create_filter("kf", dynamics, measurement), z, MEAN0, P0)
    smoothed = smooth(history, dynamics)
    batch = run_filter(create_filter("batch_least_squares", dynamics, measurement), z, MEAN0, P0)
    for run in range(RUNS):
        mean, covariance = over_the_first_state(F, z[run])
        for found in (smoothed, batch):
            assert apart(found.mean[run], found.covariance[run], mean, covariance) < 1e-9
        assert apart(history.mean[run, -1:], history.covariance[run, -1:], mean[-1:], covariance[-1:]) < 1e-9
    assert np.array_equal(np.isnan(batch.nis), np.isnan(z).all(axis=2))


def test_process_noise_of_the_dynamics_does_not_count_in_a_batch():
    F, Q, z = problem(noise=0.3)
    fits = [
        run_filter(create_filter("batch_least_squares", LinearDynamics(F, q), LinearMeasurement(H, R)), z, MEAN0, P0)
        for q in (Q, np.zeros_like(Q))
    ]
    assert np.array_equal(fits[0].mean, fits[1].mean)


def test_what_smoothing_changes_has_the_variance_that_it_gains():
    """(x_f - x_s) / sqrt(P_f - P_s) is N(0, 1) (McReynolds); one epoch and state a run, so that all are independent."""
    rng = np.random.default_rng(5)
    runs, F, Q = 400, np.array([[1.0, 1.0], [0.0, 1.0]]), np.diag([0.02, 0.01])
    x, z = rng.normal(size=(runs, 2)), np.empty((runs, 20, 1))
    for k in range(20):
        x = x @ F.T + rng.normal(size=(runs, 2)) @ np.sqrt(Q)
        z[:, k] = x[:, :1] + rng.normal(size=(runs, 1))
    dynamics = LinearDynamics(F, Q)
    filter = create_filter("kf", dynamics, LinearMeasurement([[1.0, 0.0]], [[1.0]]))
    history = run_filter(filter, z, np.zeros(2), np.eye(2))
    for smoothed in (smooth(history, dynamics), smooth(history, dynamics, lag=3)):
        gained = np.einsum("btii->bti", history.covariance - smoothed.covariance)[:, :-1]
        change = (history.mean - smoothed.mean)[:, :-1] / np.sqrt(gained)
        for k, state in ((5, 0), (10, 1)):
            assert kstest(change[:, k, state], "norm").pvalue > 1e-3


@pytest.mark.parametrize("lag", [1, 2, 3, 7, 24, 25, 100])
def test_a_fixed_lag_is_the_smoother_over_the_readings_up_to_then(lag):
    F, Q, z = problem(noise=0.3)
    dynamics = LinearDynamics(F, Q)
    history = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, R)), z, MEAN0, P0)
    lagging = smooth(history, dynamics, lag=lag)
    for k in range(EPOCHS):
        until = slice(min(k + lag, EPOCHS - 1) + 1)
        parts = [getattr(history, name)[:, until] for name in ("mean", "covariance", "nis", "log_likelihood")]
        whole = smooth(type(history)(*parts, {}), dynamics)
        for run in range(RUNS):
            both = whole.mean[run, k : k + 1], whole.covariance[run, k : k + 1]
            assert apart(lagging.mean[run, k : k + 1], lagging.covariance[run, k : k + 1], *both) < 1e-9


def test_a_lag_of_none_changes_nothing_and_one_below_is_refused():
    F, Q, z = problem(noise=0.3)
    dynamics = LinearDynamics(F, Q)
    history = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, R)), z, MEAN0, P0)
    assert np.array_equal(smooth(history, dynamics, lag=0).mean, history.mean)
    with pytest.raises(ValueError, match="lag is -1; give a number of epochs"):
        smooth(history, dynamics, lag=-1)


class Bent:
    """A map that bends over a sigma, with process noise."""

    dimension, linear = 2, False

    def propagate(self, states, step):
        x, y = states[..., 0], states[..., 1]
        return np.stack([x + 0.3 * np.sin(y), y + 0.2 * x * x], axis=-1)

    def transition(self, mean, step):
        F = np.tile(np.eye(2), (len(mean), 1, 1))
        F[:, 0, 1], F[:, 1, 0] = 0.3 * np.cos(mean[:, 1]), 0.4 * mean[:, 0]
        return F

    def process_noise(self, states, step):
        return np.diag([0.01, 0.02])


@pytest.mark.parametrize(
    "kind, options", [("ukf", {}), ("ukf", {"alpha": 0.5, "beta": 2.0}), ("ckf", {}), ("sr_ukf", {"kappa": 1.0})]
)
def test_the_linear_step_of_sigma_points_has_their_moments(kind, options):
    """Against the sigma points' own sums, written out: covariance of the prediction, and with the state before."""
    dynamics = Bent()
    filter = create_filter(kind, dynamics, LinearMeasurement([[1.0, 0.0]], [[1.0]]), **options)
    P = np.array([[[0.5, 0.2], [0.2, 0.4]], [[1.0, 0.0], [0.0, 1e-8]]])
    mean = np.array([[0.4, -0.7], [1.0, 2.0]])
    belief = filter.start(Gaussian(mean, P), None)
    F, Q = filter.linear_step(belief, Step(1))
    alpha, kappa = options.get("alpha", 1.0), options.get("kappa", 0.0)
    spread = np.sqrt(alpha**2 * (2 + kappa))
    for run in range(2):
        offsets = spread * np.linalg.cholesky(P[run]).T
        points = np.concatenate([mean[run] + offsets, mean[run] - offsets])
        centre = dynamics.propagate(mean[run], None)
        d = dynamics.propagate(points, None) - centre
        cross = (points - mean[run]).T @ d / (2 * spread**2)
        assert np.allclose(F[run] @ P[run], cross.T, rtol=1e-9, atol=1e-12)
    predicted = filter.predict(belief, Step(1))
    assert np.allclose(F @ P @ F.swapaxes(1, 2) + Q, predicted.covariance, rtol=1e-10, atol=1e-13)


def test_which_filters_can_be_smoothed():
    smooths = {name for name, kind in filter_kinds().items() if kind.smooths}
    assert {"kf", "ekf", "iekf", "ukf", "ckf", "sr_ukf", "alpha_kf", "skf", "huber", "two_step", "student_t"} <= smooths
    assert smooths.isdisjoint({"imm", "gaussian_sum", "particle", "unscented_particle", "batch_least_squares"})


def ranges(states, epoch):
    x, y = states[..., 0], states[..., 1]
    return np.stack([np.hypot(x, y), np.arctan2(y, x)], axis=-1)


def nonlinear_problem():
    F, sigma = np.array([[1, 0, 1, 0], [0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1.0]]), np.array([1.0, 0.05])
    rng = np.random.default_rng(3)
    x = np.array([20.0, -30.0, 1.0, 2.5]) + rng.normal(size=(3, 4)) * [3, 3, 0.2, 0.2]
    z = np.empty((3, 30, 2))
    for k in range(30):
        x = x @ F.T
        z[:, k] = ranges(x, k) + rng.normal(size=(3, 2)) * sigma
    mean0, cov0 = np.array([22.0, -28.0, 0.5, 2.0]), np.diag([25.0, 25.0, 1.0, 1.0])
    measurement = FunctionMeasurement(ranges, np.diag(sigma**2), angles=(1,))
    return (
        F,
        sigma,
        z,
        mean0,
        cov0,
        create_filter("batch_least_squares", LinearDynamics(F, np.zeros((4, 4))), measurement),
    )


def test_a_nonlinear_fit_is_that_of_another_least_squares_search():
    F, sigma, z, mean0, cov0, batch = nonlinear_problem()
    found = run_filter(batch, z, mean0, cov0)
    for run in range(3):

        def residuals(x0, run=run):
            parts, x = [(x0 - mean0) / np.sqrt(np.diag(cov0))], x0
            for k in range(30):
                x = F @ x
                difference = z[run, k] - ranges(x, k)
                difference[1] = (difference[1] + np.pi) % (2 * np.pi) - np.pi
                parts.append(difference / sigma)
            return np.concatenate(parts)

        best = least_squares(residuals, mean0, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        sigmas = np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac)))
        first = np.linalg.solve(F, found.mean[run, 0])
        assert np.abs((first - best.x) / sigmas).max() < 1e-6


def test_a_fit_that_does_not_converge_fails_its_own_run_alone():
    *_, z, mean0, cov0, batch = nonlinear_problem()
    alone = run_filter(batch, z[:2], mean0, cov0)
    z[2] = [1e9, 1.0]
    with pytest.warns(RuntimeWarning, match="run 2 at epoch 0: Gauss-Newton has not converged in 20 passes"):
        found = run_filter(batch, z, mean0, cov0)
    assert np.isnan(found.mean[2]).all() and np.isnan(found.nis[2]).all() and (found.dof[2] == 0).all()
    for name in ("mean", "covariance", "nis", "log_likelihood"):
        assert np.array_equal(getattr(found, name)[:2], getattr(alone, name)), name
