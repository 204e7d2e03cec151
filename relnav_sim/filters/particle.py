"""Bootstrap particle filter, and what it shares with the unscented particle filter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.cloud import (
    Cloud,
    CloudStreams,
    average,
    chosen,
    contracted,
    kernel_bandwidth,
    log_likelihood,
    moments,
    pick,
    put,
    spread,
    square_root,
    standard_normals,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.resampling import Resampling, draw_ancestors, effective_sample_size
from relnav_sim.linalg import CholeskyFactor, transpose
from relnav_sim.models.dynamics import Dynamics, Step
from relnav_sim.models.measurement import Measurement
from relnav_sim.options import Options
from relnav_sim.streams import RandomSource, Streams

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

# Each halves the cloud, so they reach a likelihood that takes one in 2^50.
_MOST_STAGES = 50


class CloudOptions(Options):
    """Options of every particle filter."""

    particles: int = Field(
        default=1000,
        ge=2,
        le=1_000_000,
        description="Number of particles N; default 1000, the least that fills six states",
    )
    resampling: Resampling = Field(
        default="systematic",
        description="Resampling scheme: systematic (one random number, least variance in practice), stratified, or "
        "residual (sure copies first, the rest multinomial)",
    )
    ess_fraction: float = Field(
        default=0.5,
        ge=0,
        le=1,
        description="Resample when the effective sample size 1 / sum w^2 falls below this fraction of N; default 0.5, "
        "the usual choice; 1 resamples at every measurement, 0 never",
    )
    roughening: float = Field(
        default=0.0,
        ge=0,
        description="Width of the kernel that parts resampled particles, in units of the optimal one, h = (4 / (n + "
        "2))^(1 / (n + 4)) N^(-1 / (n + 4)); particles move towards the mean so that the covariance stays (Liu and "
        "West 2001). Default 0, with which the evidence is unbiased; set 1 where the process noise is too small to part "
        "copies, as in orbit",
    )


class ParticleOptions(CloudOptions):
    """Options of the bootstrap particle filter."""

    mcmc_steps: int = Field(
        default=0,
        ge=0,
        le=100,
        description="Metropolis moves of every particle after resampling, which part copies without changing what they "
        "are drawn from; default 0: each costs as much as a likelihood",
    )
    mcmc_step_size: float = Field(
        default=0.5,
        gt=0,
        le=1,
        description="Share of the process noise that a move draws anew: noise* = sqrt(1 - s^2) noise + s new; 1 draws "
        "all of it, small values are accepted more often; default 0.5",
    )


class CloudFilter:
    """Starting, predicting, weighting and resampling a cloud; `update` is the algorithm's own."""

    stochastic = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: CloudOptions) -> None:
        self.dynamics = dynamics
        self.measurement = measurement
        self._particles = options.particles
        self._resampling = options.resampling
        self._ess_threshold = options.ess_fraction * options.particles
        self._bandwidth = options.roughening * kernel_bandwidth(dynamics.dimension, options.particles)
        if self._bandwidth > 1:
            raise ValueError(f"roughening must not exceed {options.roughening / self._bandwidth:.3g} with these sizes")
        self._rooted: tuple[Array, Array] | None = None

    def start(self, prior: Gaussian, source: RandomSource) -> Cloud:
        """Return particles drawn from the prior."""
        streams = CloudStreams.of(source, "particle")
        runs, n = prior.mean.shape
        noise = standard_normals(source.streams("filter.particle.start"), n, self._particles)
        components = prior.mean[:, :, None] + spread(square_root(prior.covariance), noise)
        log_weights = np.full((runs, self._particles), -np.log(self._particles))
        return Cloud(components, log_weights, prior.mean, prior.covariance, np.ones(runs, dtype=bool), streams)

    def predict(self, belief: Cloud, step: Step) -> Cloud:
        """Return the cloud carried over one step, every particle with its own draw of the process noise."""
        states, kernel = self._smoothed(belief, step)
        Q = self.dynamics.process_noise(states, step)
        if self.dynamics.linear:
            F = self.dynamics.transition(belief.mean, step)
            centres = F @ transpose(states)
            mean = (F @ belief.mean[:, :, None])[:, :, 0]
            # The kernel and the contraction leave the covariance as it is.
            covariance = F @ belief.covariance @ transpose(F) + average(Q, belief.weights)
        else:
            centres = np.ascontiguousarray(transpose(self.dynamics.propagate(states, step)))
            mean, covariance = moments(centres, belief.weights)
            covariance += average(Q, belief.weights)
            if kernel is not None:
                covariance += kernel
        if kernel is not None:
            Q = Q + (kernel if Q.ndim < 4 else kernel[:, None])
        root = self._root(Q)
        noise = standard_normals(belief.streams.noise, root.shape[-1], self._particles)
        components = spread(root, noise)
        components += centres
        parted = np.zeros(len(mean), dtype=bool)
        log_weights, streams = belief.log_weights, belief.streams
        return Cloud(components, log_weights, mean, covariance, parted, streams, centres=centres, noise=noise, root=root)

    def _smoothed(self, belief: Cloud, step: Step) -> tuple[Array, Array | None]:
        """Return the particles (runs, N, n), copies drawn to the mean, and the kernel's covariance one step later.

        The kernel joins the process noise instead of being drawn from at once, so that a proposal can use it too (the
        pre-regularised filter of Musso, Oudjane and Le Gland 2001).
        """
        if self._bandwidth == 0:
            return belief.states, None
        h = np.where(belief.copied, self._bandwidth, 0.0)[:, None, None]
        components = contracted(belief.components, belief.mean, h)
        F = self.dynamics.transition(belief.mean, step)
        return transpose(components), h**2 * (F @ belief.covariance @ transpose(F))

    def _root(self, Q: Array) -> Array:
        """Return G with G G^T = Q; one that all runs share is kept until it changes."""
        if Q.ndim > 2:
            return square_root(Q)
        if self._rooted is None or not np.array_equal(self._rooted[0], Q):
            self._rooted = (Q.copy(), square_root(Q))
        return self._rooted[1]

    def _log_likelihood(self, predicted: Cloud, components: Array, z: Array, step: Step) -> Array:
        """Return log p(z | x) of particles (runs, n, N): (runs, N); the noise is that at the prediction's mean."""
        return log_likelihood(self.measurement, z, transpose(components), predicted.mean, step.epoch)

    def _innovation(self, predicted: Cloud, z: Array, step: Step, evidence: Array, ess: Array) -> Innovation:
        """Return the record of an update; NIS from the predicted cloud's mean and covariance, h linearised there."""
        mean, epoch = predicted.mean, step.epoch
        H = self.measurement.jacobian(mean, epoch)
        S = H @ predicted.covariance @ transpose(H) + self.measurement.noise(mean, epoch)
        residual = self.measurement.residual(z, self.measurement.predict(mean, epoch))
        nis = np.square(CholeskyFactor(S).whiten(residual)).sum(axis=-1)
        return Innovation(nis, evidence, {"ess": ess, "resampled": (ess < self._ess_threshold).astype(float)})

    def _resampled_runs(self, ess: Array) -> Rows:
        return np.flatnonzero(ess < self._ess_threshold)

    def _ancestors(self, cloud: Cloud, rows: Rows) -> Rows:
        return draw_ancestors(self._resampling, cloud.weights[rows], chosen(cloud.streams.resampling, rows))

    def _settle(self, cloud: Cloud, rows: Rows) -> Cloud:
        """Return the cloud with equal weights in the resampled runs."""
        equal = np.full((len(rows), self._particles), -np.log(self._particles))
        copied = cloud.copied.copy()
        copied[rows] = True
        return replace(cloud, log_weights=put(cloud.log_weights, rows, equal), copied=copied)


def weigh(cloud: Cloud, log_increments: Array) -> tuple[Cloud, Array, Array]:
    """Return the reweighted cloud, with its moments; the evidence's logarithm; and the effective sample size.

    The weights' mean increment estimates p(z_k | z_1 ... z_{k-1}); the product over k is unbiased (Del Moral 2004).

    Args:
        cloud: Particles with the weights they had.
        log_increments: Logarithm of every particle's new factor, (runs, N).
    """
    log_weights = cloud.log_weights + log_increments
    highest = log_weights.max(axis=-1, keepdims=True)
    weights = np.exp(log_weights - highest)
    total = weights.sum(axis=-1, keepdims=True)
    weights /= total
    evidence = highest + np.log(total)
    log_weights -= evidence
    mean, covariance = moments(cloud.components, weights)
    weighted = Cloud(cloud.components, log_weights, mean, covariance, cloud.copied, cloud.streams)
    return weighted, evidence[:, 0], effective_sample_size(weights)


def accept(log_ratio: Array, streams: Streams) -> NDArray[np.bool_]:
    """Return which Metropolis proposals (runs, N) are accepted, by the logarithm of their ratio."""
    accepted: NDArray[np.bool_] = np.log1p(-streams.uniform(log_ratio.shape[1])) < log_ratio
    return accepted


def tempered_ess(log_weights: Array) -> Array:
    """Return the effective sample size of log-weights that need not be normalised, (runs, N): (runs,)."""
    weights = np.exp(log_weights - log_weights.max(axis=-1, keepdims=True))
    return np.asarray(np.square(weights.sum(axis=-1)) / np.square(weights).sum(axis=-1))


def power_that_leaves_half(log_weights: Array, score: Array, most: Array) -> Array:
    """Return the powers of the likelihoods exp(score) that halve the number of effective particles, (runs,).

    Args:
        log_weights: What the particles weigh before, (runs, N).
        score: (runs, N).
        most: Upper bounds, (runs,).
    """
    wanted = tempered_ess(log_weights) / 2
    low, high = np.zeros(len(score)), most.copy()
    for _ in range(40):
        middle = (low + high) / 2
        few = tempered_ess(log_weights + middle[:, None] * score) < wanted
        low, high = np.where(few, low, middle), np.where(few, middle, high)
    return high


@register_filter("particle", ParticleOptions, cost_us=150.0)
class ParticleFilter(CloudFilter):
    """Bootstrap particle filter: draw from the dynamics, weigh by the likelihood, resample when few particles count.

    Gordon, Salmond and Smith, IEE Proc. F 140(2), 1993; resampling when the effective sample size is low (Liu and Chen
    1995); optional Metropolis moves (Gilks and Berzuini 2001) that draw part of the process noise anew (Cotter et al.
    2013), so they hold for any process noise, also a singular one. Mean and covariance are taken before resampling.

    Use it where the belief is not a Gaussian at all: several hypotheses, strong curvature, glint with its true mixture.
    It handles any likelihood and any dynamics, but needs particles where the measurement is precise: the share of the
    prediction that a measurement leaves must hold many of them. With the small process noise of an orbit copies never
    part again and the cloud dies out, which `ess` does not show. Then set `roughening` to 1, which parts copies by a
    kernel, and goes through a measurement that would leave fewer than one particle in twenty in several tempered stages
    (Musso, Oudjane and Le Gland 2001, progressive correction); or prefer `unscented_particle`.

    `log_likelihood` is the logarithm of the evidence's estimate; without roughening the evidence itself is unbiased,
    its logarithm is low by half its variance. NIS uses the predicted cloud's mean and covariance with the measurement
    linearised there, so it is chi-square only as far as the cloud is Gaussian. Records `ess`, `resampled` and, with
    roughening, `stages`.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: ParticleOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._moves = options.mcmc_steps
        self._move_size = options.mcmc_step_size

    def update(self, belief: Cloud, z: Array, step: Step) -> tuple[Cloud, Innovation]:
        """Return the reweighted and, in runs with few effective particles, resampled cloud; and its innovation."""
        score = self._log_likelihood(belief, belief.components, z, step)
        approached, log_weights, evidence, stages = belief, score, np.zeros(len(z)), np.zeros(len(z))
        if self._bandwidth > 0:
            approached, log_weights, evidence, stages = self._approach(belief, score, z, step)
        cloud, last, ess = weigh(approached, log_weights)
        innovation = self._innovation(belief, z, step, evidence + last, ess)
        if self._bandwidth > 0:
            innovation = replace(innovation, extras={**innovation.extras, "stages": stages + 1})
        rows = self._resampled_runs(ess)
        if len(rows):
            ancestors = self._ancestors(cloud, rows)
            copies = pick(cloud.components, rows, ancestors)
            cloud = replace(cloud, components=put(cloud.components, rows, copies))
            # After a tempered stage a particle is no longer f(ancestor) + G xi, which the moves rest on.
            drawn = stages[rows] == 0
            if self._moves and drawn.any():
                cloud = self._move(cloud, belief, score, rows[drawn], ancestors[drawn], z, step)
            cloud = self._settle(cloud, rows)
        return cloud, innovation

    def _approach(self, cloud: Cloud, score: Array, z: Array, step: Step) -> tuple[Cloud, Array, Array, Array]:
        """Return the cloud after tempered stages, in runs where the whole measurement would leave too few particles.

        Each stage takes the likelihood to the power that leaves half of the particles, resamples and applies the kernel.

        Args:
            cloud: The prediction.
            score: log p(z | x), (runs, N).
            z: The measurement.
            step: The epoch.

        Returns:
            The cloud, the logarithm of the likelihood's part that is left over for it (runs, N), the logarithm of the
            evidence so far and the number of stages (runs,).
        """
        predicted, left = cloud, np.ones(len(z))
        evidence, stages = np.zeros(len(z)), np.zeros(len(z))
        while True:
            rows = np.flatnonzero(tempered_ess(cloud.log_weights + left[:, None] * score) < self._particles / 20)
            rows = rows[stages[rows] < _MOST_STAGES]
            if not len(rows):
                return cloud, left[:, None] * score, evidence, stages
            power = np.zeros(len(z))
            power[rows] = power_that_leaves_half(cloud.log_weights[rows], score[rows], left[rows])
            weighted, log_mean, _ = weigh(cloud, power[:, None] * score)
            ancestors = self._ancestors(weighted, rows)
            copies = pick(cloud.components, rows, ancestors)
            mean, h = weighted.mean[rows], np.full((1, 1, 1), self._bandwidth)
            noise = standard_normals(chosen(cloud.streams.jitter, rows), *copies.shape[1:])
            copies = contracted(copies, mean, h) + self._bandwidth * spread(square_root(weighted.covariance[rows]), noise)
            cloud = self._settle(replace(cloud, components=put(cloud.components, rows, copies)), rows)
            score = put(score, rows, self._log_likelihood(predicted, cloud.components, z, step)[rows])
            left -= power
            evidence[rows] += log_mean[rows]
            stages[rows] += 1

    def _move(
        self, cloud: Cloud, predicted: Cloud, score: Array, rows: Rows, ancestors: Rows, z: Array, step: Step
    ) -> Cloud:
        """Return the cloud after Metropolis moves in the chosen runs.

        A particle is f(ancestor) + G xi. xi* = sqrt(1 - s^2) xi + s eta leaves its standard normal density as it is,
        so the likelihoods alone decide about xi*.
        """
        assert predicted.centres is not None and predicted.noise is not None and predicted.root is not None
        root = predicted.root
        if root.ndim == 4:
            root = pick(root, rows, ancestors, axis=0)
        elif root.ndim == 3:
            root = root[rows]
        centres = pick(predicted.centres, rows, ancestors)
        noise = pick(predicted.noise, rows, ancestors)
        current = pick(score, rows, ancestors)
        components = cloud.components
        s = self._move_size
        for _ in range(self._moves):
            fresh = standard_normals(chosen(cloud.streams.moves, rows), noise.shape[1], self._particles)
            fresh = np.sqrt(1 - s**2) * noise + s * fresh
            proposed = put(components, rows, centres + spread(root, fresh))
            new = self._log_likelihood(predicted, proposed, z, step)[rows]
            accepted = accept(new - current, chosen(cloud.streams.acceptance, rows))
            components = put(components, rows, np.where(accepted[:, None], proposed[rows], components[rows]))
            noise = np.where(accepted[:, None], fresh, noise)
            current = np.where(accepted, new, current)
        return replace(cloud, components=components)
