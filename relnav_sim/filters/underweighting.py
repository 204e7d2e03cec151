"""Underweighting: a precise measurement of a poorly known state is taken with less weight than the linear update says.

H P H^T leaves out what the curvature of h makes of a wide P. While the state is poorly known, a share of H P H^T is
added for it (W. M. Lear's for the Space Shuttle; Zanetti, DeMars and Bishop, J. Guidance, Control, and Dynamics 33(5),
2010): S = (1 + beta) H P H^T + R, K = P H^T S^-1. That gain is not the optimal one, so the covariance is Joseph's, with
the true R.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array, Mask
from relnav_sim.filters.belief import Gaussian, Innovation, where_runs
from relnav_sim.filters.square_root import semidefinite_solve
from relnav_sim.linalg import by_run, symmetric, transpose
from relnav_sim.options import Options, Tunable


class UnderweightingOptions(Options):
    """Less weight for measurements while the position is poorly known."""

    beta: Annotated[float, Tunable(0.01, 2)] = Field(
        default=0.2,
        gt=0,
        description="Share of H P H^T added to the covariance of the residual, for what the measurement's curvature "
        "adds to it; default 0.2, the Space Shuttle's (Zanetti, DeMars and Bishop 2010)",
    )
    above_m: Annotated[float, Tunable(1, 1e4)] = Field(
        gt=0,
        description="In force while the formal position sigma, the root of the sum of the three variances, is above "
        "this, m; at or below it the update is the filter's own",
    )


def poorly_known(belief: Gaussian, above_m: float) -> Mask:
    """Return in which runs the formal sigma of the position, the first three states, is above a limit, (runs,)."""
    variances = np.diagonal(belief.covariance, axis1=1, axis2=2)[:, :3]
    return np.asarray(variances.sum(axis=1) > above_m**2)


def underweighted(
    belief: Gaussian,
    update: tuple[Gaussian, Innovation],
    residual: Array,
    H: Array,
    R: Array,
    options: UnderweightingOptions,
) -> tuple[Gaussian, Innovation]:
    """Return an update in which the runs with a poorly known position are underweighted.

    The innovation stays that of the optimal update: NIS and likelihood are statistics of the model, not of the gain.
    Its extra `underweighted` is 1 where the gain was another.

    Args:
        belief: The prediction, mean (runs, n) and covariance (runs, n, n).
        update: The optimal update of all runs; others than those keep it to the bit.
        residual: z - h(m), (runs, m).
        H: Jacobian (runs, m, n) or (m, n).
        R: Measurement noise (runs, m, m) or (m, m).
        options: When, and how much.
    """
    posterior, innovation = update
    wide = poorly_known(belief, options.above_m)
    innovation = replace(innovation, extras={**innovation.extras, "underweighted": wide.astype(float)})
    if not wide.any():
        return posterior, innovation
    H, R, P = by_run(H), by_run(R), belief.covariance
    PHt = P @ transpose(H)
    S = (1 + options.beta) * (H @ PHt) + R
    K = transpose(semidefinite_solve(S, transpose(PHt)))
    kept = np.eye(P.shape[1]) - K @ H
    mean = belief.mean + np.einsum("bnm,bm->bn", K, residual)
    covariance = symmetric(kept @ P @ transpose(kept) + K @ R @ transpose(K))
    return where_runs(wide, Gaussian(mean, covariance), posterior), innovation
