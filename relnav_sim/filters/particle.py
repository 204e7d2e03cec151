"""Bootstrap particle filter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Innovation
from relnav_sim.filters.operations import (
    Operations,
    Size,
    cholesky,
    covariance_prediction,
    kalman_update,
    particle_numbers,
    weighing,
)
from relnav_sim.filters.particle_set import (
    ParticleSet,
    chosen,
    contracted,
    pick,
    pick_roots,
    put,
    smoothing,
    spread,
    square_root,
    standard_normals,
)
from relnav_sim.filters.particle_set_filter import ParticleSetFilter, ParticleSetOptions, accept, weigh
from relnav_sim.filters.registry import register_filter
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import channel_count

# Each halves the particle set, so they reach a likelihood that takes one in 2^50.
_MOST_STAGES = 50


class ParticleOptions(ParticleSetOptions):
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


def particle_operations(size: Size, options: Any) -> Operations:
    """Return what particles cost: moved by noise, weighed twice, parted by the kernel; NIS is of a Kalman update.

    Random numbers, exponentials and the choice of who is copied do not count, nor do steps of Metropolis.
    """
    n, m, N = size.n, size.m, options.particles
    noise = N * (2 * n + n * (n + 1)) + cholesky(n) + 2 * n * n
    likelihood = N * (m * m + 4 * m + 1) + cholesky(m)
    weights = 2 * weighing(n, N)
    count = covariance_prediction(n) + kalman_update(n, m) + noise + likelihood + weights
    return Operations(count, particle_numbers(n, m, N))


@register_filter("particle", ParticleOptions, cost_us=150.0, overhead_us=125.0, operations=particle_operations)
class ParticleFilter(ParticleSetFilter):
    """Bootstrap particle filter: draw from the dynamics, weigh by the likelihood, resample when few particles count.

    Gordon, Salmond and Smith, IEE Proc. F 140(2), 1993; resampling when the effective sample size is low (Liu and Chen
    1995); optional Metropolis moves (Gilks and Berzuini 2001) that draw part of the process noise anew (Cotter et al.
    2013), so they hold for any process noise, also a singular one. Mean and covariance are taken before resampling,
    unless `estimate` says otherwise.

    Use it where the belief is not a Gaussian at all: several hypotheses, strong curvature, glint with its true mixture.
    It handles any likelihood and any dynamics, but needs particles where the measurement is precise: the share of the
    prediction that a measurement leaves must hold many of them. With the small process noise of an orbit copies never
    part again and the set would die out, which `ess` does not show. `roughening`, on by default, parts copies by a
    kernel, and goes through a measurement that would leave fewer than one particle in twenty in several tempered stages
    (Musso, Oudjane and Le Gland 2001, progressive correction); or prefer `unscented_particle`.

    `log_likelihood` is the logarithm of the evidence's estimate; without roughening the evidence itself is unbiased,
    its logarithm is low by half its variance. NIS uses the predicted set's mean and covariance with the measurement
    linearised there, so it is chi-square only as far as the set is Gaussian. Records `ess`, `resampled` and, with
    roughening, `stages`.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: ParticleOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._moves = options.mcmc_steps
        self._move_size = options.mcmc_step_size
        self._keeps_centres |= self._moves > 0
        self._fewest = options.particles / 20

    def update(self, belief: ParticleSet, z: Array, step: Step) -> tuple[ParticleSet, Innovation]:
        """Return the reweighted and, in runs with few effective particles, resampled set; and its innovation."""
        belief = self._parted(belief)
        score = self._log_likelihood(belief, belief.components, z, step)
        particle_set, evidence, ess = weigh(belief, score)
        stages = np.zeros(len(z))
        if self._bandwidth > 0 and (ess < self._fewest).any():
            approached, left_over, before, stages = self._approach(belief, score, z, step)
            particle_set, last, ess = weigh(approached, left_over)
            evidence = before + last
        particle_set, innovation = self._record(belief, particle_set, z, step, evidence, ess)
        if self._bandwidth > 0:
            innovation = replace(innovation, extras={**innovation.extras, "stages": stages + 1})
        rows = self._resampled_runs(ess)
        if len(rows):
            ancestors = self._ancestors(particle_set, rows)
            copies = pick(particle_set.components, rows, ancestors)
            particle_set = replace(particle_set, components=put(particle_set.components, rows, copies))
            # After a tempered stage a particle is no longer f(ancestor) + G xi, which the moves rest on.
            drawn = stages[rows] == 0
            if self._moves and drawn.any():
                particle_set = self._move(particle_set, belief, score, rows[drawn], ancestors[drawn], z, step)
            particle_set = self._estimated(self._settle(particle_set, rows, ess[rows]), rows)
        return self._for_next_sensor(particle_set, belief), innovation

    def _approach(
        self, particle_set: ParticleSet, score: Array, z: Array, step: Step
    ) -> tuple[ParticleSet, Array, Array, Array]:
        """Return the set after tempered stages, in runs where the whole measurement would leave too few particles.

        A stage takes the likelihood to the power that leaves half of the particles, resamples and applies the kernel.

        Args:
            particle_set: The prediction.
            score: log p(z | x), (runs, N).
            z: The measurement.
            step: The epoch.

        Returns:
            The set, the logarithm of the likelihood's part that is left over for it (runs, N), the logarithm of the
            evidence so far and the number of stages (runs,).
        """
        predicted, left = particle_set, np.ones(len(z))
        evidence, stages = np.zeros(len(z)), np.zeros(len(z))
        while True:
            power = kernels.particles.power_that_leaves_half(particle_set.log_weights, score, left, self._fewest)
            power[stages == _MOST_STAGES] = 0
            rows = np.flatnonzero(power)
            if not len(rows):
                return particle_set, left[:, None] * score, evidence, stages
            weighted, log_mean, ess = weigh(particle_set, power[:, None] * score)
            ancestors = self._ancestors(weighted, rows)
            observed = np.broadcast_to(channel_count(self.measurement), len(z))
            share, width = smoothing(ess[rows], self._bandwidth, observed[rows])
            noise = standard_normals(chosen(particle_set.streams.jitter, rows), *particle_set.components.shape[1:])
            covariance = weighted.covariance[rows] / (1 - 1 / ess[rows, None, None])
            copies = contracted(pick(particle_set.components, rows, ancestors), weighted.mean[rows], share)
            parted = spread(copies, square_root(width * covariance), noise)
            particle_set = replace(particle_set, components=put(particle_set.components, rows, parted))
            particle_set = self._settle(particle_set, rows, np.full(len(rows), np.inf))
            score = put(score, rows, self._log_likelihood(predicted, particle_set.components, z, step)[rows])
            left -= power
            evidence[rows] += log_mean[rows]
            stages[rows] += 1

    def _move(
        self,
        particle_set: ParticleSet,
        predicted: ParticleSet,
        score: Array,
        rows: Indices,
        ancestors: Indices,
        z: Array,
        step: Step,
    ) -> ParticleSet:
        """Return the particle set after Metropolis moves in the chosen runs.

        A particle is f(ancestor) + G xi. xi* = sqrt(1 - s^2) xi + s eta leaves its standard normal density as it is,
        so the likelihoods alone decide about xi*.
        """
        assert predicted.centres is not None and predicted.noise is not None and predicted.root is not None
        root = pick_roots(predicted.root, rows, ancestors)
        centres = pick(predicted.centres, rows, ancestors)
        noise = pick(predicted.noise, rows, ancestors)
        current = pick(score, rows, ancestors)
        components = particle_set.components
        s = self._move_size
        for _ in range(self._moves):
            fresh = standard_normals(chosen(particle_set.streams.moves, rows), noise.shape[1], self._particles)
            fresh = np.sqrt(1 - s**2) * noise + s * fresh
            proposed = put(components, rows, spread(centres, root, fresh))
            new = self._log_likelihood(predicted, proposed, z, step)[rows]
            accepted = accept(new - current, chosen(particle_set.streams.acceptance, rows))
            components = put(components, rows, np.where(accepted[:, None], proposed[rows], components[rows]))
            noise = np.where(accepted[:, None], fresh, noise)
            current = np.where(accepted, new, current)
        return replace(particle_set, components=components)
