"""What a user's own dynamics and measurement return may lie in memory as it likes, and be of any real type."""

import numpy as np
import pytest
from every_filter import KINDS, small_options

from relnav_sim import FunctionMeasurement, create_filter, run_filter

F = np.eye(6) + np.diag(np.full(3, 10.0), 3)
Q, H, R = 1e-4 * np.eye(6), np.eye(3, 6), 4.0 * np.eye(3)
MEAN, COVARIANCE = np.array([100.0, 2000.0, 300.0, 0.1, -0.2, 0.05]), np.diag([100.0] * 3 + [1e-2] * 3)


def every_second(a):
    apart = np.empty((*a.shape[:-1], 2 * a.shape[-1]))
    apart[..., ::2] = a
    return apart[..., ::2]


LAYOUTS = {
    "Fortran's order": np.asfortranarray,
    "every second place": every_second,
    "other bytes first": lambda a: a.astype(">f8"),
    "lists": lambda a: a.tolist(),
}


class Coasting:
    dimension = 6
    linear = False

    def __init__(self, layout):
        self._layout = layout

    def propagate(self, states, step):
        return self._layout(states @ F.T)

    def transition(self, mean, step):
        return self._layout(np.repeat(F[None], len(mean), axis=0))

    def process_noise(self, states, step):
        return self._layout(Q)


class Fix:
    dimension = 3

    def __init__(self, layout):
        self._layout = layout

    def predict(self, states, epoch):
        return self._layout(states @ H.T)

    def jacobian(self, states, epoch):
        return self._layout(np.broadcast_to(H, (*states.shape[:-1], 3, 6)).copy())

    def noise(self, mean, epoch):
        return self._layout(R)

    def mixture(self, mean, epoch):
        return None

    def residual(self, z, predicted):
        return self._layout(z - predicted)

    def log_likelihood(self, z, states, epoch):
        return -0.125 * np.square(z.reshape(len(z), *[1] * (states.ndim - 2), 3) - states @ H.T).sum(axis=-1)


def readings(runs):
    positions = MEAN[:3] + np.arange(4)[:, None] * 10 * MEAN[3:]
    return positions + np.random.default_rng(0).normal(size=(runs, 4, 3))


def means(kind, dynamics, measurement, runs=3):
    filter = create_filter(kind, dynamics, measurement, **small_options(kind))
    return run_filter(filter, readings(runs), MEAN, COVARIANCE).mean


def plain(a):
    return a


@pytest.mark.parametrize("kind", KINDS)
def test_every_layout_is_the_same_to_the_bit(kind):
    if kind == "kf":
        pytest.skip("takes linear dynamics")
    expected = means(kind, Coasting(plain), Fix(plain))
    assert np.isfinite(expected).all()
    for name, layout in LAYOUTS.items():
        np.testing.assert_array_equal(means(kind, Coasting(layout), Fix(layout)), expected, err_msg=name)


@pytest.mark.parametrize("kind", ["ekf", "ukf", "iekf", "particle"])
def test_single_precision_is_taken(kind):
    expected = means(kind, Coasting(plain), Fix(plain))
    found = means(kind, Coasting(plain), Fix(lambda a: a.astype(np.float32)))
    np.testing.assert_allclose(found, expected, rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("layout", [*LAYOUTS.values()], ids=[*LAYOUTS])
def test_a_function_may_return_any_layout(layout):
    own = FunctionMeasurement(lambda x, epoch: layout(x @ H.T), R, lambda x, epoch: layout(H))
    sound = FunctionMeasurement(lambda x, epoch: x @ H.T, R, lambda x, epoch: H)
    for kind in ("ekf", "ukf", "particle", "gaussian_sum"):
        np.testing.assert_array_equal(means(kind, Coasting(plain), own), means(kind, Coasting(plain), sound))


@pytest.mark.parametrize("what", ["propagate", "transition", "process_noise"])
def test_complex_numbers_are_refused_by_name(what):
    dynamics = Coasting(plain)
    setattr(dynamics, what, lambda *given: getattr(Coasting(plain), what)(*given).astype(complex))
    with pytest.raises(ValueError, match=f"what {what} of Coasting returned holds complex numbers"):
        means("ekf", dynamics, Fix(plain))


@pytest.mark.parametrize("kind", KINDS)
def test_no_runs_at_all(kind):
    if kind == "kf":
        pytest.skip("takes linear dynamics")
    assert means(kind, Coasting(plain), Fix(plain), runs=0).shape == (0, 4, 6)
