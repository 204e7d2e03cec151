from fractions import Fraction

import numpy as np
import pytest

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.streams import RandomSource

F = np.kron(np.array([[1.0, 1.0], [0.0, 1.0]]), np.eye(2))
Q = np.kron(np.array([[0.25, 0.5], [0.5, 1.0]]) * 0.04, np.eye(2))  # of rank two
R = np.diag([4.0, 1e-4])


class Turning:
    """A target whose heading turns with its position: nonlinear, with noise that depends on the state."""

    dimension = 4
    linear = False

    def propagate(self, states, step):
        turn = 0.05 * np.sin(states[..., 0] / 50)
        s, c = np.sin(turn), np.cos(turn)
        x, y, u, v = np.moveaxis(states, -1, 0)
        return np.stack([x + u, y + v, c * u - s * v, s * u + c * v], axis=-1)

    def process_noise(self, states, step):
        return 0.01 * (1 + np.abs(states[..., 0, None, None]) / 100) * np.eye(4)


def polar(states, epoch=0):
    x, y = states[..., 0], states[..., 1]
    return np.stack([np.hypot(x, y), np.arctan2(y, x)], axis=-1)


def track(runs, epochs):
    rng = np.random.default_rng(1)
    x = np.tile([-100.0, 5.0, -1.0, -0.3], (runs, 1))  # passes the cut of the azimuth
    mean0 = x + rng.normal(size=(runs, 4)) * [10, 10, 1, 1]
    z = np.empty((runs, epochs, 2))
    for k in range(epochs):
        acceleration = 0.2 * rng.normal(size=(runs, 2))
        x = x @ F.T + np.concatenate([acceleration / 2, acceleration], axis=1)
        z[:, k] = polar(x) + rng.normal(size=(runs, 2)) * np.sqrt(np.diag(R))
    z[..., 1] = np.arctan2(np.sin(z[..., 1]), np.cos(z[..., 1]))
    z[0, 5:8] = np.nan
    return z, mean0, np.diag([100.0, 100.0, 1.0, 1.0])


@pytest.mark.parametrize("kappa", [0.0, 1.5])
@pytest.mark.parametrize("dynamics", [LinearDynamics(F, Q), Turning()], ids=["linear", "nonlinear"])
def test_equals_the_unscented_filter(dynamics, kappa):
    z, mean0, P0 = track(20, 50)
    measurement = FunctionMeasurement(polar, R, angles=(1,))
    plain = run_filter(create_filter("ukf", dynamics, measurement, kappa=kappa), z, mean0, P0)
    root = run_filter(create_filter("sr_ukf", dynamics, measurement, kappa=kappa), z, mean0, P0)
    sigma = np.sqrt(np.einsum("btii->bti", plain.covariance))
    assert (np.abs(root.mean - plain.mean) / sigma).max() < 1e-9
    scaled = (root.covariance - plain.covariance) / (sigma[..., :, None] * sigma[..., None, :])
    assert np.abs(scaled).max() < 1e-9
    np.testing.assert_allclose(root.nis, plain.nis, rtol=1e-8, atol=1e-9, equal_nan=True)
    np.testing.assert_allclose(root.log_likelihood, plain.log_likelihood, rtol=1e-9, atol=1e-9)


def test_root_keeps_the_digits_that_the_plain_covariance_loses():
    # Two nearly equal measurements, 1e8 times as precise as the prior: rows of H that differ by 1e-8.
    H = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + 1e-8]])
    measurement = LinearMeasurement(H, 1e-16 * np.eye(2))
    still = LinearDynamics(np.eye(3), np.zeros((3, 3)))
    prior = Gaussian(np.zeros((1, 3)), np.eye(3)[None])
    direction = np.ones(3) / np.sqrt(3)

    # P^-1 = I + H^T H / R in exact arithmetic; the variance along (1, 1, 1).
    h = [[Fraction(float(entry)) for entry in row] for row in H]
    information = [[Fraction(i == j) + sum(h[k][i] * h[k][j] for k in range(2)) * 10**16 for j in range(3)]
                   for i in range(3)]  # fmt: skip
    exact = float(quadratic_form_of_inverse(information, [Fraction(1)] * 3) / 3)

    f = create_filter("sr_ukf", still, measurement)
    root, _ = f.update(f.start(prior, RandomSource(0, (0,))), np.zeros((1, 2)), Step(0))
    assert np.square(direction @ root.root[0]).sum() == pytest.approx(exact, rel=1e-4)
    f = create_filter("ukf", still, measurement)
    plain, _ = f.update(prior, np.zeros((1, 2)), Step(0))
    lost = direction @ plain.covariance[0] @ direction
    assert not np.isfinite(lost) or abs(lost / exact - 1) > 0.1


def quadratic_form_of_inverse(A, b):
    """Return b^T A^-1 b by Gaussian elimination, exact for fractions."""
    rows, n = [[*row, value] for row, value in zip(A, b, strict=True)], len(b)
    for i in range(n):
        for j in range(i + 1, n):
            ratio = rows[j][i] / rows[i][i]
            rows[j] = [entry - ratio * pivot for entry, pivot in zip(rows[j], rows[i], strict=True)]
    return sum(rows[i][n] ** 2 / rows[i][i] for i in range(n))


def test_singular_prior_and_process_noise():
    # The velocity is known exactly and undisturbed, so only the positions are estimated.
    dynamics = LinearDynamics(F, np.diag([0.1, 0.1, 0.0, 0.0]))
    z, mean0, _ = track(4, 10)
    history = run_filter(
        create_filter("sr_ukf", dynamics, FunctionMeasurement(polar, R, angles=(1,))),
        z,
        mean0,
        np.diag([100.0, 100.0, 0.0, 0.0]),
    )
    assert np.isfinite(history.mean).all()
    assert np.array_equal(history.covariance[:, :, 2:, 2:], np.zeros((4, 10, 2, 2)))
    np.testing.assert_allclose(history.mean[:, :, 2:], np.tile(mean0[:, None, 2:], (1, 10, 1)), atol=1e-12)


def test_bits_of_a_run_do_not_depend_on_its_block():
    z, mean0, P0 = track(30, 10)
    f = create_filter("sr_ukf", Turning(), FunctionMeasurement(polar, R, angles=(1,)))
    together = run_filter(f, z, mean0, P0)
    for run in (0, 13, 29):
        alone = run_filter(f, z[run : run + 1], mean0[run : run + 1], P0)
        assert np.array_equal(alone.mean[0], together.mean[run])
        assert np.array_equal(alone.covariance[0], together.covariance[run])


def test_covariances_are_symmetric_to_the_last_bit():
    z, mean0, P0 = track(10, 10)
    history = run_filter(create_filter("sr_ukf", Turning(), FunctionMeasurement(polar, R, angles=(1,))), z, mean0, P0)
    assert np.array_equal(history.covariance, history.covariance.swapaxes(2, 3))


def test_negative_kappa_is_refused():
    with pytest.raises(ValueError, match="kappa"):
        create_filter("sr_ukf", LinearDynamics(F, Q), FunctionMeasurement(polar, R), kappa=-1.0)
