"""Unscented particle filter: every particle is drawn where the measurement points."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Innovation
from relnav_sim.filters.operations import Operations, Size
from relnav_sim.filters.particle import particle_operations
from relnav_sim.filters.particle_set import (
    ParticleSet,
    chosen,
    pick,
    pick_roots,
    put,
    roots_of,
    spread,
    standard_normals,
    wrapped_components,
)
from relnav_sim.filters.particle_set_filter import ParticleSetFilter, ParticleSetOptions, accept, weigh
from relnav_sim.filters.registry import register_filter
from relnav_sim.linalg import by_run, transpose
from relnav_sim.measurements.interface import Measurement


class UnscentedParticleOptions(ParticleSetOptions):
    """Options of the unscented particle filter."""

    mcmc_steps: int = Field(
        default=1,
        ge=0,
        le=100,
        description="Metropolis-Hastings moves of every particle after resampling, proposed from the ancestor's "
        "own q; default 1, as van der Merwe et al. (2000)",
    )


@dataclass(frozen=True)
class Proposal:
    """Every particle's q, in the coordinates xi of its process noise, x = f(ancestor) + G xi, where p is N(0, I).

    q = N(mean, A A^T), A = A_1 A_2 ... A_m with A_a = I - u_a u_a^T / (1 + s_a), one factor for each component of z.

    Args:
        centres: f(ancestor), (runs, n, N).
        root: G, (n, r), (runs, n, r) or (runs, N, n, r).
        mean: (runs, r, N).
        directions: u, (runs, m, r, N).
        shrinkage: s, (runs, m, N): A_a shortens u_a by this factor.
    """

    centres: Array
    root: Array
    mean: Array
    directions: Array
    shrinkage: Array

    def draw(self, normals: Array) -> tuple[Array, Array]:
        """Return particles (runs, n, N) from standard normals (runs, r, N), and the logarithm of p / q there."""
        xi, log_ratio = kernels.proposal.draw(self.mean, self.directions, self.shrinkage, normals)
        return spread(self.centres, self.root, xi), log_ratio

    def of(self, rows: Indices, ancestors: Indices) -> Proposal:
        """Return the proposals of the chosen runs' ancestors."""
        return Proposal(
            pick(self.centres, rows, ancestors),
            pick_roots(self.root, rows, ancestors),
            pick(self.mean, rows, ancestors),
            pick(self.directions, rows, ancestors),
            pick(self.shrinkage, rows, ancestors),
        )


def unscented_particle_operations(size: Size, options: Any) -> Operations:
    """Return what it costs: `particle`, an unscented update for every particle, and its Metropolis moves."""
    n, m, N, moves = size.n, size.m, options.particles, options.mcmc_steps
    proposal = 3 * n * n + 23 * m // 6 + 9 * m * m // 2 + 2 * m**3 // 3 - n + 21 * n * m // 2 + 11 * n * m * m // 2
    density = 4 * n * m + 5 * n + 2 * m + 1
    moved = n * (n + 1) + m * m + 4 * m + 1 + density
    plain = particle_operations(size, options)
    return Operations(plain.count + N * (proposal + n * (n + 1) + density + moves * moved), plain.numbers)


@register_filter(
    "unscented_particle",
    UnscentedParticleOptions,
    cost_us=650.0,
    overhead_us=530.0,
    operations=unscented_particle_operations,
)
class UnscentedParticleFilter(ParticleSetFilter):
    """Unscented particle filter: each particle is drawn from an unscented Kalman update of its own, then weighed.

    Van der Merwe, Doucet, de Freitas and Wan, The Unscented Particle Filter, Cambridge, CUED/F-INFENG/TR 380, 2000.
    The proposal q of a particle starts from its own transition density N(f(ancestor), Q), whose sigma points go through
    the measurement; weights p(z | x) p(x | ancestor) / q(x); resampling copies a particle together with its q, and a
    Metropolis-Hastings move then draws it anew from there.

    Use it where the measurement is precise against the process noise: `particle` then wastes most of its particles.
    With a linear measurement q is the optimal proposal. The published filter carries a covariance with every particle
    and adds it to Q, which in orbit, where Q is tiny, makes q far wider than p and leaves one particle with all the
    weight; here that covariance is zero. All densities are taken in the coordinates of the process noise, so Q may be
    as small as it likes, and singular. Where the last measurement led to resampling, and at the start, the copies'
    kernel (`roughening`) widens the transition density, so that a proposal corrects the whole state and not only what
    the process noise reached in one step (the pre-regularised filter of Musso, Oudjane and Le Gland 2001).

    `log_likelihood`, `nis`, `ess` and `resampled` as in `particle`; `accepted` is the share of accepted moves.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: UnscentedParticleOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._moves = options.mcmc_steps
        self._keeps_centres = True

    def update(self, belief: ParticleSet, z: Array, step: Step) -> tuple[ParticleSet, Innovation]:
        """Return the set drawn from the proposals, reweighted and, where few particles count, resampled and moved."""
        belief = self._parted(belief)
        assert belief.noise is not None
        proposal = self._propose(belief, z, step)
        components, log_ratio = proposal.draw(belief.noise)
        score = self._log_likelihood(belief, components, z, step) + log_ratio
        particle_set, evidence, ess = weigh(replace(belief, components=components), score)
        particle_set, innovation = self._record(belief, particle_set, z, step, evidence, ess)
        accepted = np.full(len(z), np.nan)
        rows = self._resampled_runs(ess)
        if len(rows):
            ancestors = self._ancestors(particle_set, rows)
            copies = pick(particle_set.components, rows, ancestors)
            particle_set = replace(particle_set, components=put(particle_set.components, rows, copies))
            if self._moves:
                current = pick(score, rows, ancestors)
                particle_set, accepted[rows] = self._move(
                    particle_set, belief, proposal.of(rows, ancestors), current, rows, z, step
                )
            particle_set = self._estimated(self._settle(particle_set, rows, ess[rows]), rows)
        innovation = replace(innovation, extras={**innovation.extras, "accepted": accepted})
        return self._for_next_sensor(particle_set, belief), innovation

    def _propose(self, predicted: ParticleSet, z: Array, step: Step) -> Proposal:
        """Return every particle's unscented update of its own transition density.

        The sigma points are +- sqrt(r) e_j in xi; see `kernels.proposal.propose`.
        """
        assert predicted.centres is not None and predicted.root is not None
        centres, epoch, measurement = predicted.centres, step.epoch, self.measurement
        runs, _, N = centres.shape
        roots = roots_of(predicted.root)
        centre = measurement.predict(transpose(centres), epoch)
        images = np.empty((roots.shape[-1], runs, 2, N, measurement.dimension))
        for j, image in enumerate(images):
            image[...] = measurement.predict(transpose(kernels.proposal.sigma_points(centres, roots, j)), epoch)
        reading, angle = z[:, None], wrapped_components(measurement)
        if angle is None:
            # Its own differences instead of images, from zero.
            reading = measurement.residual(reading, centre)
            for image in images:
                image[...] = measurement.residual(image, centre[:, None])
            centre, angle = np.zeros(centre.shape), np.zeros(measurement.dimension, dtype=bool)
        reading, centre = np.ascontiguousarray(reading), np.ascontiguousarray(centre)
        R = by_run(measurement.noise(predicted.mean, epoch))
        mean, directions, shrinkage = kernels.proposal.propose(images, centre, reading, angle, R)
        return Proposal(centres, predicted.root, mean, directions, shrinkage)

    def _move(
        self,
        particle_set: ParticleSet,
        predicted: ParticleSet,
        proposal: Proposal,
        current: Array,
        rows: Indices,
        z: Array,
        step: Step,
    ) -> tuple[ParticleSet, Array]:
        """Return the set after Metropolis-Hastings moves in the chosen runs, and their share of accepted moves.

        Args:
            particle_set: Resampled.
            predicted: The particle set before the measurement.
            proposal: The chosen runs' proposals, of the resampled particles' ancestors.
            current: log p(z | x) p(x | ancestor) / q(x) of the chosen runs' particles.
            rows: The chosen runs.
            z: The measurement.
            step: The epoch.
        """
        components = particle_set.components
        r = proposal.mean.shape[1]
        share = np.zeros(len(rows))
        for _ in range(self._moves):
            drawn, log_ratio = proposal.draw(
                standard_normals(chosen(particle_set.streams.moves, rows), r, self._particles)
            )
            proposed = put(components, rows, drawn)
            new = self._log_likelihood(predicted, proposed, z, step)[rows] + log_ratio
            accepted = accept(new - current, chosen(particle_set.streams.acceptance, rows))
            components = put(components, rows, np.where(accepted[:, None], drawn, components[rows]))
            current = np.where(accepted, new, current)
            share += accepted.mean(axis=1) / self._moves
        return replace(particle_set, components=components), share
