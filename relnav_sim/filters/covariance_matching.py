"""Process noise found during the run: the densities of a white acceleration, by matching of covariances.

What a reading moves an estimate by, dx, has the covariance P- - P+ where the process noise is right. So with Q as used
dx dx^T + P+ - F P+_before F^T = dx dx^T - (P- - P+) + Q has the mean Q where it is, and is larger where the noise is
too small (Myers and Tapley, IEEE Trans. Automatic Control 21(4), 1976). Its mean over a window of readings is fitted by
densities that are not negative, by weighted least squares (Stacey and D'Amico, IEEE Trans. Aerospace and Electronic
Systems 57(5), 2021): Q = sum of S_i G_i, with G_i what a density 1 on axis i makes since the reading before, and each
element weighted with the inverse of its variance, that of a product of two Gaussians of covariance P- - P+.

Fitted are the elements of the velocity. Those of the position come from the same three numbers, so they tell no more,
and their weights, which take every element for independent of the others, would make the fit worse, not better.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.white_noise import WhiteAcceleration
from relnav_sim.filters.belief import Filter, Gaussian, Innovation, WrappedBelief
from relnav_sim.linalg import transpose
from relnav_sim.streams import RandomSource

VELOCITY = slice(3, 6)
ROWS, COLUMNS = np.triu_indices(3)
STRIDE = 4.0
"""In a reading a density changes at most by the factor 1 + STRIDE / N, in a window by about 50.

A window over a jump holds corrections of unlike filters, and its fit may be 0: a filter without process noise takes no
reading more, and would find no other density for a long time.
"""
LEAST_SHARE = 1e-12
"""Of the predicted variance: what a reading has certainly moved less than that says nothing."""


@dataclass(frozen=True)
class MatchedBelief(WrappedBelief):
    """A filter's belief, and what its readings have told of the process noise.

    Attributes:
        inner: The filter's own belief.
        predicted_velocity: As predicted for this epoch, (runs, 3).
        predicted_covariance: Its covariance, (runs, 3, 3).
        made: What a density 1 on each axis has made since the last reading that counted, (runs, 3, 6, 6).
        densities: Those in use, (runs, 3), m^2/s^3.
        window: The velocity's elements of the matched Q and of `made` at the last readings, (runs, N, 4, 6).
        taken: How many readings have counted, (runs,).
    """

    predicted_velocity: Array
    predicted_covariance: Array
    made: Array
    densities: Array
    window: Array
    taken: Array


class CovarianceMatching:
    """A Gaussian filter whose white acceleration has the densities that its own corrections call for.

    Args:
        filter: The filter.
        white: The white acceleration in its dynamics; nothing else may have set its densities.
        window: Number of readings that the densities come from.
    """

    def __init__(self, filter: Filter, white: WhiteAcceleration, window: int) -> None:
        self.dynamics, self.measurement, self.stochastic = filter.dynamics, filter.measurement, filter.stochastic
        self._filter, self._white, self._window = filter, white, window
        self._before_any = np.array(white.densities)

    def start(self, prior: Gaussian, source: RandomSource) -> MatchedBelief:
        """Return the filter's start, with the densities before any reading."""
        inner, runs = self._filter.start(prior, source), len(prior.mean)
        return MatchedBelief(
            inner,
            *_of_velocity(inner),
            np.zeros((runs, 3, 6, 6)),
            np.tile(self._before_any, (runs, 1)),
            np.zeros((runs, self._window, 1 + 3, len(ROWS))),
            np.zeros(runs),
        )

    def predict(self, belief: MatchedBelief, step: Step) -> MatchedBelief:
        """Return the prediction with the densities that all readings so far call for."""
        belief = self._matched(belief)
        self._white.densities = belief.densities
        inner = self._filter.predict(belief.inner, step)
        velocity, covariance = _of_velocity(inner)
        F = self._white.step_transition
        return replace(
            belief,
            inner=inner,
            predicted_velocity=velocity,
            predicted_covariance=covariance,
            made=F @ belief.made @ F.T + self._white.noises,
        )

    def update(self, belief: MatchedBelief, z: Array, step: Step) -> tuple[MatchedBelief, Innovation]:
        """Return the filter's update; the densities in use are told beside its innovation."""
        inner, innovation = self._filter.update(belief.inner, z, step)
        names = ("radial_psd_m2_s3", "along_track_psd_m2_s3", "normal_psd_m2_s3")
        told = {name: belief.densities[:, axis].copy() for axis, name in enumerate(names)}
        return replace(belief, inner=inner), replace(innovation, extras={**innovation.extras, **told})

    def linear_step(self, belief: MatchedBelief, step: Step) -> tuple[Array, Array]:
        """Return the filter's F and Q of the step predicted last, with the densities that it was predicted with."""
        found: tuple[Array, Array] = self._filter.linear_step(belief.inner, step)  # type: ignore[attr-defined]  # a Gaussian filter has it
        return found

    def _matched(self, belief: MatchedBelief) -> MatchedBelief:
        """Return the belief after the readings of an epoch have been counted as one."""
        velocity, covariance = _of_velocity(belief.inner)
        moved, gained = velocity - belief.predicted_velocity, belief.predicted_covariance - covariance
        # A belief that began within the epoch (a restart, between two sensors) has no process noise behind it.
        read = (gained != 0).any(axis=(1, 2)) & belief.made.any(axis=(1, 2, 3))
        if not read.any():
            return belief
        made = belief.made[:, :, VELOCITY, VELOCITY]
        used = (belief.densities[:, :, None, None] * made).sum(axis=1)
        Q = moved[:, :, None] * moved[:, None, :] - gained + used
        sample = np.concatenate([Q[:, None], made], axis=1)[:, :, ROWS, COLUMNS]
        window = belief.window.copy()
        rows = np.flatnonzero(read)
        window[rows, (belief.taken[rows] % self._window).astype(int)] = sample[rows]
        taken = belief.taken + read
        # In a window that is not full, that of a run that has read nothing yet say, there may be nothing to fit.
        full = np.flatnonzero(read & (taken >= self._window))
        densities = belief.densities.copy()
        if len(full):
            fitted = _fitted(window[full].mean(axis=1), gained[full], belief.predicted_covariance[full])
            factor = 1 + STRIDE / self._window
            densities[full] = np.clip(fitted, densities[full] / factor, densities[full] * factor)
        return replace(
            belief,
            made=np.where(read[:, None, None, None], 0.0, belief.made),
            densities=densities,
            window=window,
            taken=taken,
        )


def _of_velocity(belief: Any) -> tuple[Array, Array]:
    """Return copies of the velocity's mean (runs, 3) and covariance (runs, 3, 3)."""
    return belief.mean[:, VELOCITY].copy(), belief.covariance[:, VELOCITY, VELOCITY].copy()


def _fitted(mean: Array, gained: Array, predicted: Array) -> Array:
    """Return the densities (runs, 3), not negative, that fit the mean of the matched Q best.

    Args:
        mean: Means over the window of the elements of Q and of what a density 1 makes, (runs, 4, 6).
        gained: P- - P+ at the last reading, (runs, 3, 3).
        predicted: P- there.
    """
    variance = np.diagonal(gained, axis1=1, axis2=2)
    variance = np.maximum(variance, LEAST_SHARE * np.diagonal(predicted, axis1=1, axis2=2))
    weights = 1 / (variance[:, ROWS] * variance[:, COLUMNS] + gained[:, ROWS, COLUMNS] ** 2)
    Q, G = mean[:, 0], mean[:, 1:]
    M = (weights[:, None] * G) @ transpose(G)
    r = (weights[:, None] * G * Q[:, None]).sum(axis=2)
    best, least = np.zeros_like(r), np.zeros(len(r))
    # With three unknowns the best of all sets that may be positive is found by trying them.
    for positive in product((False, True), repeat=3):
        if not any(positive):
            continue
        among = np.flatnonzero(positive)
        x = np.zeros_like(r)
        x[:, among] = np.linalg.solve(M[:, among[:, None], among], r[:, among, None])[..., 0]
        cost = -(r * x).sum(axis=1)  # at the free minimum of a set, x^T M x - 2 r^T x
        better = (x >= 0).all(axis=1) & (cost < least)
        best, least = np.where(better[:, None], x, best), np.where(better, cost, least)
    return best
