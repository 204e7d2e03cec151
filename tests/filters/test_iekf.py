import numpy as np
import pytest
from scipy.optimize import minimize

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.streams import RandomSource

STILL = LinearDynamics(np.eye(3), np.zeros((3, 3)))
SIGMA = np.array([0.03, 3e-4, 3e-4])


def polar(states, epoch=0):
    x, y, z = states[..., 0], states[..., 1], states[..., 2]
    level = np.hypot(x, y)
    return np.stack([np.hypot(level, z), np.arctan2(y, x), np.arctan2(-z, level)], axis=-1)


def polar_radar(sigma=SIGMA):
    return FunctionMeasurement(polar, np.diag(sigma**2), angles=(1, 2))


def one_update(kind, measurement, mean, P, z, **options):
    f = create_filter(kind, STILL, measurement, **options)
    belief = f.start(Gaussian(mean, P), RandomSource(0, tuple(range(len(mean)))))
    return f.update(belief, z, Step(0))


def wide_prior(runs, sigma=SIGMA, seed=1):
    rng = np.random.default_rng(seed)
    truth = np.array([300.0, -371.0, -400.0]) + rng.normal(size=(runs, 3)) * 20
    P = np.diag([150.0, 100.0, 80.0]) @ np.diag([150.0, 100.0, 80.0]) + 2000.0
    mean = truth + rng.normal(size=(runs, 3)) @ np.linalg.cholesky(P).T
    z = polar(truth) + rng.normal(size=(runs, 3)) * sigma
    return truth, mean, np.tile(P, (runs, 1, 1)), z


def cost(x, mean, P, z, sigma):
    e = z - polar(x)
    e[1:] = np.arctan2(np.sin(e[1:]), np.cos(e[1:]))
    return (x - mean) @ np.linalg.solve(P, x - mean) + np.sum((e / sigma) ** 2)


def test_estimate_is_the_maximum_of_the_posterior():
    # Noise so wide that prior and measurement both matter.
    sigma = np.array([30.0, 0.1, 0.1])
    _, mean, P, z = wide_prior(10, sigma)
    posterior, _ = one_update("iekf", polar_radar(sigma), mean, P, z)
    for run in range(10):
        best = min(
            (
                minimize(cost, start, args=(mean[run], P[run], z[run], sigma), method="BFGS", options={"gtol": 1e-9})
                for start in (mean[run], posterior.mean[run])
            ),
            key=lambda result: result.fun,
        )
        assert cost(posterior.mean[run], mean[run], P[run], z[run], sigma) <= best.fun * (1 + 1e-9) + 1e-9
        deviations = np.abs(posterior.mean[run] - best.x) / np.sqrt(np.diag(posterior.covariance[run]))
        assert deviations.max() < 1e-3  # what the minimiser resolves


def test_covariance_is_that_of_the_linearisation_at_the_estimate():
    sigma = np.array([30.0, 0.1, 0.1])
    _, mean, P, z = wide_prior(5, sigma)
    measurement = polar_radar(sigma)
    posterior, _ = one_update("iekf", measurement, mean, P, z)
    H = measurement.jacobian(posterior.mean, 0)
    information = np.linalg.inv(P) + np.einsum("bmi,m,bmj->bij", H, sigma**-2, H)
    np.testing.assert_allclose(posterior.covariance, np.linalg.inv(information), rtol=1e-6, atol=1e-6)


def test_precise_measurement_and_a_prior_as_wide_as_the_range():
    truth, mean, P, z = wide_prior(200)
    found, innovation = one_update("iekf", polar_radar(), mean, P, z)
    extended, _ = one_update("ekf", polar_radar(), mean, P, z)
    error = np.linalg.norm(found.mean - truth, axis=1)
    # 630 m times 3e-4 rad, two angles: 0.27 m; the mean of 200 is known to a few per cent.
    assert error.mean() < 0.35
    assert error.max() < 1.5
    assert np.linalg.norm(extended.mean - truth, axis=1).mean() > 50 * error.mean()
    assert innovation.extras["iterations"].max() <= 12


def test_linear_measurement_gives_the_kalman_filter():
    rng = np.random.default_rng(3)
    F, Q = np.array([[1.0, 0.5], [0.0, 0.9]]), np.diag([0.1, 0.2])
    dynamics, measurement = LinearDynamics(F, Q), LinearMeasurement([[1.0, 0.3]], [[0.5]])
    z = rng.normal(size=(7, 30, 1))
    z[2, 5:9] = np.nan
    mean0, P0 = rng.normal(size=(7, 2)), np.diag([4.0, 1.0])
    kf, iekf = (run_filter(create_filter(name, dynamics, measurement), z, mean0, P0) for name in ("kf", "iekf"))
    np.testing.assert_allclose(iekf.mean, kf.mean, rtol=0, atol=1e-13)
    np.testing.assert_allclose(iekf.covariance, kf.covariance, rtol=1e-12, atol=0)
    np.testing.assert_allclose(iekf.nis, kf.nis, rtol=1e-12, equal_nan=True)
    np.testing.assert_allclose(iekf.log_likelihood, kf.log_likelihood, rtol=1e-12)


def test_line_search_saves_gauss_newton_where_full_steps_diverge():
    # Undamped Gauss-Newton on arctan(x) = 0 overshoots further each time from |x| > 1.39 (the classic example).
    measurement = FunctionMeasurement(lambda x, k: np.arctan(x), [[1e-4]])
    still = LinearDynamics([[1.0]], [[0.0]])
    f = create_filter("iekf", still, measurement, max_iterations=50)
    mean, P, z = np.array([[3.0], [-10.0]]), np.full((2, 1, 1), 1e6), np.zeros((2, 1))
    x = mean.copy()
    for _ in range(4):
        x = x - (1 + x**2) * np.arctan(x)
    assert np.abs(x).min() > 1e4
    posterior, _ = f.update(Gaussian(mean, P), z, Step(0))
    # Stationary: (x - m) / P + arctan(x) / (R (1 + x^2)) = 0.
    gradient = (posterior.mean - mean) / 1e6 + np.arctan(posterior.mean) / (1e-4 * (1 + posterior.mean**2))
    assert np.abs(posterior.mean).max() < 1e-6
    assert np.abs(gradient).max() < 1e-6


def test_search_never_ends_higher_than_the_prior_mean():
    sigma = np.array([1.0, 0.01, 0.01])
    _, mean, P, z = wide_prior(100, sigma, seed=8)
    posterior, _ = one_update("iekf", polar_radar(sigma), mean, P, z, max_iterations=2)
    for run in range(100):
        at = (mean[run], P[run], z[run], sigma)
        assert cost(posterior.mean[run], *at) <= cost(mean[run], *at) * (1 + 1e-8)


def test_state_known_exactly_stays():
    truth, mean, P, z = wide_prior(10)
    mean[:, 2] = truth[:, 2]
    P[:, 2, :] = P[:, :, 2] = 0.0
    posterior, _ = one_update("iekf", polar_radar(), mean, P, z)
    assert np.array_equal(posterior.mean[:, 2], mean[:, 2])
    assert np.linalg.norm(posterior.mean - truth, axis=1).max() < 1.5


def test_angles_across_the_cut():
    # The azimuth of the target is pi; readings come on both sides of the cut.
    truth = np.tile([-500.0, 0.0, 10.0], (2, 1))
    z = polar(truth)
    z[0, 1], z[1, 1] = np.pi - 1e-4, -np.pi + 1e-4
    mean = truth + np.array([[20.0, -30.0, 5.0], [20.0, 30.0, 5.0]])
    posterior, _ = one_update("iekf", polar_radar(), mean, np.tile(np.eye(3) * 900.0, (2, 1, 1)), z)
    np.testing.assert_allclose(posterior.mean[:, 1], [500 * 1e-4, -500 * 1e-4], atol=1e-3)


def test_bits_of_a_run_do_not_depend_on_its_block():
    _, mean, P, z = wide_prior(40)
    together, innovation = one_update("iekf", polar_radar(), mean, P, z)
    for run in (0, 17, 39):
        rows = slice(run, run + 1)
        alone, own = one_update("iekf", polar_radar(), mean[rows], P[rows], z[rows])
        assert np.array_equal(alone.mean[0], together.mean[run])
        assert np.array_equal(alone.covariance[0], together.covariance[run])
        assert own.extras["iterations"][0] == innovation.extras["iterations"][run]


def test_a_run_that_is_not_a_number_leaves_the_others_alone():
    _, mean, P, z = wide_prior(4)
    good, _ = one_update("iekf", polar_radar(), mean, P, z)
    mean[1] = np.nan
    with np.errstate(all="ignore"):
        mixed, _ = one_update("iekf", polar_radar(), mean, P, z)
    assert np.array_equal(mixed.mean[[0, 2, 3]], good.mean[[0, 2, 3]])
    assert np.isnan(mixed.mean[1]).all()


def test_gate_keeps_the_prediction():
    _, mean, P, z = wide_prior(2)
    z[1, 0] += 1e5
    posterior, innovation = one_update("iekf", polar_radar(), mean, P, z, gate_probability=0.999)
    assert innovation.extras["rejected"][1] == 1
    assert np.array_equal(posterior.mean[1], mean[1])


@pytest.mark.parametrize("options", [{"max_iterations": 0}, {"tolerance": 0.0}, {"iterations": 3}])
def test_options_out_of_range_are_refused(options):
    with pytest.raises(ValueError, match="iekf"):
        create_filter("iekf", STILL, polar_radar(), **options)
