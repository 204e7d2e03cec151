"""Processes fitted as Wei, Song and Zhang (2012) print them, against their equations and scikit-learn."""

import numpy as np
import pytest
from formation_flight import ORBIT
from pydantic import ValidationError

from relnav_sim.dynamics.gp.dynamics import GpDynamics
from relnav_sim.dynamics.gp.fit import Transitions, fit_gp_dynamics
from relnav_sim.dynamics.gp.options import GpOptions
from relnav_sim.dynamics.gp.regression import RegressionOptions
from relnav_sim.dynamics.interface import Step

STEP = Step(1, 1.0)
PRINTED = {
    "processes": "one_per_output",
    "length_scales": "common",
    "standardised": False,
    "fitted_points": 500,
    "calibrated": False,
    "noise_counted": False,
}


@pytest.fixture(scope="module")
def rows():
    """Two states of like size that turn each other, with noise of different size."""
    rng = np.random.default_rng(0)
    x, v = now = rng.uniform(-1, 1, (2, 90)) * [[300.0], [200.0]]
    next = np.array([x + 60 * np.sin(v / 80), v - 40 * np.sin(x / 100)]) + rng.standard_normal((2, 90)) * [[3.0], [1.0]]
    return now.T, next.T


@pytest.fixture(scope="module")
def printed(rows):
    return fit_gp_dynamics(*rows, 1.0, target="absolute", restarts=0, regression=PRINTED)


def parameters(process):
    """Return sigma_f^2, l (a squared length) and sigma_n^2 in the units of the states."""
    kernel = process.kernel
    assert np.ptp(kernel.length) == 0
    signal = kernel.signal_variance * kernel.output_scale[0] ** 2
    return signal, kernel.length[0] ** 2, signal * kernel.noise_ratio


def covariance(a, b, signal, squared_length):
    """Eq. 15."""
    offset = a[:, None] - b
    return signal * np.exp(-np.einsum("ijk,ijk->ij", offset, offset) / (2 * squared_length))


def log_likelihood(x, y, signal, squared_length, noise):
    """Eq. 20, of S rows."""
    K = covariance(x, x, signal, squared_length) + noise * np.eye(len(x))
    return -y @ np.linalg.solve(K, y) / 2 - np.linalg.slogdet(K)[1] / 2 - len(x) * np.log(2 * np.pi) / 2


def test_prediction_is_that_of_equations_13_and_14(rows, printed):
    (x, Y), points = rows, np.random.default_rng(1).uniform(-1, 1, (40, 2)) * [300.0, 200.0]
    mean, Q = printed.propagate(points[None], STEP)[0], printed.process_noise(points[None], STEP)[0]
    assert Q.shape == (40, 2, 2)
    for j, process in enumerate(printed.process.processes):
        signal, squared_length, noise = parameters(process)
        K = covariance(x, x, signal, squared_length) + noise * np.eye(len(x))
        k = covariance(points, x, signal, squared_length)
        np.testing.assert_allclose(
            mean[:, j], k @ np.linalg.solve(K, Y[:, j]), rtol=0, atol=1e-7 * np.abs(Y[:, j]).max()
        )
        variance = signal - np.einsum("ps,sp->p", k, np.linalg.solve(K, k.T))
        np.testing.assert_allclose(Q[:, j, j], variance, rtol=1e-6, atol=1e-9 * signal)
    assert not Q[:, 0, 1].any()


def test_each_output_has_the_parameters_of_greatest_likelihood(rows, printed):
    """None of the three changes by 2 % for the better, and scikit-learn finds no better ones in the states' units."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # here: few tests need it, for 0.4 s
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    x, Y = rows
    found = []
    for j, process in enumerate(printed.process.processes):
        best = np.array(parameters(process))
        here = log_likelihood(x, Y[:, j], *best)
        for i in range(3):
            for factor in (0.98, 1.02):
                assert log_likelihood(x, Y[:, j], *(best * np.where(np.arange(3) == i, factor, 1))) < here
        start = ConstantKernel(1e4, (1e-6, 1e10)) * RBF(200.0, (1.0, 1e5)) + WhiteKernel(1.0, (1e-8, 1e4))
        regressor = GaussianProcessRegressor(start, alpha=0.0, random_state=1).fit(x, Y[:, j])
        assert here > regressor.log_marginal_likelihood_value_ - 1e-3
        found.append(best)
    assert found[0][1] != found[1][1]


def test_jacobian_is_the_derivative_of_the_means(rows, printed):
    at = rows[0][:5]
    F = printed.transition(at, STEP)
    assert F.shape == (5, 2, 2)
    for j, width in enumerate((0.03, 0.03)):
        offset = width * np.eye(2)[j]
        difference = printed.propagate(at + offset, STEP) - printed.propagate(at - offset, STEP)
        np.testing.assert_allclose(
            F[:, :, j], difference / (2 * width), rtol=1e-4, atol=1e-6 * np.abs(F[:, :, j]).max()
        )


def test_each_switch_does_what_it_says(rows):
    rows = tuple(part[:40] for part in rows)
    # Rows with ten times the noise, for which the variance has to be larger.
    far = Transitions(rows[0], rows[1] + 10 * np.random.default_rng(3).standard_normal((40, 2)) * [3.0, 1.0])
    given = {"target": "absolute", "restarts": 0, "held_out": far}

    def fitted(**options):
        return fit_gp_dynamics(*rows, 1.0, **given, regression=options)

    at, plain = rows[0][:3], fit_gp_dynamics(*rows, 1.0, **given)
    np.testing.assert_array_equal(fitted().process_noise(at, STEP), plain.process_noise(at, STEP))
    np.testing.assert_array_equal(fitted().propagate(at, STEP), plain.propagate(at, STEP))
    own = fitted(calibrated=False)
    assert (plain.calibration > 1).all() and (own.calibration == 1).all()
    np.testing.assert_allclose(
        plain.process_noise(at, STEP), own.process_noise(at, STEP) * np.diag(plain.calibration**2)
    )
    kernel = own.process.kernel
    noise = kernel.signal_variance * kernel.noise_ratio * np.diag(kernel.output_scale**2)
    without = fitted(calibrated=False, noise_counted=False)
    np.testing.assert_allclose(own.process_noise(at, STEP) - without.process_noise(at, STEP), [noise] * 3, rtol=1e-9)
    spread = rows[0].std(axis=0)
    half = fitted(fitted_points=20).process.kernel
    assert (half.length != kernel.length).all()
    assert np.ptp(fitted(length_scales="common", fitted_points=20).process.kernel.length / spread) < 1e-12
    assert np.ptp(half.length / spread) > 0.1
    raw = fitted(standardised=False, fitted_points=20).process.kernel
    assert not raw.output_mean.any() and np.ptp(raw.output_scale) == 0


def test_bits_of_a_run_do_not_depend_on_the_block(rows, printed):
    states = rows[0].reshape(5, 18, 2)
    noise, after = printed.process_noise(states, STEP), printed.propagate(states, STEP)
    for run in range(5):
        np.testing.assert_array_equal(printed.propagate(states[[run]], STEP), after[[run]])
        np.testing.assert_array_equal(printed.process_noise(states[[run]], STEP), noise[[run]])


def test_a_variance_once_a_run_has_one_number_for_each_output(rows, printed):
    states = rows[0].reshape(5, 18, 2)
    once = GpDynamics(printed.process, None, printed.calibration, "cloud_mean")
    np.testing.assert_array_equal(once.process_noise(states, STEP), printed.process_noise(states.mean(axis=1), STEP))


def test_what_does_not_fit_together_is_refused(rows):
    with pytest.raises(ValueError, match="inducing"):
        fit_gp_dynamics(
            rows[0][:12], rows[1][:12], 1.0, target="absolute", restarts=0, regression=PRINTED, variance="inducing"
        )
    with pytest.raises(ValueError, match="no_such_key"):
        fit_gp_dynamics(*rows, 1.0, regression={"no_such_key": 1})
    separate = {"processes": "one_per_output"}
    with pytest.raises(ValidationError, match="exact or cloud_mean"):
        GpOptions.model_validate({"variance": "inducing", "regression": separate})
    with pytest.raises(ValidationError, match="calibration_span_s has no use"):
        GpOptions.model_validate({"calibration_span_s": 100.0, "regression": {"calibrated": False}})


def test_without_calibration_only_the_span_that_is_learned_is_flown():
    both = GpOptions().training_request(ORBIT).duration_s
    learned = GpOptions(regression=RegressionOptions(calibrated=False)).training_request(ORBIT).duration_s
    assert learned == pytest.approx(both / 2)
