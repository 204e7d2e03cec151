import numpy as np
import pytest

from relnav_sim import FunctionMeasurement, LinearDynamics, create_filter, run_filter

SIGMA = np.array([0.5, 2e-3])
F = np.kron(np.array([[1.0, 1.0], [0.0, 1.0]]), np.eye(2))
Q = np.kron(np.array([[0.25, 0.5], [0.5, 1.0]]) * 1e-6, np.eye(2)) + 1e-9 * np.eye(4)


def polar(states, epoch=0):
    x, y = states[..., 0], states[..., 1]
    return np.stack([np.hypot(x, y), np.arctan2(y, x)], axis=-1)


def polar_jacobian(states, epoch=0):
    x, y = states[..., 0], states[..., 1]
    squared = x**2 + y**2
    H = np.zeros((*states.shape[:-1], 2, 4))
    H[..., 0, 0], H[..., 0, 1] = x / np.sqrt(squared), y / np.sqrt(squared)
    H[..., 1, 0], H[..., 1, 1] = -y / squared, x / squared
    return H


def track(runs, epochs, factors, seed=1):
    """Return truth and measurements whose sigma is SIGMA times factors (epochs, 2)."""
    rng = np.random.default_rng(seed)
    x = np.tile([300.0, 200.0, -0.2, 0.3], (runs, 1))
    P0 = np.diag([25.0, 25.0, 0.01, 0.01])
    mean0 = x + rng.normal(size=(runs, 4)) @ np.sqrt(P0)
    truth = np.empty((runs, epochs, 4))
    for k in range(epochs):
        x = x @ F.T + rng.normal(size=(runs, 4)) @ np.linalg.cholesky(Q).T
        truth[:, k] = x
    z = polar(truth) + rng.normal(size=(runs, epochs, 2)) * SIGMA * factors
    return truth, z, mean0, P0


def measurement(noise=None, kind=FunctionMeasurement):
    return kind(polar, np.diag(SIGMA**2) if noise is None else noise, polar_jacobian, angles=(1,))


def step_at(epoch, epochs, factor):
    factors = np.ones((epochs, 2))
    factors[epoch:] = factor
    return factors


@pytest.mark.parametrize("channels", ["independent", pytest.param("joint", marks=pytest.mark.slow)])
def test_follows_a_threefold_step_of_sigma(channels):
    _, z, mean0, P0 = track(50, 400, step_at(200, 400, 3.0))
    f = create_filter("adaptive_two_step", LinearDynamics(F, Q), measurement(), channels=channels)
    history = run_filter(f, z, mean0, P0)
    for i in range(2):
        ratio = history.extras[f"noise_sigma_ratio_{i}"]
        assert abs(ratio[:, 199].mean() - 1) < 0.05
        assert abs(ratio[:, 399] / 3 - 1).mean() < 0.2
        # 50 runs of 7 % each: the mean is known to 1 %; 2 % of the old variance is still remembered.
        assert abs(ratio[:, 399].mean() / 3 - 1) < 0.05
        # A single run is off by 20 % about once in 200.
        assert (abs(ratio[:, 399] / 3 - 1) < 0.2).mean() > 0.95
    plain = run_filter(create_filter("two_step", LinearDynamics(F, Q), measurement()), z, mean0, P0)
    assert abs(history.nis[:, 350:].mean() - 2) < 0.2
    assert plain.nis[:, 350:].mean() > 12


def test_right_noise_costs_little():
    truth, z, mean0, P0 = track(100, 200, np.ones((200, 2)))
    rms = {}
    for name in ("two_step", "adaptive_two_step"):
        history = run_filter(create_filter(name, LinearDynamics(F, Q), measurement()), z, mean0, P0)
        rms[name] = np.sqrt(np.square(history.mean[:, 120:, :2] - truth[:, 120:, :2]).sum(-1).mean())
    assert rms["adaptive_two_step"] < 1.05 * rms["two_step"]


def test_wrong_noise_in_one_channel_is_found_in_that_channel():
    _, z, mean0, P0 = track(50, 300, np.array([1.0, 5.0]))
    history = run_filter(create_filter("adaptive_two_step", LinearDynamics(F, Q), measurement()), z, mean0, P0)
    assert history.extras["noise_sigma_ratio_0"][:, -1].mean() == pytest.approx(1.0, rel=0.05)
    assert history.extras["noise_sigma_ratio_1"][:, -1].mean() == pytest.approx(5.0, rel=0.05)


def test_estimate_stays_within_its_bounds():
    _, z, mean0, P0 = track(20, 150, np.array([0.01, 100.0]))
    history = run_filter(
        create_filter("adaptive_two_step", LinearDynamics(F, Q), measurement(), smallest=0.25, largest=16.0),
        z, mean0, P0,
    )  # fmt: skip
    ratios = np.stack([history.extras[f"noise_sigma_ratio_{i}"] for i in range(2)])
    assert ratios.min() >= 0.5 * (1 - 1e-12)
    assert ratios.max() <= 4.0 * (1 + 1e-12)
    np.testing.assert_allclose(ratios[1, :, -1], 4.0, rtol=1e-12)


def test_joint_estimate_finds_a_correlation():
    truth, _, mean0, P0 = track(50, 300, np.ones((300, 2)))
    rng = np.random.default_rng(6)
    C = np.array([[1.0, 0.8], [0.8, 1.0]])
    z = polar(truth) + (rng.normal(size=(50, 300, 2)) @ np.linalg.cholesky(C).T) * SIGMA
    f = create_filter("adaptive_two_step", LinearDynamics(F, Q), measurement(), channels="joint", forgetting=0.99)
    history = run_filter(f, z, mean0, P0)
    right = run_filter(
        create_filter("two_step", LinearDynamics(F, Q), measurement(C * np.outer(SIGMA, SIGMA))),
        z, mean0, P0,
    )  # fmt: skip
    assert history.log_likelihood[:, 200:].mean() == pytest.approx(right.log_likelihood[:, 200:].mean(), abs=0.05)


def test_noise_that_depends_on_the_state_keeps_its_shape():
    class Ranging(FunctionMeasurement):
        def noise(self, mean, epoch):
            scale = np.linalg.norm(mean[:, :2], axis=1) / 360.0
            return np.square(scale)[:, None, None] * super().noise(mean, epoch)

    truth, _, mean0, P0 = track(50, 250, np.ones((250, 2)))
    distance = np.linalg.norm(truth[..., :2], axis=-1, keepdims=True)
    z = polar(truth) + np.random.default_rng(7).normal(size=truth[..., :2].shape) * SIGMA * 2 * distance / 360.0
    history = run_filter(
        create_filter("adaptive_two_step", LinearDynamics(F, Q), measurement(kind=Ranging)),
        z, mean0, P0,
    )  # fmt: skip
    for i in range(2):
        assert history.extras[f"noise_sigma_ratio_{i}"][:, -1].mean() == pytest.approx(2.0, rel=0.05)


def test_missing_measurements_leave_the_estimate():
    _, z, mean0, P0 = track(3, 100, np.ones((100, 2)))
    gap = z.copy()
    gap[1, 50:60] = np.nan
    f = create_filter("adaptive_two_step", LinearDynamics(F, Q), measurement())
    whole, holed = run_filter(f, z, mean0, P0), run_filter(f, gap, mean0, P0)
    assert np.array_equal(whole.mean[[0, 2]], holed.mean[[0, 2]])
    ratio = holed.extras["noise_sigma_ratio_0"][1]
    assert np.isnan(ratio[50:60]).all()
    assert abs(ratio[60] - ratio[49]) < 0.15


def test_bits_of_a_run_do_not_depend_on_its_block():
    _, z, mean0, P0 = track(20, 30, np.ones((30, 2)))
    f = create_filter("adaptive_two_step", LinearDynamics(F, Q), measurement(), channels="joint")
    together = run_filter(f, z, mean0, P0)
    for run in (0, 19):
        alone = run_filter(f, z[run : run + 1], mean0[run : run + 1], P0)
        assert np.array_equal(alone.mean[0], together.mean[run])
        assert np.array_equal(alone.extras["noise_sigma_ratio_1"][0], together.extras["noise_sigma_ratio_1"][run])
