"""How far the two-step filter's first-step state may start off the manifold y = [x; g(x)].

Under x ~ N(m, P), the part of y beyond its tangent, c = g(x) - g(m) - G (x - m), has a mean, a covariance, and a
covariance with x. Each start gives these three; together they are the mean and covariance of y.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.square_root import semidefinite_root
from relnav_sim.linalg import symmetric, transpose

StartKind = Literal["linearised", "unscented", "unscented_plain", "closed_form"]

# Share of a standard deviation over which the closed form takes its second derivatives: the truncation is then
# below 1e-4 of them when the prior is as wide as the range, the rounding below it when the Jacobian is numerical.
_DERIVATIVE_STEP = 0.01
_ROUNDING = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class OffManifold:
    """A Gaussian of (x, c): c ~ N(mean_c, scatter), and x given c ~ N(mean_x + regression (c - mean_c), covariance).

    Args:
        mean_x: Deviation from the point of the tangent, (runs, n).
        mean_c: (runs, m).
        covariance: (runs, n, n).
        regression: (runs, n, m).
        scatter: (runs, m, m).
    """

    mean_x: Array
    mean_c: Array
    covariance: Array
    regression: Array
    scatter: Array


def start_off_manifold(
    kind: StartKind,
    prior: Gaussian,
    predict: Callable[[Array], Array],
    deviation: Callable[[Array, Array], Array],
    jacobian: Callable[[Array], Array],
    floor: Array,
    kappa: float,
) -> OffManifold:
    """Return how y is distributed about its tangent at the prior's mean.

    Args:
        kind: Which approximation.
        prior: x ~ N(m, P), P may be singular.
        predict: g, (runs, ..., n) -> (runs, ..., m).
        deviation: (z, predicted) -> their difference, angles wrapped.
        jacobian: G, (runs, n) -> (runs, m, n).
        floor: Added to the covariance of c, (m, m) or (runs, m, m), positive definite; but not to that of the plain
            unscented start, to which nothing is added but the rounding of g's own variance.
        kappa: Spread of the sigma points of the unscented start.
    """
    runs, n = prior.mean.shape
    m = floor.shape[-1]
    mean, curvature, cross = np.zeros((runs, m)), np.zeros((runs, m, m)), np.zeros((runs, m, n))
    if kind in ("unscented", "unscented_plain"):
        mean, curvature, cross = _unscented(prior, predict, deviation, jacobian, kappa)
        if kind == "unscented":
            # The points lie on the axes and miss the curvature across them, which can leave the covariance of c almost
            # singular and a run stuck to the tangent; its diagonal, of the size of what is missing, is added once more.
            curvature = curvature * (1 + np.eye(m))
        else:
            floor = _rounding(prior, jacobian, curvature)
    elif kind == "closed_form":
        mean, curvature = _closed_form(prior, jacobian)
    scatter = curvature + floor
    regression = np.ascontiguousarray(transpose(kernels.roots.solve(scatter, np.ascontiguousarray(cross))[0]))
    explained = regression @ scatter @ transpose(regression)
    return OffManifold(np.zeros((runs, n)), mean, symmetric(prior.covariance - explained), regression, scatter)


def _unscented(
    prior: Gaussian,
    predict: Callable[[Array], Array],
    deviation: Callable[[Array, Array], Array],
    jacobian: Callable[[Array], Array],
    kappa: float,
) -> tuple[Array, Array, Array]:
    """Return mean, covariance of c and its covariance with x (runs, m, n) by 2 n + 1 sigma points.

    No weight is negative, so y's covariance is a true sample covariance. Angles are unwrapped against the centre.
    """
    spread = prior.mean.shape[1] + kappa
    rows = np.sqrt(spread) * transpose(semidefinite_root(prior.covariance))
    offsets = np.concatenate([rows, -rows], axis=1)
    centre = prior.mean[:, None]
    images = predict(np.concatenate([centre, centre + offsets], axis=1))
    beyond = deviation(images[:, 1:], images[:, :1]) - offsets @ transpose(jacobian(prior.mean))
    weight = 1 / (2 * spread)
    shift = weight * np.einsum("bij->bj", beyond)
    about = beyond - shift[:, None]
    at_centre = kappa / spread * shift[:, :, None] * shift[:, None, :]
    curvature = weight * transpose(about) @ about + at_centre
    return shift, curvature, weight * transpose(beyond) @ offsets


def _rounding(prior: Gaussian, jacobian: Callable[[Array], Array], curvature: Array) -> Array:
    """Return what rounding leaves uncertain of the covariance of g(x), diagonal, (runs, m, m).

    Without it the covariance of c has no inverse where a component of g is linear, as that of y has none.
    """
    G = jacobian(prior.mean)
    variances = np.einsum("bij,bjk,bik->bi", G, prior.covariance, G) + np.einsum("bii->bi", curvature)
    return _ROUNDING * variances[:, :, None] * np.eye(curvature.shape[-1])


def _closed_form(prior: Gaussian, jacobian: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return mean tr(g_i'' P) / 2 and covariance tr(g_i'' P g_j'' P) / 2 of c, exact for quadratic g.

    With P = L L^T both need only the curvature L^T g_i'' L, differences of the Jacobian along the columns of L.
    """
    L = semidefinite_root(prior.covariance)
    columns = []
    for j in range(L.shape[2]):
        ahead = _DERIVATIVE_STEP * L[:, :, j]
        change = jacobian(prior.mean + ahead) - jacobian(prior.mean - ahead)
        columns.append(change @ L / (2 * _DERIVATIVE_STEP))
    second = np.stack(columns, axis=-1)
    second = (second + transpose(second)) / 2
    flat = second.reshape(*second.shape[:2], -1)
    return np.einsum("bijj->bi", second) / 2, flat @ transpose(flat) / 2
