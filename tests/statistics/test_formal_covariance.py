"""Formal covariances with their correlations, against SciPy and plain NumPy."""

import numpy as np
import pytest
from scipy import stats

from relnav_sim.statistics.formal_covariance import LEVELS, PARTS, ByPart, ensemble_at, part_nees

SCALE = np.array([3.0, 5.0, 2.0, 2e-3, 4e-3, 1e-3])


def _covariance(seed: int = 1) -> np.ndarray:
    A = np.random.default_rng(seed).standard_normal((6, 8))
    return A @ A.T * np.outer(SCALE, SCALE)


def _draw(P, runs, epochs, seed):
    return np.random.default_rng(seed).standard_normal((runs, epochs, 6)) @ np.linalg.cholesky(P).T


def test_the_parts_against_their_marginal_covariances() -> None:
    P, e = _covariance(), _draw(_covariance(), 3, 5, 2)
    whole = np.broadcast_to(P, (3, 5, 6, 6))
    assert len(PARTS) == 12 and len(set(PARTS)) == 12
    for part in PARTS:
        own, marginal = e[..., list(part)], P[np.ix_(part, part)]
        expected = np.einsum("rki,ij,rkj->rk", own, np.linalg.inv(marginal), own)
        np.testing.assert_allclose(part_nees(e, whole, part), expected, rtol=1e-9)


def test_consistent_errors_are_inside_as_often_as_they_should_be() -> None:
    """Independent epochs: every ANEES and coverage within its simultaneous 99.9 % band, chi-square and binomial."""
    runs, epochs, P = 40, 50, _covariance()
    found = ByPart.of(_draw(P, runs, epochs, 3), np.broadcast_to(P, (runs, epochs, 6, 6)))
    tail = 0.0005 / (len(PARTS) * (1 + len(LEVELS)))
    for place, part in enumerate(PARTS):
        dof = len(part) * runs * epochs
        low, high = stats.chi2.ppf([tail, 1 - tail], dof) / dof
        assert low < found.anees[:, place].mean() < high
        for level, probability in enumerate(LEVELS):
            low, high = stats.binom.ppf([tail, 1 - tail], runs * epochs, probability) / (runs * epochs)
            assert low <= found.coverage[:, place, level].mean() <= high


def test_correlations_decide_where_sigmas_do_not() -> None:
    """Errors correlated by 0.95 whose filter believes in none: each axis is consistent, their plane is not."""
    P = np.eye(6)
    P[0, 1] = P[1, 0] = 0.95
    found = ByPart.of(_draw(P, 40, 50, 4), np.broadcast_to(np.eye(6), (40, 50, 6, 6)))
    inside = found.coverage[..., 0].mean(axis=0)
    plane = PARTS.index((0, 1))
    assert abs(inside[0] - 0.95) < 0.03 and abs(inside[1] - 0.95) < 0.03
    # A quadratic form of weights 1.95 and 0.05, below the 0.95 quantile of chi-square: by its own distribution.
    z = np.random.default_rng(0).standard_normal((400_000, 2)) ** 2 @ [1.95, 0.05]
    assert inside[plane] == pytest.approx((z <= stats.chi2.ppf(0.95, 2)).mean(), abs=0.03)
    assert inside[plane] < 0.93


def test_epochs_without_an_error_do_not_count() -> None:
    P, e = _covariance(), _draw(_covariance(), 3, 6, 5)
    e[0, 3:], e[2] = np.nan, np.nan
    found = ByPart.of(e, np.broadcast_to(P, (3, 6, 6, 6)))
    np.testing.assert_allclose(
        found.anees[0], ByPart.of(e[:1, :3], np.broadcast_to(P, (1, 3, 6, 6))).anees[0], rtol=1e-12
    )
    assert np.isnan(found.anees[2]).all() and np.isnan(found.coverage[2]).all()


def test_the_extreme_ratios_are_generalised_eigenvalues() -> None:
    from scipy.linalg import eigh

    P, e = _covariance(), _draw(_covariance(7), 30, 1, 6)[:, 0]
    found = ensemble_at(e, np.broadcast_to(P, (30, 6, 6)))
    A = e.T @ e / 30
    values, vectors = eigh(A / np.outer(SCALE, SCALE), P / np.outer(SCALE, SCALE))
    np.testing.assert_allclose(found.ratios, np.sqrt(values[[0, -1]]), rtol=1e-9)
    np.testing.assert_allclose(found.actual, A, rtol=1e-10)
    sigma = np.sqrt(np.diag(P))
    for place, column in ((0, 0), (1, -1)):
        displacement = P @ (vectors[:, column] / SCALE) / sigma
        displacement /= np.linalg.norm(displacement)
        assert abs(displacement @ found.directions[place]) == pytest.approx(1, abs=1e-9)


def test_the_band_holds_consistent_filters_as_often_as_it_says() -> None:
    """1000 consistent ensembles of 20 runs: both ratios are in the band in 95 %, within 99.9 % binomial limits."""
    P, inside = _covariance(), 0
    for seed in range(1000):
        found = ensemble_at(_draw(P, 20, 1, 1000 + seed)[:, 0], np.broadcast_to(P, (20, 6, 6)))
        inside += found.band.low <= found.ratios[0] and found.ratios[1] <= found.band.high
    # Each end leaves out 2.5 % and the ends are nearly independent; the band's own draws add 0.3 % at each.
    low, high = stats.binom.ppf([0.0005, 0.9995], 1000, 0.95)
    assert low - 6 <= inside <= high + 6


def test_the_interval_of_a_correlation_is_fishers() -> None:
    """Against the exact coverage: 2000 samples of 15 runs with a correlation of 0.6 about a known mean."""
    P = np.eye(6)
    P[0, 4] = P[4, 0] = 0.6
    rng, inside = np.random.default_rng(8), 0
    root = np.linalg.cholesky(P)
    for _ in range(2000):
        found = ensemble_at(rng.standard_normal((15, 6)) @ root.T, np.broadcast_to(P, (15, 6, 6)))
        one = found.actual_correlation(0, 4)
        inside += one.low <= 0.6 <= one.high
    assert found.formal_correlation(0, 4) == pytest.approx(0.6)
    assert 0.93 < inside / 2000 < 0.97


def test_too_few_runs() -> None:
    P = np.broadcast_to(np.eye(6), (8, 6, 6))
    e = _draw(np.eye(6), 8, 1, 9)[:, 0]
    assert ensemble_at(e[:1], P[:1]) is None
    few = ensemble_at(e[:3], P[:3])
    assert few.band is None and np.isnan(few.actual_correlation(0, 1).low)
    e[2:] = np.nan
    assert ensemble_at(e, P).runs == 2
