"""Batch least squares: the one trajectory without process noise that fits all measurements best."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, KeepsModels
from relnav_sim.filters.kalman import innovation_of
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.square_root import NEEDS_NOISE, NoiseRoot, not_definite, semidefinite_root
from relnav_sim.linalg import by_run, symmetric, transpose
from relnav_sim.measurements.interface import Measurement, linearised
from relnav_sim.options import Options
from relnav_sim.streams import RandomSource

_CONVERGED = 1e-5
"""Length of a step, in sigmas of its result, with which the search ends; the step is taken, and far less is left."""


class BatchOptions(Options):
    """Options of the batch least squares fit."""

    max_iterations: int = Field(
        default=20,
        ge=2,
        le=1000,
        description="Most passes over all measurements; a run that has not converged by then has failed; default 20: "
        "from a fix 3 to 5 are usual",
    )


@dataclass(frozen=True)
class BatchPass:
    """A trajectory on its way past the measurements, and what they say of where it began.

    Attributes:
        mean: The trajectory now, (runs, n).
        covariance: That of its error, (runs, n, n).
        prior: Mean and covariance before any measurement.
        place: Where the trajectory began, in sigmas of the prior: x_0 = m_0 + S y, S S^T = P_0, (runs, n).
        first_covariance: The covariance there, (runs, n, n).
        Phi: Transition matrix since then, (runs, n, n).
        normal: Sum of Phi^T H^T R^-1 H Phi, (runs, n, n).
        gradient: Sum of Phi^T H^T R^-1 (z - h(x)), (runs, n).
        passes: Passes made so far, this one included.
        final: Runs (runs,) that have converged, or never will.
        lost: Those of them that never will.
    """

    mean: Array
    covariance: Array
    prior: Gaussian
    place: Array
    first_covariance: Array
    Phi: Array
    normal: Array
    gradient: Array
    passes: int
    final: Mask
    lost: Mask


@register_filter("batch_least_squares", BatchOptions, cost_us=9.0, overhead_us=700.0)
class BatchLeastSquares(KeepsModels):
    """Batch least squares: the one trajectory without process noise that fits all measurements of a run best.

    Gauss-Newton passes over the whole run for the state at its start (Tapley, Schutz and Born, Statistical Orbit
    Determination, 2004, section 4.3), with the prior as one more measurement. It is what is known afterwards if the
    dynamics are believed to the letter: the process noise does not count. Take it as the reference for filters, which
    can't do it in flight. Where the dynamics are wrong by more than the measurements average out, its covariance is far
    too small, and a smoother (`smoother: rts`) is the better reference.

    NIS and log-likelihood are those of the measurements about the fit that they were part of, each by itself.
    """

    stochastic = False
    double_only = "it is fitted on the ground, after the flight"

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: BatchOptions) -> None:
        self.dynamics = dynamics
        self.measurement = measurement
        self._most = options.max_iterations

    def start(self, prior: Gaussian, source: RandomSource) -> BatchPass:
        """Return the trajectory of the prior's mean before its first measurement."""
        runs, n = prior.mean.shape
        nobody = np.zeros(runs, dtype=bool)
        return self._begun(prior, np.zeros((runs, n)), prior.covariance, 1, nobody, nobody)

    def predict(self, belief: BatchPass, step: Step) -> BatchPass:
        """Return the trajectory one step on."""
        m, P = np.ascontiguousarray(belief.mean), np.ascontiguousarray(belief.covariance)
        F = by_run(self.dynamics.transition(m, step))
        covariance = kernels.kalman.predict(P, F, np.zeros((1, *P.shape[1:])))
        return replace(belief, mean=self.dynamics.propagate(m, step), covariance=covariance, Phi=F @ belief.Phi)

    def update(self, belief: BatchPass, z: Array, step: Step) -> tuple[BatchPass, Innovation]:
        """Return the trajectory as it is, with what a measurement says of its beginning."""
        residual, H, R = linearised(self.measurement, z, belief.mean, step.epoch)
        H, R = by_run(H), by_run(R)
        H, every = np.broadcast_to(H, (len(z), *H.shape[1:])), np.broadcast_to(R, (len(z), *R.shape[1:]))
        noise = NoiseRoot(every)
        A, r = noise.whiten_rows(H @ belief.Phi), noise.whiten(residual)
        HP = H @ belief.covariance
        told = innovation_of(symmetric(every - HP @ transpose(H)), residual, np.abs(z) + np.abs(z - residual))
        # Of a run without a fit not even the noise is known.
        singular = not_definite(every, len(z)) & np.isfinite(every).all(axis=(1, 2))
        failed = dict.fromkeys(np.flatnonzero(singular).tolist(), NEEDS_NOISE)
        passed = replace(
            belief,
            normal=belief.normal + transpose(A) @ A,
            gradient=belief.gradient + np.einsum("bmi,bm->bi", A, r),
        )
        return passed, Innovation(told.nis, told.log_likelihood, failed=failed)

    def settled(self, belief: BatchPass) -> bool:
        """Return whether a pass from here goes along the result itself, in all runs."""
        return bool(belief.final.all())

    def again(self, belief: BatchPass) -> BatchPass:
        """Return the beginning of the next pass from the end of one.

        Runs that have converged keep what they have, however many passes the others need.
        """
        prior, y = belief.prior, belief.place
        n = y.shape[1]
        S = semidefinite_root(prior.covariance)
        information = np.eye(n) + symmetric(transpose(S) @ belief.normal @ S)
        gradient = np.einsum("bji,bj->bi", S, belief.gradient) - y
        root, poor, _ = kernels.roots.whiten(np.ascontiguousarray(information), np.eye(n)[None])
        step = np.einsum("bji,bj->bi", root, np.einsum("bij,bj->bi", root, gradient))
        length = np.sqrt(np.einsum("bi,bij,bj->b", step, information, step))
        SW = S @ transpose(root)
        covariance = symmetric(SW @ transpose(SW))
        finite = np.isfinite(step).all(axis=1) & ~poor
        over = belief.passes >= self._most
        lost = ~belief.final & (~finite | (over & ~(length < _CONVERGED)))
        final = belief.final | lost | (length < _CONVERGED)
        place = np.where(belief.final[:, None], y, y + np.where(lost[:, None], np.nan, step))
        covariance = np.where(belief.final[:, None, None], belief.first_covariance, covariance)
        return self._begun(prior, place, covariance, belief.passes + 1, final, belief.lost | lost)

    def unfit(self, belief: BatchPass) -> dict[int, str]:
        """Return why runs have no fit, by place."""
        reason = f"Gauss-Newton has not converged in {self._most} passes over the measurements"
        return dict.fromkeys(np.flatnonzero(belief.lost).tolist(), reason)

    def _begun(
        self, prior: Gaussian, place: Array, covariance: Array, passes: int, final: Mask, lost: Mask
    ) -> BatchPass:
        runs, n = place.shape
        S = semidefinite_root(prior.covariance)
        mean = prior.mean + np.einsum("bij,bj->bi", S, place)
        return BatchPass(
            mean,
            covariance,
            prior,
            place,
            covariance,
            Phi=np.tile(np.eye(n), (runs, 1, 1)),
            normal=np.zeros((runs, n, n)),
            gradient=np.zeros((runs, n)),
            passes=passes,
            final=final,
            lost=lost,
        )
