"""What the particle filters share: drawing, predicting, weighing and resampling a particle set."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices, Mask
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, KeepsModels
from relnav_sim.filters.kalman import joseph_update
from relnav_sim.filters.particle_set import (
    ParticleSet,
    ParticleStreams,
    average,
    chosen,
    contracted,
    kernel_bandwidth,
    log_likelihood,
    moments,
    put,
    roots_of,
    smoothing,
    spread,
    square_root,
    standard_normals,
)
from relnav_sim.filters.resampling import Resampling, draw_ancestors
from relnav_sim.linalg import by_run, symmetric, transpose
from relnav_sim.measurements.interface import Measurement, linearised
from relnav_sim.measurements.partial import channel_count, sensors_of
from relnav_sim.options import AddedLater, Options, Tunable
from relnav_sim.streams import RandomSource, Streams

NO_LIKELIHOOD = "no particle gives the measurement a finite likelihood"


class ParticleSetOptions(Options):
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
    roughening: Annotated[float, Tunable(0, 2, log=False)] = Field(
        default=1.0,
        ge=0,
        description="Width of the kernel that parts resampled particles, in units of the optimal one, h = (4 / (n + "
        "2))^(1 / (n + 4)) N^(-1 / (n + 4)); particles move towards the mean, so that the covariance grows by no "
        "more than so few particles leave uncertain (Liu and West 2001). Default 1: the process noise of an orbit is "
        "too small to part copies; 0 is the text-book filter, whose evidence is unbiased, without tempered stages",
    )
    estimate: Annotated[Literal["before_resampling", "after_resampling"], AddedLater()] = Field(
        default="before_resampling",
        description="Which particles the estimate is the mean of. before_resampling: the weighted ones; "
        "after_resampling: where they were resampled, the copies, after any Metropolis moves, as Wei et al. (2012) "
        "have it: on average the same, with the noise of resampling added. The covariance is that of the weighted ones",
    )


class ParticleSetFilter(KeepsModels):
    """Starting, predicting, weighting and resampling a particle set; `update` is the algorithm's own."""

    stochastic = True
    double_only = "it is made of particles, and weighs them in float64"

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: ParticleSetOptions) -> None:
        self.dynamics = dynamics
        self.measurement = measurement
        self._particles = options.particles
        self._resampling = options.resampling
        self._ess_threshold = options.ess_fraction * options.particles
        self._bandwidth = options.roughening * kernel_bandwidth(dynamics.dimension, options.particles)
        if self._bandwidth > 1:
            raise ValueError(f"roughening must not exceed {options.roughening / self._bandwidth:.3g} with these sizes")
        self._estimates_copies = options.estimate == "after_resampling"
        self._rooted: tuple[Array, Array] | None = None
        self._several = len(sensors_of(measurement)) > 1
        self._keeps_centres = self._several

    def start(self, prior: Gaussian, source: RandomSource) -> ParticleSet:
        """Return particles drawn from the prior."""
        streams = ParticleStreams.of(source, "particle")
        runs, n = prior.mean.shape
        noise = standard_normals(source.streams("filter.particle.start"), n, self._particles)
        means = np.repeat(prior.mean[:, :, None], self._particles, axis=2)
        components = spread(means, square_root(prior.covariance), noise)
        log_weights = np.full((runs, self._particles), -np.log(self._particles))
        parents = np.full(runs, float(self._particles))
        return ParticleSet(components, log_weights, prior.mean, prior.covariance, parents, streams)

    def predict(self, belief: ParticleSet, step: Step) -> ParticleSet:
        """Return the particle set carried over one step, every particle with its own draw of the process noise."""
        share, width = np.ones((1, 1, 1)), np.zeros((1, 1, 1))
        if self._bandwidth > 0:
            # The kernel joins the process noise instead of being drawn from at once, so that a proposal can use it too
            # (the pre-regularised filter of Musso, Oudjane and Le Gland 2001).
            share, width = smoothing(belief.parents, self._bandwidth, channel_count(self.measurement))
        F = by_run(self.dynamics.transition(belief.mean, step))
        carried = kernels.kalman.predict(belief.covariance, F, np.zeros((1, *F.shape[1:])))
        if self.dynamics.linear:
            Q = self.dynamics.process_noise(transpose(belief.components), step)
            # F (m + a (x - m)) = (a F) x + (1 - a) F m spares a pass over the particles.
            mean = (F @ belief.mean[:, :, None])[:, :, 0]
            centres = kernels.particles.affine(belief.components, share * F, (1 - share[..., 0]) * mean)
            covariance = share**2 * carried
        else:
            states = transpose(contracted(belief.components, belief.mean, share))
            Q = self.dynamics.process_noise(states, step)
            centres = np.array(transpose(self.dynamics.propagate(states, step)), order="C")
            mean, covariance = moments(centres, belief.log_weights)
        covariance = covariance + average(Q, belief)
        if self._bandwidth > 0:
            kernel = width * carried
            covariance += kernel
            Q = Q + (kernel if Q.ndim < 4 else kernel[:, None])
        root = self._root(Q)
        noise = standard_normals(belief.streams.noise, root.shape[-1], self._particles)
        kept = centres.copy() if self._keeps_centres else None
        kernels.particles.add_noise(centres, roots_of(root), noise)
        parents = np.full(len(mean), np.inf)
        return ParticleSet(centres, belief.log_weights, mean, covariance, parents, belief.streams, kept, noise, root)

    def _root(self, Q: Array) -> Array:
        """Return G with G G^T = Q; one that all runs share is kept until it changes."""
        if Q.ndim > 2:
            return square_root(Q)
        if self._rooted is None or not np.array_equal(self._rooted[0], Q):
            self._rooted = (Q.copy(), square_root(Q))
        return self._rooted[1]

    def _log_likelihood(self, predicted: ParticleSet, components: Array, z: Array, step: Step) -> Array:
        """Return log p(z | x) of particles (runs, n, N): (runs, N); the noise is that at the prediction's mean."""
        score = log_likelihood(self.measurement, z, transpose(components), predicted.mean, step.epoch)
        return np.ascontiguousarray(score)

    def _record(
        self, predicted: ParticleSet, particle_set: ParticleSet, z: Array, step: Step, evidence: Array, ess: Array
    ) -> tuple[ParticleSet, Innovation]:
        """Return the weighed particle set with its final covariance, and the innovation.

        NIS is that of the predicted particle set's mean and covariance, with h linearised there. Weighted particles
        underestimate the covariance by its 1 / ess part, and by all of it where one has all the weight; the Kalman
        update of the predicted moments stands in for that part.
        """
        mean, epoch = predicted.mean, step.epoch
        predicted_moments = Gaussian(mean, predicted.covariance)
        kalman, innovation = joseph_update(predicted_moments, *linearised(self.measurement, z, mean, epoch))
        extras = {"ess": ess, "resampled": (ess < self._ess_threshold).astype(float)}
        covariance = particle_set.covariance + kalman.covariance / ess[:, None, None]
        failed = {place: NO_LIKELIHOOD for place in np.flatnonzero(~np.isfinite(evidence)).tolist()}
        return replace(particle_set, covariance=covariance), Innovation(innovation.nis, evidence, extras, failed)

    def _resampled_runs(self, ess: Array) -> Indices:
        return np.flatnonzero(ess < self._ess_threshold)

    def _ancestors(self, particle_set: ParticleSet, rows: Indices) -> Indices:
        return draw_ancestors(
            self._resampling, particle_set.weights[rows], chosen(particle_set.streams.resampling, rows)
        )

    def _settle(self, particle_set: ParticleSet, rows: Indices, ess: Array) -> ParticleSet:
        """Return the particle set with equal weights in the resampled runs; ess is theirs before, (resampled runs,)."""
        equal = np.full((len(rows), self._particles), -np.log(self._particles))
        return replace(
            particle_set,
            log_weights=put(particle_set.log_weights, rows, equal),
            parents=put(particle_set.parents, rows, ess),
        )

    def _estimated(self, particle_set: ParticleSet, rows: Indices) -> ParticleSet:
        """Return the particle set with the mean that is to be the estimate in the resampled runs."""
        if not self._estimates_copies:
            return particle_set
        mean, _ = moments(particle_set.components[rows], particle_set.log_weights[rows])
        return replace(particle_set, mean=put(particle_set.mean, rows, mean))

    def _for_next_sensor(self, particle_set: ParticleSet, predicted: ParticleSet) -> ParticleSet:
        """Return an updated particle set as the prediction of the epoch's next sensor, if there are several.

        Its particles have no process noise left to draw: they are their own centres, and the root is zero. Runs that
        did not read this sensor keep what they were predicted from.
        """
        if not self._several:
            return particle_set
        assert predicted.noise is not None and predicted.root is not None
        root = predicted.root
        shape = (len(particle_set.mean), *root.shape[-2:]) if root.ndim < 4 else root.shape
        return replace(
            particle_set, centres=particle_set.components, noise=np.zeros(predicted.noise.shape), root=np.zeros(shape)
        )

    def _parted(self, belief: ParticleSet) -> ParticleSet:
        """Return the prediction of an epoch's further sensor with the copies parted that the last one has left.

        As in `predict` the kernel takes the place of the process noise; after a prediction there are no copies.
        """
        if not self._several or self._bandwidth == 0:
            return belief
        rows = np.flatnonzero(np.isfinite(belief.parents))
        if not len(rows):
            return belief
        assert belief.centres is not None and belief.noise is not None and belief.root is not None
        observed = np.broadcast_to(channel_count(self.measurement), len(belief.mean))[rows]
        share, width = smoothing(belief.parents[rows], self._bandwidth, observed)
        kernel = symmetric(width * belief.covariance[rows])
        root = square_root(kernel)
        noise = standard_normals(chosen(belief.streams.noise, rows), root.shape[-1], self._particles)
        centres = contracted(belief.components[rows], belief.mean[rows], share)
        own_root = root if belief.root.ndim == 3 else np.repeat(root[:, None], self._particles, axis=1)
        return replace(
            belief,
            components=put(belief.components, rows, spread(centres, root, noise)),
            covariance=put(belief.covariance, rows, share**2 * belief.covariance[rows] + kernel),
            parents=put(belief.parents, rows, np.full(len(rows), np.inf)),
            centres=put(belief.centres, rows, centres),
            noise=put(belief.noise, rows, noise),
            root=put(belief.root, rows, own_root),
        )


def weigh(particle_set: ParticleSet, log_increments: Array) -> tuple[ParticleSet, Array, Array]:
    """Return the reweighted particle set, with its moments; the evidence's logarithm; and the effective sample size.

    The weights' mean increment estimates p(z_k | z_1 ... z_{k-1}); the product over k is unbiased (Del Moral 2004). A
    particle without a finite likelihood (NaN, or infinite) gets weight zero; a run in which all are such turns to NaN.

    Args:
        particle_set: Particles with the weights they had.
        log_increments: Logarithm of every particle's new factor, (runs, N).
    """
    log_weights, mean, covariance, evidence, ess, lost = kernels.particles.weigh(
        particle_set.components, particle_set.log_weights, log_increments
    )
    components = particle_set.components
    if lost.any():
        # A particle that weighs nothing has to have a state all the same.
        absent = (log_weights == -np.inf)[:, None] & ~np.isfinite(components)
        components = np.where(absent, particle_set.mean[:, :, None], components)
    weighted = ParticleSet(components, log_weights, mean, covariance, particle_set.parents, particle_set.streams)
    return weighted, evidence, ess


def usable(log_weights: Array) -> Array:
    """Return the same with minus infinity, weight zero, for NaN and plus infinity, which no density is."""
    return np.where(log_weights < np.inf, log_weights, -np.inf)


def accept(log_ratio: Array, streams: Streams) -> Mask:
    """Return which Metropolis proposals (runs, N) are accepted, by the logarithm of their ratio."""
    accepted: Mask = np.log1p(-streams.uniform(log_ratio.shape[1])) < usable(log_ratio)
    return accepted
