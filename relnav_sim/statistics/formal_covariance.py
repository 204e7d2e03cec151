"""Does the formal covariance, correlations and all, match the errors? By axis, by plane, and in the worst direction.

Axis and plane: e^T P^-1 e of a part of the state with its part of P, chi-square with as many degrees of freedom as
the part has components. Worst direction: at one epoch the errors of independent runs have the second moments
A = mean(e e^T), the filter says P = mean of its covariances. The extreme ratios u^T A u / u^T P u over all directions u
are the eigenvalues of L^-1 A L^-T with P = L L^T.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.conventions import CONFIDENCE
from relnav_sim.statistics.consistency import chi_square_quantile
from relnav_sim.statistics.intervals import Band, Interval

PARTS: tuple[tuple[int, ...], ...] = (
    *((i,) for i in range(6)),
    *((first + i, first + j) for first in (0, 3) for i, j in ((0, 1), (0, 2), (1, 2))),
)
"""The axes and the planes of position and of velocity, as places in the state."""
LEVELS = (0.95, 0.99)
_NULL_DRAWS = 4000


def part_nees(error: Array, covariance: Array, part: tuple[int, ...]) -> Array:
    """Return e^T P^-1 e of one or two components, by their marginal covariance, (...).

    Args:
        error: (..., 6).
        covariance: (..., 6, 6).
        part: Places of the components.
    """
    if len(part) == 1:
        (i,) = part
        return np.asarray(error[..., i] ** 2 / covariance[..., i, i])
    i, j = part
    a, b, c = covariance[..., i, i], covariance[..., i, j], covariance[..., j, j]
    x, y = error[..., i], error[..., j]
    return np.asarray((c * x**2 - 2 * b * x * y + a * y**2) / (a * c - b**2))


@dataclass(frozen=True)
class ByPart:
    """Consistency of each of `PARTS` over some epochs of some runs.

    Attributes:
        anees: Mean over epochs of the part's NEES over its dimension, (runs, parts); NaN where nothing is known.
        coverage: Share of epochs with the error inside the part's interval or ellipse of each of `LEVELS`,
            (runs, parts, levels).
    """

    anees: Array
    coverage: Array

    @staticmethod
    def of(error: Array, covariance: Array) -> ByPart:
        """Return it of errors (runs, K, 6) and covariances (runs, K, 6, 6)."""
        anees, coverage = [], []
        for part in PARTS:
            nees = part_nees(error, covariance, part)
            anees.append(_mean_over_epochs(nees) / len(part))
            limits = [chi_square_quantile(level, len(part)) for level in LEVELS]
            inside = [np.where(np.isnan(nees), np.nan, nees <= limit) for limit in limits]
            coverage.append(np.stack([_mean_over_epochs(each) for each in inside], axis=-1))
        return ByPart(np.stack(anees, axis=1), np.stack(coverage, axis=1))


@dataclass(frozen=True)
class Ensemble:
    """Formal against actual covariance at one epoch, over independent runs.

    Attributes:
        runs: Runs that count.
        formal: Mean over runs of the formal covariances, (6, 6).
        actual: Mean over runs of e e^T, (6, 6).
        ratios: Smallest and largest ratio of actual to formal sigma in any direction.
        directions: These directions as displacements, in formal sigmas of each component, of unit length, (2, 6).
        band: Where both ratios lie together in 95 % of all cases if the filter is consistent; None for too few runs.
    """

    runs: int
    formal: Array
    actual: Array
    ratios: tuple[float, float]
    directions: Array
    band: Band | None

    def formal_correlation(self, i: int, j: int) -> float:
        """Return the correlation of two components that the filter states."""
        return _correlation(self.formal, i, j)

    def actual_correlation(self, i: int, j: int, level: float = CONFIDENCE) -> Interval:
        """Return the correlation of the errors of two components, with its interval (Fisher 1921).

        The mean error is not taken out: the filter states none. So there are as many degrees of freedom as runs, and
        the variance of artanh r is 1 / (runs - 2).
        """
        from scipy.special import ndtri

        r = _correlation(self.actual, i, j)
        if self.runs < 4 or not abs(r) < 1:
            return Interval(r, math.nan, math.nan, level, self.runs)
        half = float(ndtri((1 + level) / 2)) / math.sqrt(self.runs - 2)
        return Interval(r, math.tanh(math.atanh(r) - half), math.tanh(math.atanh(r) + half), level, self.runs)


def ensemble_at(error: Array, covariance: Array) -> Ensemble | None:
    """Return the comparison at one epoch; None where fewer than two runs have an error and a covariance.

    Args:
        error: (runs, 6); runs with NaN are left out.
        covariance: (runs, 6, 6).
    """
    known = np.isfinite(error).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    e, P = error[known], covariance[known].mean(axis=0) if known.any() else np.zeros((6, 6))
    if len(e) < 2:
        return None
    sigma = np.sqrt(np.diag(P))
    scaled = e / sigma
    A, C = scaled.T @ scaled / len(e), P / np.outer(sigma, sigma)
    L = np.linalg.cholesky(C)
    white = np.linalg.solve(L, np.linalg.solve(L, A).T)
    values, vectors = np.linalg.eigh((white + white.T) / 2)
    extremes = (L @ vectors)[:, [0, -1]].T
    low, high = np.sqrt(np.maximum(values[[0, -1]], 0.0)).tolist()
    return Ensemble(
        runs=len(e),
        formal=P,
        actual=A * np.outer(sigma, sigma),
        ratios=(low, high),
        directions=extremes / np.linalg.norm(extremes, axis=1, keepdims=True),
        band=_band(len(e)),
    )


@functools.lru_cache(maxsize=16)
def _band(runs: int, level: float = CONFIDENCE) -> Band | None:
    """Return where both extreme ratios lie together if errors are normal with the formal covariance.

    From draws with a fixed seed: runs A is then a Wishart matrix of n degrees of freedom, here by its Bartlett factor.
    """
    if runs <= 6:
        return None
    rng = np.random.default_rng(20080115)
    T = np.zeros((_NULL_DRAWS, 6, 6))
    T[:, *np.tril_indices(6, -1)] = rng.standard_normal((_NULL_DRAWS, 15))
    for i in range(6):
        T[:, i, i] = np.sqrt(rng.chisquare(runs - i, _NULL_DRAWS))
    singular = np.linalg.svd(T, compute_uv=False) / math.sqrt(runs)
    tail = (1 - level) / 2
    return Band(float(np.quantile(singular[:, -1], tail)), float(np.quantile(singular[:, 0], 1 - tail)), level)


def _correlation(P: Array, i: int, j: int) -> float:
    scale = math.sqrt(P[i, i] * P[j, j])
    return float(P[i, j] / scale) if scale > 0 else math.nan


def _mean_over_epochs(values: Array) -> Array:
    known = np.isfinite(values)
    count = known.sum(axis=1)
    total = np.where(known, values, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
