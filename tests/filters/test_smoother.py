import numpy as np
import pytest

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.smoother import smooth

RUNS, EPOCHS, N = 3, 25, 4


def problem(seed=1, singular=False):
    rng = np.random.default_rng(seed)
    F = np.eye(N) + 0.2 * rng.normal(size=(EPOCHS, N, N))
    root = rng.normal(size=(EPOCHS, N, N)) * 0.3
    if singular:
        root[..., 1:] = 0.0
    H, R = rng.normal(size=(2, N)), np.diag([0.5, 0.2])
    z = rng.normal(size=(RUNS, EPOCHS, 2)) * 2
    z[0, 3:9] = np.nan
    z[1, :4] = np.nan
    z[1, 20:] = np.nan
    mean0, P0 = rng.normal(size=(RUNS, N)), np.diag([1.0, 2.0, 0.5, 3.0])
    return F, root @ root.swapaxes(1, 2), H, R, z, mean0, P0


def joint_gaussian(F, Q, H, R, z, mean0, P0):
    """Return mean and covariance of all states of one run, by conditioning their joint Gaussian in one go."""
    m, blocks = mean0, {}
    means, P = [], P0
    for k in range(EPOCHS):
        m, P = F[k] @ m, F[k] @ P @ F[k].T + Q[k]
        means.append(m)
        blocks[k, k] = P
        for j in range(k):
            blocks[k, j] = F[k] @ blocks[k - 1, j]
            blocks[j, k] = blocks[k, j].T
    mean = np.concatenate(means)
    C = np.block([[blocks[i, j] for j in range(EPOCHS)] for i in range(EPOCHS)])
    seen = [k for k in range(EPOCHS) if np.isfinite(z[k]).all()]
    big_H = np.zeros((2 * len(seen), N * EPOCHS))
    for row, k in enumerate(seen):
        big_H[2 * row : 2 * row + 2, N * k : N * k + N] = H
    S = big_H @ C @ big_H.T + np.kron(np.eye(len(seen)), R)
    K = np.linalg.solve(S, big_H @ C).T
    mean = mean + K @ (z[seen].ravel() - big_H @ mean)
    C = C - K @ big_H @ C
    return mean.reshape(EPOCHS, N), np.array([C[N * k : N * k + N, N * k : N * k + N] for k in range(EPOCHS)])


@pytest.mark.parametrize("singular", [False, True])
def test_equals_the_joint_gaussian_with_gaps_and_matrices_that_change(singular):
    F, Q, H, R, z, mean0, P0 = problem(singular=singular)
    dynamics = LinearDynamics(F, Q)
    history = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, R)), z, mean0, P0)
    smoothed = smooth(history, dynamics)
    for run in range(RUNS):
        mean, covariance = joint_gaussian(F, Q, H, R, z[run], mean0[run], P0)
        scale = np.sqrt(np.einsum("tii->ti", covariance))
        assert (np.abs(smoothed.mean[run] - mean) / scale).max() < 1e-8
        difference = np.abs(smoothed.covariance[run] - covariance) / (scale[:, :, None] * scale[:, None, :])
        assert difference.max() < 1e-8


def test_last_epoch_is_the_filter_and_variances_do_not_grow():
    F, Q, H, R, z, mean0, P0 = problem()
    dynamics = LinearDynamics(F, Q)
    history = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, R)), z, mean0, P0)
    smoothed = smooth(history, dynamics)
    assert np.array_equal(smoothed.mean[:, -1], history.mean[:, -1])
    assert np.array_equal(smoothed.covariance[:, -1], history.covariance[:, -1])
    gain = np.linalg.eigvalsh(history.covariance - smoothed.covariance)
    assert gain.min() > -1e-12
    assert np.linalg.eigvalsh(smoothed.covariance).min() > 0
    before_last = smoothed.covariance[:, :-1]
    assert np.array_equal(before_last, before_last.swapaxes(2, 3))


def test_history_of_a_later_stretch_uses_its_own_epochs():
    F, Q, H, R, z, mean0, P0 = problem()
    dynamics = LinearDynamics(F, Q)
    history = run_filter(create_filter("kf", dynamics, LinearMeasurement(H, R)), z, mean0, P0)
    whole = smooth(history, dynamics)
    tail = type(history)(
        history.mean[:, 10:], history.covariance[:, 10:], history.nis[:, 10:], history.log_likelihood[:, 10:], {}
    )
    assert np.array_equal(smooth(tail, dynamics, first_epoch=10).mean, whole.mean[:, 10:])


class Pendulum:
    """A pendulum with white torque; state angle, rate."""

    dimension = 2
    linear = False

    def propagate(self, states, step):
        angle, rate = states[..., 0], states[..., 1]
        rate = rate - step.duration_s * np.sin(angle)
        return np.stack([angle + step.duration_s * rate, rate], axis=-1)

    def transition(self, mean, step):
        F = np.zeros((len(mean), 2, 2))
        F[:, 1, 0] = -step.duration_s * np.cos(mean[:, 0])
        F[:, 1, 1] = 1.0
        F[:, 0] = [1.0, 0.0] + step.duration_s * F[:, 1]
        return F

    def process_noise(self, states, step):
        return np.diag([1e-8, 1e-4])


def test_nonlinear_dynamics_smoothed_errors_are_smaller_and_consistent():
    rng = np.random.default_rng(2)
    dynamics, step_s, runs, epochs = Pendulum(), 0.1, 100, 200
    x = np.tile([1.0, 0.0], (runs, 1)) + 0.1 * rng.normal(size=(runs, 2))
    mean0, truth = np.tile([1.0, 0.0], (runs, 1)), np.empty((runs, epochs, 2))
    for k in range(epochs):
        x = dynamics.propagate(x, Step(k, step_s)) + rng.normal(size=(runs, 2)) * [1e-4, 1e-2]
        truth[:, k] = x
    z = truth[..., :1] + 0.05 * rng.normal(size=(runs, epochs, 1))
    z[:, 80:100] = np.nan
    f = create_filter("ekf", dynamics, LinearMeasurement([[1.0, 0.0]], [[0.0025]]))
    history = run_filter(f, z, mean0, 0.01 * np.eye(2), step_s=step_s)
    smoothed = smooth(history, dynamics, step_s=step_s)
    rms = [np.sqrt(np.square(h.mean - truth).mean(axis=(0, 1))) for h in (history, smoothed)]
    assert (rms[1] < 0.75 * rms[0]).all()
    error = smoothed.mean - truth
    nees = np.einsum("bti,btij,btj->bt", error, np.linalg.inv(smoothed.covariance), error).mean(axis=1)
    assert abs(nees.mean() - 2) < 4 * nees.std() / np.sqrt(runs) + 0.05


def test_bits_of_a_run_do_not_depend_on_its_block_and_a_lost_run_stays_alone():
    F, Q, H, R, z, mean0, P0 = problem()
    dynamics = LinearDynamics(F, Q)
    f = create_filter("kf", dynamics, LinearMeasurement(H, R))
    together = smooth(run_filter(f, z, mean0, P0), dynamics)
    for run in range(RUNS):
        alone = smooth(run_filter(f, z[run : run + 1], mean0[run : run + 1], P0), dynamics)
        assert np.array_equal(alone.mean[0], together.mean[run])
        assert np.array_equal(alone.covariance[0], together.covariance[run])
    history = run_filter(f, z, mean0, P0)
    history.mean[1, 10:], history.covariance[1, 10:] = np.nan, np.nan
    spoiled = smooth(history, dynamics)
    assert np.array_equal(spoiled.mean[[0, 2]], together.mean[[0, 2]])
    assert np.isnan(spoiled.mean[1]).all()


def test_shapes_that_do_not_fit_are_refused():
    F, Q, H, R, z, mean0, P0 = problem()
    history = run_filter(create_filter("kf", LinearDynamics(F, Q), LinearMeasurement(H, R)), z, mean0, P0)
    with pytest.raises(ValueError, match="2 states"):
        smooth(history, LinearDynamics(np.eye(2), np.eye(2)))
