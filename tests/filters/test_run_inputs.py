"""What can't be right is refused by name, before anything is filtered."""

import re
import warnings

import numpy as np
import pytest

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, MixtureNoise, create_filter, run_filter
from relnav_sim.measurements.interface import MeasurementDefaults

F, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.array([[1 / 3, 0.5], [0.5, 1.0]])
Z = np.random.default_rng(1).normal(5, 1, (3, 20, 1))
CROOKED = [[100.0, 50.0], [0.0, 100.0]]
INDEFINITE = [[1.0, 2.0], [2.0, 1.0]]


def run(z=Z, mean0=(0.0, 0.0), cov0=None, H=((1.0, 0.0),), R=((1.0,),), **given):
    filter = create_filter("kf", LinearDynamics(F, Q), LinearMeasurement(H, R))
    return run_filter(filter, z, mean0, 100 * np.eye(2) if cov0 is None else cov0, **given)


def changed(array, place, value):
    array = np.array(array)
    array[place] = value
    return array


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"cov0": 100.0}, r"cov0 has shape (); it must be (2, 2) or (3, 2, 2); numpy.diag"),
        ({"cov0": [100.0, 1.0]}, "cov0 has shape (2,)"),
        ({"cov0": [[100.0], [1.0]]}, "cov0 has shape (2, 1)"),
        ({"cov0": np.ones((3, 2))}, "cov0 has shape (3, 2)"),
        ({"cov0": np.eye(3)}, "cov0 has shape (3, 3); for 3 runs of 2 states it must be (2, 2) or (3, 2, 2)"),
        ({"cov0": np.broadcast_to(np.eye(2), (1, 2, 2))}, "cov0 has shape (1, 2, 2)"),
        ({"cov0": INDEFINITE}, "cov0 is no covariance: a correlation in it exceeds 1"),
        ({"cov0": CROOKED}, "cov0 is no covariance: it is not symmetric"),
        ({"cov0": np.diag([1.0, -1e-12])}, "cov0 is no covariance: the variance in row 1 is negative"),
        ({"cov0": np.stack([np.eye(2), np.eye(2), INDEFINITE])}, "cov0 of run 2 is no covariance"),
        ({"cov0": np.full((2, 2), 1e308)}, "cov0 is no covariance: an entry exceeds 8.98847e+307"),
        ({"cov0": np.diag([1.0, np.nan])}, "cov0 is NaN at row 1, column 1"),
        ({"cov0": np.diag([np.inf, 1.0])}, "cov0 is infinite at row 0, column 0"),
        ({"cov0": 1j * np.eye(2)}, "cov0 holds complex numbers"),
        ({"cov0": np.ma.masked_less(np.eye(2), 0.5)}, "cov0 has masked entries"),
        ({"mean0": 0.0}, "mean0 has shape ()"),
        ({"mean0": [[3.0], [4.0], [5.0]]}, "mean0 has shape (3, 1); for 3 runs of 2 states it must be (2,) or (3, 2)"),
        ({"mean0": [[0.0, 0.0]]}, "mean0 has shape (1, 2)"),
        ({"mean0": [0.0, np.nan]}, "mean0 is NaN at state 1"),
        ({"mean0": ["0", "0"]}, "mean0 holds text"),
        ({"mean0": [0.0, None]}, "mean0 holds objects"),
        ({"mean0": [[0.0, 0.0], [0.0]]}, "mean0 is no array"),
        ({"mean0": np.ma.masked_array([0.0, 7.0], [False, True])}, "mean0 has masked entries"),
        ({"z": Z[0]}, "z has shape (20, 1)"),
        ({"z": np.repeat(Z, 2, axis=2)}, "z has 2 components, the measurement 1"),
        ({"z": changed(Z, (1, 3, 0), np.inf)}, "z is infinite at run 1, epoch 3, channel 0"),
        ({"z": Z.astype(str)}, "z holds text"),
        ({"z": Z + 0j}, "z holds complex numbers"),
        (
            {"z": changed(Z.astype(object), (0, 0, 0), None)},
            "z holds objects, not real numbers; a missing measurement is NaN",
        ),
        ({"runs": [0, 1]}, "2 run numbers for 3 runs"),
        ({"runs": [0, 1, 1]}, "runs holds 1 twice"),
        ({"runs": [0, -1, 1]}, "runs holds -1"),
        ({"runs": [0, 0.5, 1]}, "whole numbers"),
        ({"step_s": 0.0}, "step_s is 0.0"),
        ({"step_s": "1"}, "step_s is '1'"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 1.5}, "seed is 1.5"),
        ({"R": [[-1.0]]}, "noise is no covariance: the variance in row 0 is negative"),
        ({"R": 1.0}, "noise has shape (); it must be (m, m), (T, m, m) or (runs, T, m, m); numpy.diag"),
        ({"R": changed(np.ones((20, 1, 1)), 4, -1.0)}, "noise of epoch 4 is no covariance"),
        ({"R": changed(np.ones((3, 20, 1, 1)), (2, 7), -1.0)}, "noise of run 2, epoch 7 is no covariance"),
        ({"R": changed(np.ones((3, 20, 1, 1)), (2, 7), np.nan)}, "noise is NaN at run 2, epoch 7, row 0, column 0"),
        ({"R": np.ones((2, 20, 1, 1))}, "noise is given for 2 runs, the measurements have 3"),
        ({"R": np.ones((3, 19, 1, 1))}, "noise is given for 19 epochs, the measurements have 20"),
        ({"R": np.eye(2)}, "noise is for 2 components, the measurement has 1"),
        ({"H": [[1.0, 0.0, 0.0]]}, "the measurement (columns of H) is for 3 states, the dynamics have 2"),
        ({"H": [[1.0, np.nan]]}, "matrix is NaN at row 0, column 1"),
        ({"H": [1.0, 0.0]}, "matrix has shape (2,)"),
        ({"H": np.ma.masked_array([[1.0, 0.0]], [[True, False]])}, "matrix has masked entries"),
    ],
)
def test_what_cannot_be_right_is_refused_by_name(given, sentence):
    with pytest.raises(ValueError, match=re.escape(sentence)):
        run(**given)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: MixtureNoise([np.nan, np.nan], [[[1.0]], [[25.0]]]), "weights of MixtureNoise must be positive"),
        (lambda: MixtureNoise([1.1, -0.1], [[[1.0]], [[25.0]]]), "weights of MixtureNoise must be positive"),
        (lambda: MixtureNoise([0.5, 0.4], [[[1.0]], [[25.0]]]), "sum to 1"),
        (lambda: MixtureNoise([1.0], [[[1.0]], [[25.0]]]), "they must be (k,) and (k, m, m)"),
        (
            lambda: MixtureNoise([0.9, 0.1], [[[1.0]], [[-25.0]]]),
            "covariances of MixtureNoise of component 1 is no cov",
        ),
        (lambda: MixtureNoise([0.9, 0.1], [np.eye(2), INDEFINITE]), "covariances of MixtureNoise of component 1 is no"),
        (lambda: LinearDynamics(F, np.full((2, 2), np.nan)), "process_noise is NaN at row 0, column 0"),
        (lambda: LinearDynamics(F, -Q), "process_noise is no covariance: the variance in row 0 is negative"),
        (lambda: LinearDynamics(F, CROOKED), "process_noise is no covariance: it is not symmetric"),
        (lambda: LinearDynamics(F, np.stack([Q, np.asarray(INDEFINITE)])), "process_noise of epoch 1 is no covariance"),
        (lambda: LinearDynamics(changed(F, (0, 1), np.inf), Q), "transition is infinite at row 0, column 1"),
        (lambda: LinearDynamics(F[:1], Q), "transition has shape (1, 2)"),
        (lambda: LinearDynamics(F, np.ma.masked_array(Q, Q > 0.008)), "process_noise has masked entries"),
        (lambda: FunctionMeasurement(lambda x, k: x[..., :1], [[1.0]], angles=(1,)), "angles (1,) do not fit"),
        (lambda: FunctionMeasurement(lambda x, k: x[..., :1], [[1.0]], angles=(0.0,)), "components by number"),
        (lambda: FunctionMeasurement(np.eye(2), [[1.0]]), "it must be a function"),
        (
            lambda: create_filter("ekf", LinearDynamics(F, Q), {"radar": lambda x, k: x[..., :1]}),
            "the measurement of sensor 'radar' is 'function' without dimension, predict, jacobian, noise",
        ),
        (lambda: create_filter("ekf", LinearDynamics(F, Q), None), "the measurement is 'NoneType' without dimension"),
        (lambda: FunctionMeasurement(lambda x, k: x[..., :1], [[1.0, 0.0], [0.9, 1.0]]), "noise is no covariance"),
    ],
)
def test_models_that_cannot_be_right_are_refused_by_name(make, sentence):
    with pytest.raises(ValueError, match=re.escape(sentence)):
        make()


def test_three_dependent_errors_are_no_covariance_though_each_pair_of_them_is():
    R = np.array([[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]])  # eigenvalues -0.8, 1.9, 1.9
    with pytest.raises(ValueError, match="noise is no covariance: it is not positive semidefinite"):
        LinearMeasurement(np.eye(3), R)


def test_too_few_matrices_of_the_dynamics_are_refused_before_the_first_step():
    filter = create_filter("kf", LinearDynamics(np.broadcast_to(F, (19, 2, 2)), Q), LinearMeasurement([[1, 0]], [[1]]))
    with pytest.raises(ValueError, match="transition is given for 19 epochs, the measurements have 20"):
        run_filter(filter, Z, [0, 0], np.eye(2))


def test_rounding_is_no_fault():
    """Van Loan's process noise of the Clohessy-Wiltshire equations is asymmetric by 1e-16 of its variances."""
    from scipy.linalg import expm

    n = 1.1e-3
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3, 0], A[3, 4], A[4, 3], A[5, 2] = 3 * n * n, 2 * n, -2 * n, -n * n
    E = expm(np.block([[-A, np.diag([0, 0, 0, 1, 1, 1]) * 1e-7], [np.zeros((6, 6)), A.T]]))
    noise = E[6:, 6:].T @ E[:6, 6:]
    assert not np.array_equal(noise, noise.T)
    kept = LinearDynamics(E[6:, 6:].T, noise).process_noise(np.zeros((1, 6)), None)
    assert np.array_equal(kept, kept.T)
    np.testing.assert_allclose(kept, noise, rtol=1e-9, atol=1e-22)
    root = np.random.default_rng(0).normal(size=(2, 6, 2))
    LinearDynamics(np.eye(6), root @ root.swapaxes(1, 2))  # of rank 2
    narrow = np.array([[1.0, 0.3], [np.nextafter(np.float32(0.3), np.float32(1)), 1.0]], dtype=np.float32)
    LinearDynamics(np.eye(2), narrow)


def test_a_masked_reading_is_a_missing_one():
    z = np.ma.masked_array(Z.copy(), mask=False)
    z[0, 3, 0] = 1e6
    z[0, 3, 0] = np.ma.masked
    expected = run(z=changed(Z, (0, 3, 0), np.nan))
    for masked in (z, list(z), [[list(row) for row in one] for one in z]):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert np.array_equal(run(z=masked).mean, expected.mean)
    assert np.array_equal(run(z=np.ma.masked_array(Z)).mean, run().mean)


def test_readings_of_other_kinds_of_real_numbers_are_taken():
    whole = np.rint(Z)
    expected = run(z=whole).mean
    for given in (whole.astype(np.float32), whole.astype(np.int16), whole.tolist()):
        assert np.array_equal(run(z=given).mean, expected)


def in_place(x, epoch):
    x[..., 0] -= 5.0
    return x[..., :1]


def in_place_jacobian(x, epoch):
    x *= 0
    return np.array([[1.0, 0.0]])


class InPlaceDynamics:
    dimension, linear = 2, False

    def propagate(self, states, step):
        states[..., 0] += states[..., 1]
        return states

    def transition(self, mean, step):
        return F

    def process_noise(self, states, step):
        return Q


class InPlaceMeasurement(MeasurementDefaults):
    dimension = 1

    def predict(self, states, epoch):
        states[..., 0] -= 5.0
        return states[..., :1]

    def noise(self, mean, epoch):
        return np.eye(1)


class InPlaceNoise(InPlaceMeasurement):
    def predict(self, states, epoch):
        return states[..., :1]

    def noise(self, mean, epoch):
        mean *= 0
        return np.eye(1)


LINEAR = LinearDynamics(F, Q)


@pytest.mark.parametrize("kind", ["ekf", "iekf", "ukf", "sr_ukf", "particle", "imm", "alpha_kf"])
@pytest.mark.parametrize(
    ("dynamics", "measurement", "named"),
    [
        (LINEAR, FunctionMeasurement(in_place, [[1]]), r"predict \(in_place\)"),
        (
            LINEAR,
            FunctionMeasurement(lambda x, k: x[..., :1], [[1]], in_place_jacobian),
            r"jacobian \(in_place_jacobian\)",
        ),
        (InPlaceDynamics(), LinearMeasurement([[1, 0]], [[1]]), "propagate of InPlaceDynamics"),
        (LINEAR, InPlaceMeasurement(), "predict of InPlaceMeasurement"),
        (LINEAR, InPlaceNoise(), "noise of InPlaceNoise"),
    ],
    ids=["predict", "jacobian", "propagate", "own_predict", "own_noise"],
)
def test_a_function_that_writes_into_its_argument_is_refused(kind, dynamics, measurement, named):
    with pytest.raises(ValueError, match=f"{named} writes into its argument.*copy"):
        run_filter(create_filter(kind, dynamics, measurement), Z, [5, 0], np.eye(2))


def test_a_function_may_return_its_argument():
    same = FunctionMeasurement(lambda x, k: x, np.eye(2), lambda x, k: np.eye(2))
    z = np.repeat(Z, 2, axis=2)
    for kind in ("ekf", "ukf", "particle", "two_step"):
        linear = run_filter(create_filter(kind, LINEAR, LinearMeasurement(np.eye(2), np.eye(2))), z, [5, 0], np.eye(2))
        found = run_filter(create_filter(kind, LINEAR, same), z, [5, 0], np.eye(2))
        np.testing.assert_allclose(found.mean, linear.mean, rtol=1e-9)


@pytest.mark.parametrize(
    ("measurement", "sentence"),
    [
        (FunctionMeasurement(lambda x, k: x, [[1.0]]), "expected (3, 1), because the noise is for 1 components"),
        (FunctionMeasurement(lambda x, k: x[..., 0], [[1.0]]), "predict returned shape (3,)"),
        (FunctionMeasurement(lambda x, k: x[..., :1] + 0j, [[1.0]]), "what predict returned holds complex numbers"),
        (FunctionMeasurement(lambda x, k: None, [[1.0]]), "what predict returned holds objects"),
        (
            FunctionMeasurement(lambda x, k: x[..., :1], [[1.0]], lambda x, k: np.eye(2)),
            "jacobian returned shape (2, 2)",
        ),
    ],
)
def test_functions_that_return_something_else_are_refused(measurement, sentence):
    with pytest.raises(ValueError, match=re.escape(sentence)):
        run_filter(create_filter("ekf", LINEAR, measurement), Z, [5, 0], np.eye(2))


@pytest.mark.parametrize("kind", ["ekf", "ukf", "iekf"])
def test_a_measurement_without_a_number_fails_its_run_with_that_reason(kind):
    """sqrt(x - 100) at x = 5, in run 1 from epoch 3 on; the others go on."""

    def predict(states, epoch):
        short = np.array([0.0, 100.0 * (epoch >= 3), 0.0])
        return np.sqrt(states[..., :1] - short.reshape(-1, *[1] * (states.ndim - 1)))

    filter = create_filter(kind, LINEAR, FunctionMeasurement(predict, [[1.0]]))
    with pytest.warns(RuntimeWarning, match="run 1 at epoch 3: .*predict of the measurement gives no finite number"):
        history = run_filter(filter, np.sqrt(Z), [5, 0], np.eye(2))
    assert np.isfinite(history.mean[[0, 2]]).all()


def test_models_whose_noise_is_no_covariance_are_refused():
    class Negative(InPlaceNoise):
        def noise(self, mean, epoch):
            return -np.eye(1)

    with pytest.raises(ValueError, match="what noise returned is no covariance: the variance in row 0 is negative"):
        run_filter(create_filter("ekf", LINEAR, Negative()), Z, [5, 0], np.eye(2))


def test_dynamics_that_return_another_shape_are_refused_by_name():
    class Flat(InPlaceDynamics):
        def propagate(self, states, step):
            return states[..., 0]

    filter = create_filter("ekf", Flat(), LinearMeasurement([[1, 0]], [[1]]))
    with pytest.raises(ValueError, match=r"propagate of Flat returned shape \(3,\) for states \(3, 2\)"):
        run_filter(filter, Z, [5, 0], np.eye(2))
