"""Process noise found during the run: the densities of a white acceleration, by matching of covariances.

What a measurement moves an estimate by, dx, has the covariance P- - P+ where the process noise is right: dx dx^T is
matched to that (Myers and Tapley, IEEE Trans. Automatic Control 21(4), 1976). How far it is off is put down to the
densities by weighted least squares (Stacey and D'Amico, IEEE Trans. Aerospace and Electronic Systems 57(5), 2021). What
is fitted here is not the noise of one step but what it has come to: a density has been in the prediction's covariance
since the start, and has set the gain by which the estimate got where it is. With the derivatives of both by the
densities S_i,

    dP-_i = F dP+_i F^T + G_i,     dP+_i = A dP-_i A^T,             A = P+ P-^-1
    dm-_i = F dm+_i,               dm+_i = A (dm-_i + dP-_i l),     l = P-^-1 dx

the fit's weights are those of maximum likelihood: a measurement's score and information are (Gupta and Mehra, IEEE
Trans. Automatic Control 19(6), 1974, in terms of what is corrected instead of innovations)

    score_i = (l^T dP-_i l - tr(L dP-_i)) / 2 + l^T dm-_i,          L = P-^-1 (P- - P+) P-^-1
    M_i = tr(L dP-_i L dP-_i) / 2 + dm-_i^T L dm-_i

Each density goes up or down by scoring, measurement by measurement (the recursive prediction error method, Ljung and
Soderstrom, Theory and Practice of Recursive Identification, 1983, section 3.6): d log S = score / (N M + 1), with score
and M by log S and M a mean over N measurements. The score has the mean 0 where the densities are right, however roughly
F and A are known, and densities are positive by themselves. Each axis by itself: with what the axes have in common
solved for, one can be driven to nothing by what another explains, and a filter that has nothing there sees nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.white_noise import WhiteAcceleration
from relnav_sim.filters.belief import (
    Filter,
    Gaussian,
    Innovation,
    KeepsModels,
    WrappedBelief,
    believed_noise,
    where_runs,
)
from relnav_sim.linalg import CholeskyFactor, transpose
from relnav_sim.streams import RandomSource

MOTION = slice(0, 6)
"""Position and velocity among the states."""
GROWTH = 2
"""The window is half of the measurements so far, until it is full: a wrong start is left the sooner."""
DAMPING = 1.0
"""Information on log S added to that of a window: steps shrink where it tells less than a factor e (Levenberg 1944)."""
LARGEST = 1.0
"""Information on log S of one measurement: more of it weighs no more.

Where a filter has trusted its dynamics far too much, its estimate depends so much on the densities that one measurement
would tell them to a per cent, and its weight would hold them where they are for a long time.
"""
STRIDE = 16.0
"""In a measurement a density changes at most by the factor 1 + STRIDE / N, so that one measurement can't carry it far.

An error that a wrong density has let grow is seen in several measurements, and each would explain it anew.
"""


@dataclass(frozen=True)
class MatchedBelief(WrappedBelief):
    """A filter's belief, and what its measurements have told of the process noise.

    Attributes:
        inner: The filter's own belief.
        predicted: Position and velocity as predicted for this epoch, (runs, 6), (runs, 6, 6).
        made: dP, what a density 1 on each axis has made of the covariance, (runs, 3, 6, 6).
        moved: dm, what it has made of the estimate, (runs, 3, 6).
        densities: Those in use, (runs, 3), m^2/s^3.
        information: A measurement's on the logarithm of each density, mean over the window, (runs, 3).
        taken: How many measurements have counted, (runs,).
    """

    predicted: Gaussian
    made: Array
    moved: Array
    densities: Array
    information: Array
    taken: Array


class CovarianceMatching(KeepsModels):
    """A Gaussian filter whose white acceleration has the densities that its own corrections call for.

    Args:
        filter: The filter.
        white: The white acceleration in its dynamics; nothing else may have set its densities.
        window: Number of measurements that the densities come from.
    """

    def __init__(self, filter: Filter, white: WhiteAcceleration, window: int) -> None:
        self.dynamics, self.measurement, self.stochastic = filter.dynamics, filter.measurement, filter.stochastic
        self._filter, self._white, self._window = filter, white, window
        self._before_any = np.array(white.densities)

    def start(self, prior: Gaussian, source: RandomSource) -> MatchedBelief:
        """Return the filter's start, with the densities before any measurement."""
        inner, runs = self._filter.start(prior, source), len(prior.mean)
        return MatchedBelief(
            inner,
            _motion(inner),
            made=np.zeros((runs, 3, 6, 6)),
            moved=np.zeros((runs, 3, 6)),
            densities=np.tile(self._before_any, (runs, 1)),
            information=np.zeros((runs, 3)),
            taken=np.zeros(runs),
        )

    def predict(self, belief: MatchedBelief, step: Step) -> MatchedBelief:
        """Return the prediction with the densities that all measurements so far call for."""
        belief = self._matched(belief)
        self._white.densities = belief.densities
        inner = self._filter.predict(belief.inner, step)
        F = self._white.step_transition
        return replace(
            belief,
            inner=inner,
            predicted=_motion(inner),
            made=F @ belief.made @ F.T + self._white.noises,
            moved=belief.moved @ F.T,
        )

    def update(self, belief: MatchedBelief, z: Array, step: Step) -> tuple[MatchedBelief, Innovation]:
        """Return the filter's update; the densities in use are told beside its innovation."""
        inner, innovation = self._filter.update(belief.inner, z, step)
        names = ("radial_psd_m2_s3", "along_track_psd_m2_s3", "normal_psd_m2_s3")
        told = {name: belief.densities[:, axis].copy() for axis, name in enumerate(names)}
        return replace(belief, inner=inner), replace(innovation, extras={**innovation.extras, **told})

    def believed_noise(self, belief: MatchedBelief, epoch: int) -> Array | None:
        """Return R with which the filter takes the next measurement; None: the measurement's own."""
        return believed_noise(self._filter, belief.inner, epoch)

    def linear_step(self, belief: MatchedBelief, step: Step) -> tuple[Array, Array]:
        """Return the filter's F and Q of the step predicted last, with the densities that it was predicted with."""
        found: tuple[Array, Array] = self._filter.linear_step(belief.inner, step)  # type: ignore[attr-defined]  # a Gaussian filter has it
        return found

    def _matched(self, belief: MatchedBelief) -> MatchedBelief:
        """Return the belief after the measurements of an epoch have been counted as one."""
        predicted, corrected = belief.predicted, _motion(belief.inner)
        # A belief that began within the epoch (a restart, between two sensors) has no process noise behind it.
        read = (predicted.covariance != corrected.covariance).any(axis=(1, 2)) & belief.made.any(axis=(1, 2, 3))
        if not read.any():
            return belief
        score, information, made, moved = _told(predicted, corrected, belief.made, belief.moved)
        S, taken = belief.densities, belief.taken + read
        score, information = S * score, S**2 * information
        weight = np.sqrt(LARGEST / np.maximum(information, LARGEST))
        score, information = weight * score, weight**2 * information
        M = belief.information + (information - belief.information) / np.clip(taken, 1, self._window)[:, None]
        N = np.minimum(taken / GROWTH, self._window)[:, None]
        change = score / (N * M + DAMPING)
        # Not S exp(change): its mean would grow with the noise of the change.
        most = 1 + STRIDE / self._window
        densities = S * np.clip(1 + change, 1 / most, most)
        found = replace(belief, made=made, moved=moved, densities=densities, information=M, taken=taken)
        return where_runs(read, found, belief)


def _motion(belief: Any) -> Gaussian:
    """Return copies of mean (runs, 6) and covariance (runs, 6, 6) of position and velocity."""
    return Gaussian(belief.mean[:, MOTION].copy(), belief.covariance[:, MOTION, MOTION].copy())


def _told(predicted: Gaussian, corrected: Gaussian, made: Array, moved: Array) -> tuple[Array, Array, Array, Array]:
    """Return score and information (runs, 3) of a measurement by the densities, and dP and dm after it.

    Args:
        predicted: Position and velocity before the measurement, m- and P-.
        corrected: After it, m+ and P+.
        made: dP-, (runs, 3, 6, 6).
        moved: dm-, (runs, 3, 6).
    """
    P, runs = predicted.covariance, len(made)
    inverse = CholeskyFactor(P).solve(np.tile(np.eye(6), (runs, 1, 1)))
    # Where P- is not positive definite by rounding, in float32 say, nothing is told and all begins anew.
    inverse = np.where(np.isfinite(inverse), inverse, 0.0)
    A = corrected.covariance @ inverse
    L = inverse @ (P - corrected.covariance) @ inverse
    l = inverse @ (corrected.mean - predicted.mean)[:, :, None]  # noqa: E741  # the name above
    pulled = made @ l[:, None]
    weighed = L[:, None] @ made
    score = ((transpose(l)[:, None] @ pulled)[..., 0, 0] - np.trace(weighed, axis1=2, axis2=3)) / 2
    score = score + (moved @ l)[..., 0]
    information = np.trace(weighed @ weighed, axis1=2, axis2=3) / 2 + ((moved @ L) * moved).sum(axis=2)
    made = A[:, None] @ made @ transpose(A)[:, None]
    return score, information, made, (moved + pulled[..., 0]) @ transpose(A)
