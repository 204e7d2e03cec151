"""The linear step that a sigma-point prediction amounts to: a matrix, and noise for what it leaves over."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.square_root import Whitener
from relnav_sim.linalg import symmetric, transpose


def statistical_linearisation(
    covariance: Array, offsets: Array, images: Array, weight: float, curvature: float
) -> tuple[Array, Array]:
    """Return F and Omega with Cov(y) = F P F^T + Omega and Cov(y, x) = F P, (runs, n, n) each.

    Lefebvre, Bruyninckx and De Schutter, IEEE Trans. Automatic Control 47(8), 2002. Of the images d+ and d- of a pair
    of opposite points, d+ - d- is what a matrix does and d+ + d- what the curvature adds, so Omega is found without
    the subtraction Cov(y) - F P F^T, which would lose it where it is small.

    Args:
        covariance: P, (runs, n, n).
        offsets: Sigma points less their centre, the n opposite ones behind, (runs, 2 n, n).
        images: Their images less that of the centre, (runs, 2 n, n).
        weight: Weight of a point.
        curvature: Weight of the square of the mean's shift, beta - alpha^2.
    """
    n = covariance.shape[-1]
    cross = weight * (transpose(offsets) @ images)
    even = (images[:, :n] + images[:, n:]) / 2
    shift = weight * images.sum(axis=1)
    Omega = 2 * weight * (transpose(even) @ even) + curvature * shift[:, :, None] * shift[:, None, :]
    F = np.ascontiguousarray(transpose(Whitener(covariance).solve(cross)))
    return F, symmetric(Omega)
