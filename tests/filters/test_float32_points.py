"""Sigma points and reweighting in float32: beside NumPy's float32, beside float64, and where they can't go on."""

import numpy as np
import pytest
from joseph_128 import problem
from radar_problem import radar_problem

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics

POINTS = ("ukf", "ckf", "sr_ukf")
ROBUST = ("huber", "student_t", "mckf")
f = np.float32
EPS = float(np.finfo(f).eps)
Q, R = np.array([[0.3, 0.1], [0.1, 0.2]]), np.array([[0.37]])
MEAN, P = np.array([0.3, -0.2]), np.array([[2.0, 0.3], [0.3, 1.0]])


class Bent(LinearDynamics):
    """Dynamics that bend the points, evaluated in float64."""

    linear = moves_by_transition = False

    def propagate(self, states, step):
        return np.stack([states[..., 0] + 0.7 * np.sin(states[..., 1]), 0.9 * states[..., 1]], axis=-1)


def read(states, epoch=0):
    return states[..., :1] + 0.3 * np.square(states[..., 1:])


def plain_points(mean, P, n=2):
    """Cholesky's factor and the points, every operation rounded to float32."""
    a = np.sqrt(P[0, 0])
    b = P[1, 0] / a
    L = np.array([[a, 0], [b, np.sqrt(P[1, 1] - b * b)]], dtype=f)
    offsets = f(np.sqrt(n)) * np.vstack([L.T, -L.T])
    return np.vstack([mean, mean + offsets]), offsets


def added(terms):
    total = terms[0] * f(0)
    for term in terms:
        total = total + term
    return total


def plain_ukf(z, x, P):
    """One epoch of the cubature rule in Joseph's form in the order of the kernels."""
    w, c, noise = f(0.25), f(-1), R[0, 0].astype(f)
    points, _ = plain_points(x, P)
    images = Bent(np.eye(2), Q).propagate(points.astype(float), None).astype(f)
    d = images[1:] - images[0]
    s = w * added(d)
    x = images[0] + s
    P = Q.astype(f) + (w * added([np.outer(one, one) for one in d]) + c * np.outer(s, s))
    points, offsets = plain_points(x, P)
    readings = read(points.astype(float)).astype(f)[:, 0]
    d = readings[1:] - readings[0]
    s, t = w * added(d), w * added(offsets)
    S = noise + (w * added(d * d) + c * (s * s))
    C = w * added(d[:, None] * offsets) + c * (s * t)
    L = np.sqrt(S)
    W, white = C / L, (f(z) - (readings[0] + s)) / L
    x, K = x + W * white, W / L
    a = offsets - K * (d - s)[:, None]
    P = w * added([np.outer(one, one) for one in a]) + np.outer(K, noise * K)
    assert x.dtype == P.dtype == f
    return x, np.tril(P) + np.tril(P, -1).T


def test_ukf_in_float32_has_the_bits_of_numpys_float32():
    z = np.random.default_rng(2).normal(size=(1, 30, 1))
    flt = create_filter("ukf", Bent(np.eye(2), Q), FunctionMeasurement(read, R), arithmetic="float32")
    found = run_filter(flt, z, MEAN, P)
    x, covariance = MEAN.astype(f), P.astype(f)
    for k in range(30):
        x, covariance = plain_ukf(z[0, k, 0], x, covariance)
        np.testing.assert_array_equal(found.mean[0, k], x)
        np.testing.assert_array_equal(found.covariance[0, k], covariance)


@pytest.fixture(scope="module")
def radar():
    made = radar_problem(runs=5, steps=20)
    made.z[1, 4:8] = made.z[2, 10, 1] = made.z[:, 15] = np.nan
    return made


@pytest.mark.parametrize("kind", [*POINTS, *ROBUST])
def test_float32_is_near_and_independent_of_the_block(kind, radar):
    """The means' distance is at most what the roundings of prediction and update add up to, were none forgotten."""

    def history(rows=slice(None), **options):
        flt = create_filter(kind, radar.dynamics, radar.measurement, **options)
        return run_filter(flt, radar.z[rows], radar.mean0[rows], radar.cov0)

    whole, double = history(arithmetic="float32"), history()
    sigma = np.sqrt(np.einsum("...ii->...i", double.covariance))
    coarse = (EPS * np.abs(double.mean) / sigma).max()
    mean = np.abs((whole.mean - double.mean) / sigma).max()
    assert 1e-7 < mean < 2 * radar.z.shape[1] * coarse
    scale = sigma[..., :, None] * sigma[..., None, :]
    assert np.abs((whole.covariance - double.covariance) / scale).max() < 1e-3
    # A NIS of 3 channels, none beyond 5 sigma, moves by twice 5 sigma times a residual's own error, 3 times.
    assert np.nanmax(np.abs(whole.nis - double.nis)) < 30 * mean + 1e-3
    assert np.array_equal(whole.mean.astype(f), whole.mean) and not whole.failures
    for rows in ([1], [2, 4]):
        part = history(rows, arithmetic="float32")
        assert np.array_equal(part.mean, whole.mean[rows]) and np.array_equal(part.covariance, whole.covariance[rows])
        assert np.array_equal(part.nis, whole.nis[rows], equal_nan=True)


@pytest.mark.parametrize("kind", ["ukf", "sr_ukf"])
def test_points_that_the_dynamics_bend_are_near_too(kind):
    z, sensor = np.random.default_rng(2).normal(size=(3, 30, 1)), FunctionMeasurement(read, R)
    each = [
        run_filter(create_filter(kind, Bent(np.eye(2), Q), sensor, arithmetic=arithmetic), z, MEAN, P)
        for arithmetic in ("float32", "float64")
    ]
    assert 0 < np.abs(each[0].mean - each[1].mean).max() < 1e-4
    assert 0 < np.abs(each[0].covariance - each[1].covariance).max() < 1e-4


@pytest.mark.parametrize("kind", [*POINTS, *ROBUST])
def test_considered_states_stay_as_predicted(kind):
    flow = AugmentedDynamics(LinearDynamics(np.eye(1), 0.1 * np.eye(1)), [1.0], [0.0], considered=(0,))
    z, sensor = np.random.default_rng(0).normal(size=(1, 10, 1)), LinearMeasurement([[1.0, 1.0]], [[0.5]])
    each = [
        run_filter(create_filter(kind, flow, sensor, arithmetic=arithmetic), z, [0.0, 0.0], np.eye(2))
        for arithmetic in ("float32", "float64")
    ]
    np.testing.assert_allclose(each[0].covariance, each[1].covariance, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(each[0].mean[..., 1], 0.0)
    np.testing.assert_allclose(each[0].covariance[..., 1, 1], 1.0, rtol=1e-6)


@pytest.mark.parametrize("kind", POINTS)
def test_a_state_without_variance_is_known(kind):
    flow, sensor = LinearDynamics(np.eye(2), np.diag([0.1, 0.0])), LinearMeasurement([[1.0, 1.0]], [[0.5]])
    z, prior = np.random.default_rng(0).normal(size=(1, 10, 1)), np.diag([1.0, 0.0])
    found = run_filter(create_filter(kind, flow, sensor, arithmetic="float32"), z, [0.0, 0.5], prior)
    double = run_filter(create_filter(kind, flow, sensor), z, [0.0, 0.5], prior)
    assert not found.failures
    np.testing.assert_allclose(found.mean, double.mean, atol=1e-6)
    np.testing.assert_array_equal(found.covariance[..., 1, 1], 0.0)


@pytest.mark.parametrize("kind", ["ukf", "student_t", "iekf", "two_step", "adaptive_alpha_kf", "mkf"])
def test_a_covariance_that_is_lost_fails_its_run_alone(kind):
    """Of a condition of 1e12, which a covariance in float32 does not hold; that of the other run is 1."""
    given = problem(1e12)
    z, prior = np.stack([given.z, 0 * given.z]), np.stack([given.cov0, np.eye(6)])
    with pytest.warns(RuntimeWarning, match="not positive definite any more in float32; take ud_ekf"):
        found = run_filter(given.filter(kind, arithmetic="float32"), z, np.zeros(6), prior)
    assert [failure.run for failure in found.failures] == [0]
    assert np.isnan(found.mean[0, -1]).all() and np.isfinite(found.mean[1]).all()
    assert not run_filter(given.filter("sr_ukf", arithmetic="float32"), z, np.zeros(6), prior).failures


def test_sr_ukf_says_that_channels_can_not_be_told_apart():
    flow = LinearDynamics(np.eye(2), np.zeros((2, 2)))
    sensor = LinearMeasurement([[1.0, 1.0], [1.0, 1.0]], 1e-14 * np.eye(2))
    with pytest.warns(RuntimeWarning, match="can't tell a channel of the measurement from what is known without it"):
        run_filter(create_filter("sr_ukf", flow, sensor, arithmetic="float32"), np.zeros((1, 2, 2)), [0, 0], np.eye(2))


@pytest.mark.parametrize(
    "kind, options, sentence",
    [
        ("ukf", {"redraw": False}, "redraw: false is computed in float64 only"),
        ("huber", {"weigh_prior": True}, "weigh_prior is computed in float64 only"),
        ("imm", {}, "computes in float64 only, as it mixes several Gaussians.* that has float32: kf, ekf, ukf"),
        ("particle", {}, "computes in float64 only, as it is made of particles"),
    ],
)
def test_what_is_float64_only_is_refused(kind, options, sentence):
    with pytest.raises(ValueError, match=sentence):
        create_filter(
            kind, LinearDynamics(np.eye(2), Q), LinearMeasurement(np.eye(2), Q), arithmetic="float32", **options
        )
