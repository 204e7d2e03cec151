"""The recursion against Kalman filters, exact arithmetic and published numbers."""

from fractions import Fraction

import numpy as np
import pytest

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.crlb.fisher import ReadingInformation
from relnav_sim.crlb.recursion import BoundRecursion, matrix_root, posterior_cramer_rao
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar


def test_a_linear_gaussian_problem_has_the_kalman_covariance():
    rng = np.random.default_rng(4)
    T, n, m = 300, 4, 2
    F = np.eye(n) + 0.1 * rng.normal(size=(T, n, n))
    F /= np.abs(np.linalg.eigvals(F)).max(axis=1)[:, None, None]
    B = rng.normal(size=(T, n, 2))
    Q = 1e-3 * B @ B.swapaxes(1, 2)  # singular
    H, R, P0 = rng.normal(size=(m, n)), np.diag([0.5, 2.0]), np.diag([1.0, 4.0, 9.0, 0.1])
    missing = rng.uniform(size=T) < 0.3
    z = np.where(missing[:, None], np.nan, 0.0)[None] * np.ones((1, T, m))
    kalman = create_filter("kf", LinearDynamics(F, Q), LinearMeasurement(H, R))
    covariance = run_filter(kalman, z, np.zeros((1, n)), P0[None]).covariance[0]
    M = np.where(missing[:, None, None], 0.0, H.T @ np.linalg.inv(R) @ H)
    bound = posterior_cramer_rao(F, Q, M, P0)
    scale = np.sqrt(np.einsum("tii->ti", covariance))
    assert np.abs((bound - covariance) / (scale[:, :, None] * scale[:, None])).max() < 1e-9


def test_no_process_noise_stays_exact_over_many_epochs():
    # Constant velocity, position measured with variance r: sums of 1, j, j^2 in exact arithmetic.
    T, r, p, q = 30_000, Fraction(9), Fraction(10**4), Fraction(4)
    s1, s2 = Fraction(T * (T - 1), 2), Fraction((T - 1) * T * (2 * T - 1), 6)
    # Information about the last state; the prior there has position + velocity covariance [[p + q T^2, q T], [., q]].
    determinant = (p + q * T * T) * q - (q * T) ** 2
    a, b, c = T / r + q / determinant, -s1 / r - q * T / determinant, s2 / r + (p + q * T * T) / determinant
    exact = np.array([[c, -b], [-b, a]]) / (a * c - b * b)
    recursion = BoundRecursion(np.diag([float(p), float(q)]))
    F, W, none = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1 / 3, 0.0]]), np.zeros((2, 2))
    for _ in range(T):
        recursion.advance(F, none, W)
    np.testing.assert_allclose(recursion.covariance, exact.astype(float), rtol=1e-9)


def test_models_side_by_side_are_as_alone():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(3, 4, 4))
    start = A @ A.swapaxes(1, 2)
    F, Q, W = rng.normal(size=(3, 4, 4)), matrix_root(start[::-1]), rng.normal(size=(2, 4))
    together = BoundRecursion(start)
    together.advance(F, Q, W)
    for i in range(3):
        alone = BoundRecursion(start[i])
        alone.advance(F[i], Q[i], W)
        np.testing.assert_array_equal(alone.covariance, together.covariance[i])


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="informations"):
        posterior_cramer_rao(np.eye(2), np.zeros((2, 2)), np.eye(2), np.eye(2))
    with pytest.raises(ValueError, match="transitions"):
        posterior_cramer_rao(np.eye(3), np.zeros((2, 2)), np.zeros((5, 2, 2)), np.eye(2))


SWITCHES = np.array(np.meshgrid([1.0, 2.0], [1.0, 2.0], [1.0, 2.0])).reshape(3, 8).T
LAWS = {
    "A only": (np.ones(1), np.ones((1, 3))),
    "best linear": (np.ones(1), np.full((1, 3), np.sqrt(2.5))),
    "mixture": (np.full(8, 0.125), SWITCHES),
}


def bound_at_12_km(law, density, epochs):
    """Return the bound (m, m/s) of paths in the rest frame at 12 km along-track, 0.2 s, a = 6878 km, at some epochs."""
    weights, scales = LAWS[law]
    deviations = scales * np.array([4.0, *np.radians([0.2 / 3, 0.2 / 3])])
    radar = SphericalRadar(np.eye(3), SightNoise(weights, deviations, deviations[0], np.zeros((3, 3))))
    H = radar.jacobian(np.array([[0, 12_000.0, 0, 0, 0, 0]]), 0)[0]
    M = H.T @ ReadingInformation(weights, deviations, np.zeros((1, 2, 2))).at(np.zeros((1, 2, 2)))[0] @ H
    A = cw_system(np.sqrt(3.986004418e14 / 6878e3**3))
    F, Q = van_loan(A, np.eye(6)[:, 3:], density * np.eye(3), 0.2)
    recursion = BoundRecursion(np.linalg.inv(M + np.diag([0, 0, 0, 1, 1, 1.0])))
    root, noise = matrix_root(M), matrix_root(Q)
    found = []
    for k in range(1, max(epochs) + 1):
        recursion.advance(F, noise, root)
        if k in epochs:
            variances = np.diag(recursion.covariance)
            found.append([np.sqrt(variances[:3].sum()), np.sqrt(variances[3:].sum())])
    return np.array(found)


STEADY = [
    (1e-10, 40_000, {"A only": (0.366, 6.9e-4), "best linear": (0.488, 8.6e-4), "mixture": (0.467, 8.3e-4)}),
    (1e-8, 12_000, {"A only": (0.688, 3.0e-3), "best linear": (0.970, 3.5e-3), "mixture": (0.920, 3.4e-3)}),
    (1e-6, 4_000, {"A only": (1.224, 1.7e-2), "best linear": (1.726, 1.9e-2), "mixture": (1.636, 1.9e-2)}),
    (1e-4, 1_500, {"A only": (2.17, 9.5e-2), "best linear": (3.07, 0.106), "mixture": (2.91, 0.104)}),
]


def agrees(value, known):
    """Whether a value is within 1 % of a known one, or within the rounding of its last digit (two at least)."""
    digit = 10.0 ** (np.floor(np.log10(known)) - 1)
    return np.abs(value - known) <= np.maximum(0.01 * known, 0.51 * digit)


@pytest.mark.parametrize("density, epochs, known", STEADY[2:])
def test_steady_state_at_12_km(density, epochs, known):
    for law, numbers in known.items():
        assert agrees(bound_at_12_km(law, density, {epochs})[0], np.array(numbers)).all(), law


@pytest.mark.slow
@pytest.mark.parametrize("density, epochs, known", STEADY[:2])
def test_steady_state_at_12_km_with_little_noise(density, epochs, known):
    test_steady_state_at_12_km(density, epochs, known)


@pytest.mark.slow
def test_a_perfect_model_at_12_km():
    found = bound_at_12_km("A only", 0.0, {500, 5_000, 30_000})
    assert agrees(found, np.array([[1.79, 3.1e-2], [0.53, 1.0e-3], [0.136, 1.5e-4]])).all()
