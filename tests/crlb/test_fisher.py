"""Fisher information of mixtures against published values, quadrature and brute force."""

import itertools

import numpy as np
import pytest
from scipy.integrate import quad

from relnav_sim.astro.line_of_sight import cross_matrix
from relnav_sim.crlb.fisher import ReadingInformation, mixture_information

SIGMAS = np.array([4.0, 1.16e-3, 1.16e-3])


@pytest.mark.parametrize(
    "scale, fraction, information",
    [
        (2, 0.05, 0.908),
        (2, 0.1, 0.836),
        (2, 0.25, 0.665),
        (2, 0.5, 0.4615),
        (2, 0.75, 0.326),
        (10, 0.1, 0.827),
        (10, 0.5, 0.345),
    ],
)
def test_one_channel_has_the_known_values(scale, fraction, information):
    weights, variances = np.array([1 - fraction, fraction]), np.array([1.0, scale**2])
    (value,) = mixture_information(weights, variances[:, None, None]).ravel()
    assert value == pytest.approx(information, abs=0.00051)

    def integrand(v):
        parts = weights * np.exp(-0.5 * v * v / variances) / np.sqrt(2 * np.pi * variances)
        return np.sum(parts * v / variances) ** 2 / parts.sum()

    exact = 2 * sum(quad(integrand, *span, epsabs=1e-13, epsrel=1e-11)[0] for span in ((0, 6), (6, 12 * scale)))
    assert value == pytest.approx(exact, rel=1e-6)


def test_a_gaussian_has_its_inverse_covariance():
    A = np.random.default_rng(1).normal(size=(3, 3))
    covariance = A @ A.T + np.eye(3)
    np.testing.assert_allclose(mixture_information([1.0], covariance[None]), np.linalg.inv(covariance), rtol=1e-12)
    same = mixture_information([0.3, 0.7], [covariance, covariance])
    np.testing.assert_allclose(same, np.linalg.inv(covariance), rtol=1e-7, atol=1e-9)


def brute_force(weights, covariances, samples=400_000, seed=3):
    """Return E[s s^T] by random draws, and the standard error of its entries."""
    rng = np.random.default_rng(seed)
    counts = rng.multinomial(samples, weights)
    roots = np.linalg.cholesky(covariances)
    v = np.concatenate([L @ rng.standard_normal((3, n)) for L, n in zip(roots, counts, strict=True)], axis=1)
    pulls = np.linalg.inv(covariances) @ v
    logs = (np.log(weights) - 0.5 * np.linalg.slogdet(covariances)[1])[:, None] - 0.5 * (pulls * v).sum(axis=1)
    shares = np.exp(logs - logs.max(axis=0))
    score = (shares[:, None] * pulls).sum(axis=0) / shares.sum(axis=0)
    mean, squares = score @ score.T / samples, np.square(score) @ np.square(score).T / samples
    return mean, np.sqrt((squares - np.square(mean)) / samples)


def attitude(azimuth, elevation, size=1.0):
    """Return the covariance that attitude errors add to the two angles, from the rotation itself."""
    c = np.cos(elevation)
    sight = np.array([c * np.cos(azimuth), c * np.sin(azimuth), -np.sin(elevation)])
    by_azimuth = np.array([-sight[1], sight[0], 0]) / c**2
    by_elevation = np.array([0, 0, -1.0]) / c - sight[2] * sight / c
    G = np.stack([by_azimuth, by_elevation]) @ cross_matrix(sight)
    return G @ np.diag(np.square([3e-4, 1e-3, 5e-4]) * size) @ G.T


@pytest.mark.parametrize("shared", [True, False])
def test_three_channels_and_an_attitude_error_agree_with_brute_force(shared):
    switches = np.array([(0, 0, 0), (1, 1, 1)] if shared else list(itertools.product((0, 1), repeat=3)))
    weights = np.array([0.7, 0.3]) if shared else np.prod(np.where(switches, 0.3, 0.7), axis=1)
    deviations = SIGMAS * np.where(switches, 4.0, 1.0)
    A = attitude(0.4, 0.7)
    value = ReadingInformation(weights, deviations, A[None]).at(A[None])[0]
    covariances = np.square(deviations)[:, :, None] * np.eye(3)
    covariances[:, 1:, 1:] += A
    expected, error = brute_force(weights, covariances)
    assert (np.abs(value - expected) < 4 * error).all()
    assert (error[[0, 1, 2], [0, 1, 2]] < 0.005 * np.diag(expected)).all()
    if shared:
        np.testing.assert_allclose(mixture_information(weights, covariances), value, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    "size, tolerance, shared",
    [
        (0.1, 1e-4, False),
        *(pytest.param(*other, marks=pytest.mark.slow) for other in ((0.1, 1e-4, True), (3.0, 1e-3, True))),
    ],
)
def test_what_lies_between_nodes_is_as_exact_as_promised(size, tolerance, shared):
    lines = [(azimuth, elevation) for azimuth in np.linspace(-3, 3, 12) for elevation in (-0.9, -0.3, 0.5)]
    A = np.stack([attitude(*line, size) for line in lines])
    switches = [(0, 0, 0), (1, 1, 1)] if shared else list(itertools.product((0, 1), repeat=3))
    deviations = SIGMAS * np.where(switches, 3.0, 1.0)
    weights = np.full(len(switches), 1 / len(switches))
    between = ReadingInformation(weights, deviations, A).at(A)
    for i in (4, 17, 30):
        exact = ReadingInformation(weights, deviations, A[i : i + 1]).at(A[i : i + 1])[0]
        root = np.linalg.inv(np.linalg.cholesky(exact))
        assert np.abs(root @ between[i] @ root.T - np.eye(3)).max() < tolerance


def test_states_that_are_not_known_have_no_information_and_harm_no_other():
    A = np.stack([attitude(0.1, 0.2), np.full((2, 2), np.nan)])
    for weights, deviations in (([1.0], SIGMAS[None]), ([0.5, 0.5], np.stack([SIGMAS, 2 * SIGMAS]))):
        information = ReadingInformation(np.array(weights), deviations, A).at(A)
        assert np.isfinite(information[0]).all()
        assert np.isnan(information[1]).any()
