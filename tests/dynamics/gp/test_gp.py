from dataclasses import replace

import numpy as np
import pytest
from formation_flight import (
    CW,
    ORBIT,
    STEP_S,
    STEPS_PER_REVOLUTION,
    F,
    flight,
    learned,
    position_and_velocity_rms,
    training_rows,
)
from pydantic import ValidationError
from scipy.linalg import solve_triangular
from taking_turns import taking_turns

from relnav_sim import LinearDynamics
from relnav_sim.dynamics.context import DynamicsContext, TrainingTrack
from relnav_sim.dynamics.elliptic import YamanakaAnkersenOptions
from relnav_sim.dynamics.gp.dynamics import PhaseClock, phase_clock
from relnav_sim.dynamics.gp.fit import Transitions, fit_gp_dynamics
from relnav_sim.dynamics.gp.options import GpOptions
from relnav_sim.dynamics.gp.process import GaussianProcess, Kernel, condition, most_informative
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options

STEP = Step(1, STEP_S)
SECOND = slice(STEPS_PER_REVOLUTION, 2 * STEPS_PER_REVOLUTION)
THIRD = slice(2 * STEPS_PER_REVOLUTION, 3 * STEPS_PER_REVOLUTION)


def sklearn_regressor(kernel, inputs, outputs):
    """Return scikit-learn's process with the same kernel and data, in standardised outputs and inputs in lengths."""
    from sklearn.gaussian_process import GaussianProcessRegressor  # here: few tests need it, for 0.4 s
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    same = ConstantKernel(kernel.signal_variance) * (RBF(np.ones(len(kernel.length))) + WhiteKernel(kernel.noise_ratio))
    regressor = GaussianProcessRegressor(same, alpha=0.0, optimizer=None)
    return regressor.fit(kernel.scaled(inputs), (outputs - kernel.output_mean) / kernel.output_scale)


def off_the_curve(rows, spread=0.05):
    x = flight()
    return x[rows] + spread * x[rows].std(axis=0) * np.random.default_rng(1).standard_normal((len(rows), 6))


def test_mean_and_variance_equal_those_of_scikit_learn():
    rng = np.random.default_rng(0)
    inputs, points = rng.normal(3.0, 5.0, (120, 4)), rng.normal(3.0, 5.0, (2, 40, 4))
    outputs = np.stack([np.sin(inputs[:, 0]), inputs[:, 1] * inputs[:, 2], inputs[:, 3]], axis=1)
    kernel = Kernel(
        inputs.mean(axis=0), np.array([4.0, 9.0, 7.0, 30.0]), outputs.mean(axis=0), outputs.std(axis=0), 2.5, 1e-4
    )
    mean, deviation = sklearn_regressor(kernel, inputs, outputs).predict(
        kernel.scaled(points.reshape(80, 4)), return_std=True
    )
    process = condition(kernel, inputs, outputs)
    predicted, variance = process.predict_with_variance(points)
    expected = mean.reshape(2, 40, 3) * kernel.output_scale + kernel.output_mean
    np.testing.assert_allclose(predicted, expected, rtol=0, atol=1e-8)
    np.testing.assert_allclose(variance, np.square(deviation[:, 0]).reshape(2, 40), rtol=0, atol=1e-8)
    np.testing.assert_array_equal(process.predict(points), predicted)
    np.testing.assert_array_equal(process.variance(points), variance)


@pytest.mark.parametrize("target", ["absolute", "difference", "residual"])
def test_prediction_equals_scikit_learn_with_the_fitted_kernels(target):
    """With noise 1e-10 of the signal the training solve itself has 1e-6 of rounding, in both libraries alike.

    So the prediction is compared from scikit-learn's own weights and factor.
    """
    x, rows = flight(), training_rows("random")
    kernel = learned(target).process.kernel
    outputs = x[rows + 1] - {"absolute": 0 * x[rows], "difference": x[rows], "residual": x[rows] @ F.T}[target]
    regressor = sklearn_regressor(kernel, x[rows], outputs)
    root = np.sqrt(kernel.signal_variance)
    same = GaussianProcess(
        kernel,
        kernel.scaled(x[rows]),
        np.ascontiguousarray(regressor.alpha_ * kernel.signal_variance),
        np.ascontiguousarray(solve_triangular(regressor.L_ / root, np.eye(len(rows)), lower=True)),
    )
    for points in (x[SECOND], off_the_curve(rows)):
        mean, deviation = regressor.predict(kernel.scaled(points), return_std=True)
        predicted, variance = same.predict_with_variance(points[None])
        standardised = (predicted[0] - kernel.output_mean) / kernel.output_scale
        assert np.abs(standardised - mean).max() < 1e-8
        assert np.abs(variance[0] - np.square(deviation[:, 0])).max() < 1e-8 * kernel.signal_variance


# RMS errors of one step, m and m/s, on the 500 steps after the training data or on the next revolution.
ONE_STEP = {
    ("consecutive", "absolute"): (1.2, 1.8e-3),
    ("consecutive", "difference"): (1.6e-2, 3.6e-5),
    ("consecutive", "residual"): (1.6e-6, 3.3e-7),
    ("random", "absolute"): (0.54, 8.8e-4),
    ("random", "difference"): (7e-3, 1.4e-5),
    ("random", "residual"): (8.6e-7, 1.8e-7),
}


@pytest.mark.parametrize(
    ("target", "selection"), taking_turns([("absolute",), ("difference",), ("residual",)], ["consecutive", "random"])
)
def test_one_step_errors(selection, target):
    """An independent implementation (own gradients, 60 iterations) had these errors on this orbit.

    Of the twelve the velocity of the absolute target from random points is worst, 1.99 times that.
    """
    x = flight()
    allowed = 2.1 if (selection, target) == ("random", "absolute") else 2.0
    test = slice(500, 1000) if selection == "consecutive" else SECOND
    error = x[1:][test] - learned(target, selection).propagate(x[:-1][test][None], STEP)[0]
    for found, expected in zip(position_and_velocity_rms(error), ONE_STEP[selection, target], strict=True):
        assert found < allowed * expected


def test_clohessy_wiltshire_alone_lies_between_the_absolute_and_the_residual_process():
    x = flight()
    position, velocity = position_and_velocity_rms(x[1:][SECOND] - x[:-1][SECOND] @ F.T)
    assert position == pytest.approx(1.75e-4, rel=0.02)
    assert velocity == pytest.approx(3.5e-5, rel=0.02)


@pytest.mark.parametrize(
    ("target", "selection"), taking_turns([("absolute",), ("difference",), ("residual",)], ["consecutive", "random"])
)
def test_variance_calibrated_on_the_second_revolution_holds_on_the_third(target, selection):
    x = flight()

    def consistency(dynamics):
        error = x[1:][THIRD] - dynamics.propagate(x[:-1][THIRD][None], STEP)[0]
        return (np.square(error) / np.einsum("bii->bi", dynamics.process_noise(x[:-1][THIRD][None], STEP)[0])).mean(0)

    calibrated = consistency(learned(target, selection, calibrate=True))
    assert calibrated.max() < 1.5
    if target != "residual":
        # Calibrated on the end of its own training data, it is two to twenty times too sure of some state.
        assert consistency(learned(target, selection)).max() > 4
    assert (learned(target, selection, calibrate=True).calibration >= 1).all()


@pytest.mark.parametrize("target", ["absolute", "difference", "residual"])
def test_jacobian(target):
    dynamics = learned(target)
    at = flight()[[3, 200]]
    # Wide: rounding is 5e-10 of the outputs' size, as weights of 5e5 make it.
    width = 1e-3 * flight().std(axis=0)
    columns = []
    for j in range(6):
        ahead, behind = at.copy(), at.copy()
        ahead[:, j] += width[j]
        behind[:, j] -= width[j]
        columns.append((dynamics.propagate(ahead, STEP) - dynamics.propagate(behind, STEP)) / (2 * width[j]))
    numerical = np.stack(columns, axis=-1)
    analytic = dynamics.transition(at, STEP)
    assert np.abs(analytic - numerical).max() < 1e-5 * np.abs(analytic).max()


def test_off_the_training_orbit_the_residual_falls_back_to_the_base_dynamics():
    far = flight()[:1] + np.array([0.0, 0.0, 3000.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(learned().transition(far, STEP), CW.transition(far, STEP)[None], atol=2e-3)
    np.testing.assert_allclose(learned().propagate(far, STEP), CW.propagate(far, STEP), atol=1e-2)


def test_bits_do_not_depend_on_the_block_nor_on_what_was_asked_before():
    dynamics = learned()
    for shape in ((5,), (5, 13), (5, 301)):
        states = flight()[10] + np.random.default_rng(0).standard_normal((*shape, 6))
        noise, after_noise = dynamics.process_noise(states, STEP), dynamics.propagate(states, STEP)
        for run in range(5):
            alone = states[run : run + 1]
            np.testing.assert_array_equal(dynamics.propagate(alone, STEP), after_noise[run : run + 1])
            np.testing.assert_array_equal(dynamics.process_noise(alone, STEP), noise[run : run + 1])
        states += 1
        assert not np.array_equal(dynamics.propagate(states, STEP), after_noise)


def test_variance_options():
    states = off_the_curve(training_rows("random"), 0.02)[None]
    exact = learned().process_noise(states, STEP)
    assert exact.shape == (1, 500, 6, 6)
    inducing = learned(variance="inducing").process_noise(states, STEP)
    assert inducing.shape == exact.shape
    # Given fewer data the variance cannot be smaller, but for rounding.
    assert (inducing[..., 0, 0] > 0.999 * exact[..., 0, 0]).all()
    once = learned(variance="cloud_mean").process_noise(states, STEP)
    at_mean = learned().process_noise(states.mean(axis=1), STEP)
    np.testing.assert_allclose(once, at_mean, rtol=1e-6)
    np.testing.assert_array_equal(
        learned(variance="cloud_mean").propagate(states, STEP), learned().propagate(states, STEP)
    )


def test_most_informative_points_are_the_greedy_choice():
    rng = np.random.default_rng(0)
    inputs = rng.standard_normal((40, 2))
    kernel = Kernel(np.zeros(2), np.ones(2), np.zeros(1), np.ones(1), 1.0, 1e-11)
    chosen = list(most_informative(kernel, inputs, 6))
    C = kernel.correlation(inputs)
    for k in range(1, 6):
        known = chosen[:k]
        left = 1 - np.einsum("is,is->i", C[:, known], np.linalg.solve(C[np.ix_(known, known)], C[known]).T)
        assert chosen[k] == np.argmax(left)


def test_phase_inputs_carry_over_to_another_relative_orbit():
    steps = 729
    orbits = [flight(*shape, steps) for shape in ((1.0, 1.0), (1.2, 0.8), (0.8, 1.2))]
    now = np.concatenate([orbit[:-1] for orbit in orbits])
    next = np.concatenate([orbit[1:] for orbit in orbits])
    clock = phase_clock(ORBIT, STEP_S)
    phase = np.tile(clock.initial_rad + clock.rate_rad * np.arange(steps), 3)
    rows = np.sort(np.random.default_rng(0).choice(len(now), 500, replace=False))
    plain = fit_gp_dynamics(now[rows], next[rows], STEP_S, CW, restarts=0)
    phased = fit_gp_dynamics(now[rows], next[rows], STEP_S, CW, phase_rad=phase[rows], phase=clock, restarts=0)
    other = flight(1.1, 0.9, steps)
    errors = []
    for dynamics in (plain, phased):
        predicted = [dynamics.propagate(other[k : k + 1], Step(k + 1, STEP_S))[0] for k in range(0, steps, 9)]
        errors.append(position_and_velocity_rms(other[1::9] - np.array(predicted))[0])
    assert errors[1] < errors[0] / 4
    assert phased.transition(other[:2], STEP).shape == (2, 6, 6)


def test_phase_clock_counts_from_the_step_before_and_follows_the_true_orbit():
    assert PhaseClock(0.5, 0.1)(1) == 0.5
    assert PhaseClock(0.5, 0.1)(3) == pytest.approx(0.7)
    # Under J2 at 30 degrees the node is reached again 0.27 % sooner than after a Kepler period.
    assert phase_clock(ORBIT, STEP_S).rate_rad / (ORBIT.mean_motion_rad_s * STEP_S) == pytest.approx(1.0027, abs=1e-4)


def test_residual_without_base_is_taken_from_straight_motion():
    x, rows = flight(), training_rows("random")[::10]
    straight = np.eye(6) + STEP_S * np.eye(6, k=3)
    default = fit_gp_dynamics(x[rows], x[rows + 1], STEP_S, restarts=0)
    given = fit_gp_dynamics(x[rows], x[rows + 1], STEP_S, LinearDynamics(straight, np.zeros((6, 6))), restarts=0)
    np.testing.assert_array_equal(default.propagate(x[:3], STEP), given.propagate(x[:3], STEP))


def test_noise_of_the_training_data_becomes_process_noise():
    rng = np.random.default_rng(0)
    now = rng.normal(0.0, 2.0, (300, 2))
    next = now @ np.array([[1.0, 0.5], [0.0, 1.0]]).T + np.array([0.3, 0.1]) * rng.standard_normal((300, 2))
    dynamics = fit_gp_dynamics(now, next, 0.5, restarts=0)
    deviation = np.sqrt(np.einsum("bii->bi", dynamics.process_noise(now[:5], STEP)))
    np.testing.assert_allclose(deviation, np.broadcast_to([0.3, 0.1], (5, 2)), rtol=0.25)


def test_added_noise():
    x, rows = flight(), training_rows("random")[::10]
    added = np.diag([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4])
    plain = fit_gp_dynamics(x[rows], x[rows + 1], STEP_S, CW, restarts=0)
    noisy = fit_gp_dynamics(x[rows], x[rows + 1], STEP_S, CW, restarts=0, added_noise=added)
    np.testing.assert_allclose(noisy.process_noise(x[:2], STEP) - plain.process_noise(x[:2], STEP), [added] * 2)


def test_wrong_data_are_refused():
    x = flight()[:60]
    with pytest.raises(ValueError, match="shapes"):
        fit_gp_dynamics(x[:-1], x[2:], STEP_S)
    with pytest.raises(ValueError, match="finite"):
        fit_gp_dynamics(np.where(x[:-1] == x[0], np.nan, x[:-1]), x[1:], STEP_S)
    with pytest.raises(ValueError, match="no use for base"):
        fit_gp_dynamics(x[:-1], x[1:], STEP_S, CW, "absolute")
    with pytest.raises(ValueError, match="base"):
        fit_gp_dynamics(x[:-1, :5], x[1:, :5], STEP_S)
    with pytest.raises(ValueError, match="together"):
        fit_gp_dynamics(x[:-1], x[1:], STEP_S, phase_rad=np.zeros(59))
    with pytest.raises(ValueError, match="added_noise"):
        fit_gp_dynamics(x[:-1], x[1:], STEP_S, added_noise=np.eye(3))
    with pytest.raises(ValueError, match="held-out"):
        fit_gp_dynamics(x[:-1], x[1:], STEP_S, held_out=Transitions(x[:5], x[1:6]))


def test_campaign_options():
    x = flight()
    track = TrainingTrack(x[: 2 * STEPS_PER_REVOLUTION], STEP_S * np.arange(-2.0 * STEPS_PER_REVOLUTION, 0), ORBIT)
    noise = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-9)
    options = GpOptions(restarts=0)
    context = DynamicsContext(ORBIT, noise, STEP_S, learn=lambda fit: fit(track))
    dynamics = options.build(context)
    assert len(dynamics.process.inputs) == 500
    error = x[1:][THIRD] - dynamics.propagate(x[:-1][THIRD][None], STEP)[0]
    assert position_and_velocity_rms(error)[0] < 2e-6
    first = GpOptions(restarts=0, selection="consecutive", training_points=60, argument_of_latitude=True)
    assert first.build(context).process.inputs.shape == (60, 8)
    noisy = GpOptions(restarts=0, training_points=60, add_process_noise=True).build(context)
    assert noisy.process_noise(x[:1], STEP)[0, 3, 3] > 9e-9
    with pytest.raises(ValueError, match="training track"):
        options.build(DynamicsContext(ORBIT, noise, STEP_S))
    with pytest.raises(ValidationError, match="residual target"):
        GpOptions.model_validate({"target": "absolute", "base": {"kind": "cw"}})


def test_the_latest_span_is_learned_and_the_one_before_calibrates():
    track = TrainingTrack(flight()[:101], STEP_S * np.arange(-100.0, 1.0), ORBIT)
    noise = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-9)
    options = GpOptions(restarts=0, training_points=50, training_span_s=500.0)
    process = options.build(DynamicsContext(ORBIT, noise, STEP_S, learn=lambda fit: fit(track))).process
    np.testing.assert_allclose(process.inputs, process.kernel.scaled(flight()[50:100]), atol=1e-12)
    assert options.training_request(ORBIT).duration_s == 1000.0
    period = 2 * np.pi / ORBIT.mean_motion_rad_s
    assert GpOptions(calibration_span_s=0.0).training_request(ORBIT).duration_s == pytest.approx(period)


@pytest.mark.parametrize("base", [NonlinearJ2Options(), YamanakaAnkersenOptions()])
def test_a_base_that_depends_on_the_epoch_is_taken_at_each_row_s_own(base):
    """Under J2 the exact dynamics leave nothing over; an elliptic one at the wrong epoch leaves much."""
    noise = ProcessNoiseOptions(acceleration_psd_m2_s3=1e-9)
    orbit = ORBIT if isinstance(base, NonlinearJ2Options) else replace(ORBIT, eccentricity=0.1)
    dynamics = base.build(DynamicsContext(orbit, noise, STEP_S))
    states = [flight()[0]]
    for epoch in range(1, 200):
        states.append(dynamics.propagate(states[-1][None], Step(epoch, STEP_S))[0])
    first = 40
    track = TrainingTrack(np.array(states[first:]), STEP_S * np.arange(first - 200.0, 0), orbit, first)
    leftover = track.expected(base, noise, STEP_S) - track.states[1:]
    assert np.abs(leftover).max() < 1e-9
    learned = GpOptions(base=base, restarts=0, training_points=60, calibration_span_s=0.0)
    built = learned.build(DynamicsContext(orbit, noise, STEP_S, learn=lambda fit: fit(track)))
    np.testing.assert_allclose(built.propagate(track.states[:1], Step(first + 1, STEP_S))[0], states[first + 1])


def test_expected_states_belong_to_a_base():
    x = flight()[:60]
    with pytest.raises(ValueError, match="give those too"):
        fit_gp_dynamics(x[:-1], x[1:], STEP_S, target="difference", expected=x[1:])
    with pytest.raises(ValueError, match="expected ones"):
        fit_gp_dynamics(x[:-1], x[1:], STEP_S, CW, expected=x[:5])
    with pytest.raises(ValueError, match="go together"):
        fit_gp_dynamics(x[:-1], x[1:], STEP_S, CW, expected=x[1:], held_out=Transitions(x[:-1], x[1:]))


@pytest.mark.parametrize("target", ["difference", pytest.param("absolute", marks=pytest.mark.slow)])
@pytest.mark.parametrize("constant", [0.1, *(pytest.param(c, marks=pytest.mark.slow) for c in (14.62, -7e6 / 3))])
def test_a_column_constant_up_to_rounding_is_constant(constant, target):
    """Its standard deviation is some 1e-17 by rounding; a query 1e-9 beside it is no 1e7 length scales away."""

    def after(x):
        return np.stack([x[:, 0] + 0.1 * x[:, 1], x[:, 1] - 0.1 * np.sin(x[:, 0]), x[:, 2]], axis=-1)

    rng = np.random.default_rng(0)
    inside, queries = rng.uniform(-1, 1, (60, 2)), rng.uniform(-0.8, 0.8, (20, 2))

    def predicted(value, shift):
        now = np.column_stack([inside, np.full(60, value)])
        query = np.column_stack([queries, np.full(20, value + shift)])
        dynamics = fit_gp_dynamics(now, after(now), 1.0, target=target, restarts=0)
        return dynamics.propagate(query[None], Step(0))[0, :, :2]

    truth = after(np.column_stack([queries, np.zeros(20)]))[:, :2]
    shift = 1e-9 * max(1.0, abs(constant))
    found = predicted(constant, shift)
    assert np.abs(found - truth).max() < 1e-4
    np.testing.assert_allclose(found, predicted(0.0, 0.0), rtol=0, atol=1e-6)
