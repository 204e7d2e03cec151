"""NEES, coverage and NIS where the truth is known."""

import numpy as np
from scipy.stats import chi2, norm

from relnav_sim.results import layout
from relnav_sim.statistics.consistency import chi_square_quantile, normalised_errors
from relnav_sim.statistics.errors import ScoringRules

RUNS, EPOCHS = 40, 500
RULES = ScoringRules(
    step_s=1.0, epochs=EPOCHS + 1, store_every=50, settle_s=0.0, convergence_m=1.0, convergence_hold_s=5
)
ODDS = 1e-6  # of a false alarm, per figure


def test_consistent_errors_lie_inside_their_bounds(draw_estimates, accumulated) -> None:
    """Errors are drawn from their covariances: every figure has a known distribution over RUNS x EPOCHS draws."""
    summary = accumulated(draw_estimates(RUNS, EPOCHS, seed=5), RULES).result().summary
    n = RUNS * EPOCHS
    for b, size in enumerate(layout.BLOCK_SIZES):
        low, high = chi2.ppf([ODDS, 1 - ODDS], n * size) / (n * size)
        assert low < summary["anees"][:, 0, b].mean() < high
        for j, level in enumerate(layout.LEVELS):
            half = norm.isf(ODDS) * np.sqrt(level * (1 - level) / n) + 1 / n
            assert abs(summary["coverage"][:, 0, b, j].mean() - level) < half
    updates = int(summary["updates"][:, 0].sum())
    low, high = chi2.ppf([ODDS, 1 - ODDS], 3 * updates) / updates
    assert low < summary["nis_mean"][:, 0].mean() < high
    assert abs(summary["nis_lag1"][:, 0].mean() + RUNS / updates) < norm.isf(ODDS) / np.sqrt(updates)


def test_overconfidence_shows(draw_estimates, accumulated) -> None:
    one = draw_estimates(RUNS, EPOCHS)
    one.covariance /= 2
    summary = accumulated(one, RULES).result().summary
    n = RUNS * EPOCHS
    low, high = 2 * chi2.ppf([ODDS, 1 - ODDS], 6 * n) / (6 * n)
    assert low < summary["anees"][:, 0, 0].mean() < high
    expected = chi2.cdf(chi2.ppf(0.95, 6) / 2, 6)
    half = norm.isf(ODDS) * np.sqrt(expected * (1 - expected) / n)
    assert abs(summary["coverage"][:, 0, 0, 2].mean() - expected) < half


def test_normalised_errors_of_badly_scaled_covariances() -> None:
    """Metres beside 1e-5 m/s and correlations near 1 cost no more digits than the condition number takes."""
    rng = np.random.default_rng(1)
    mix = rng.standard_normal((5000, 6, 6)) + 3
    scale = np.array([1e3, 1e3, 1e3, 1e-5, 1e-5, 1e-5])
    white = rng.standard_normal((5000, 6))
    factor = np.linalg.cholesky(mix @ mix.swapaxes(-1, -2)) * scale[:, None]
    error, covariance = (factor @ white[..., None])[..., 0], factor @ factor.swapaxes(-1, -2)
    nees, definite, finite = normalised_errors(error[None], covariance[None])
    assert definite.all()
    assert finite.all()
    condition = np.linalg.cond(factor / scale[:, None]) ** 2
    wrong = np.abs(nees[0, 0] - np.square(white).sum(axis=1))
    assert (wrong < 100 * np.finfo(float).eps * condition * nees[0, 0]).all()


def test_what_is_not_positive_definite_is_found() -> None:
    covariance = np.broadcast_to(np.eye(6), (8, 6, 6)).copy()
    covariance[1, 5, 5] = 0
    covariance[2, 5, 5] = -1e-300
    covariance[3, 0, 0] = np.nan
    covariance[4, 1, 0] = covariance[4, 0, 1] = 1.0000001
    covariance[5] = 0
    covariance[6, 4, 3] = np.nan
    covariance[7, 2, 2] = 1e-300
    nees, definite, finite = normalised_errors(np.ones((1, 8, 6)), covariance[None])
    assert definite.tolist() == [[True, False, False, False, False, False, False, True]]
    assert finite.tolist() == [[True, True, True, False, True, True, False, True]]
    assert nees[:, 0, 0].tolist() == [6, 3, 3]


def test_chi_square_quantile() -> None:
    for dof in (1, 3, 6, 600, 37.5):
        for p in (0.025, 0.5, 0.95, 0.9999):
            np.testing.assert_allclose(chi_square_quantile(p, dof), chi2.ppf(p, dof), rtol=1e-12)
