"""What a user's models return may be integers, float32, in Fortran order or a view: results are those of float64."""

import numpy as np
import pytest
from every_filter import KINDS, small_options
from taking_turns import taking_turns

from relnav_sim import create_filter, run_filter
from relnav_sim.filters.registry import filter_kinds

F = np.array([[1.0, 1.0], [0.0, 1.0]])
H = np.array([[1.0, 0.0], [1.0, 1.0]])


def as_integers(A):
    return A.astype(np.int64)


def as_float32(A):
    return A.astype(np.float32)


def in_fortran_order(A):
    return np.asfortranarray(A)


def as_a_view(A):
    wide = np.zeros((*A.shape[:-1], 2 * A.shape[-1]))
    wide[..., ::2] = A
    return wide[..., ::2]


class Dynamics:
    dimension = 2

    def __init__(self, kind, linear):
        self.kind, self.linear = kind, linear

    def propagate(self, states, step):
        return self.kind(states @ F.T) if self.kind in (in_fortran_order, as_a_view) else states @ F.T

    def transition(self, mean, step):
        return self.kind(F)

    def process_noise(self, states, step):
        return self.kind(np.eye(2))


class Measurement:
    dimension = 2

    def __init__(self, kind):
        self.kind = kind

    def predict(self, states, epoch):
        return self.kind(states @ H.T) if self.kind in (in_fortran_order, as_a_view) else states @ H.T

    def jacobian(self, states, epoch):
        return self.kind(np.broadcast_to(H, (*states.shape[:-1], 2, 2)))

    def noise(self, mean, epoch):
        return self.kind(2 * np.eye(2))

    def mixture(self, mean, epoch):
        return None

    def residual(self, z, predicted):
        return self.kind(z - predicted) if self.kind in (in_fortran_order, as_a_view) else z - predicted

    def log_likelihood(self, z, states, epoch):
        residual = z.reshape(len(z), *[1] * (states.ndim - 2), 2) - states @ H.T
        return -0.25 * np.square(residual).sum(axis=-1) - np.log(4 * np.pi)


def plain(A):
    return A


@pytest.mark.parametrize(
    "kind, arrays", taking_turns([(kind,) for kind in KINDS], [as_integers, as_float32, in_fortran_order, as_a_view])
)
@pytest.mark.parametrize("linear", [True, False])
def test_models_may_return_other_kinds_of_arrays(kind, arrays, linear):
    if filter_kinds()[kind].linear_only and not linear:
        pytest.skip("for linear models")
    z = np.random.default_rng(0).normal(size=(3, 6, 2))

    def history(arrays):
        try:
            filter = create_filter(kind, Dynamics(arrays, linear), Measurement(arrays), **small_options(kind))
        except ValueError as problem:
            pytest.skip(str(problem))
        return run_filter(filter, z, np.zeros(2), 4 * np.eye(2))

    found, expected = history(arrays), history(plain)
    assert not expected.failures
    for name in ("mean", "covariance", "nis", "log_likelihood"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-10, atol=1e-10)
