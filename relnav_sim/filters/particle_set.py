"""The particle set of weighted particles that the particle filters carry, and the Gaussian arithmetic on it.

States are stored component by component, (runs, n, particles): each component is contiguous, which makes everything
elementwise fast, and products with n x n matrices are one matrix product per run.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import prod

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices, Integers, Mask
from relnav_sim.linalg import (
    by_run,
    mixture_log_density,
    transpose,
)
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults, has_own_density
from relnav_sim.measurements.partial import all_channels, present_channels
from relnav_sim.read_only_call import called_read_only
from relnav_sim.streams import RandomSource, Streams


@dataclass(frozen=True)
class ParticleStreams:
    """The random streams of a particle filter, one kind of draw each."""

    noise: Streams
    resampling: Streams
    jitter: Streams
    moves: Streams
    acceptance: Streams

    @classmethod
    def of(cls, source: RandomSource, kind: str) -> ParticleStreams:
        """Return the streams ``filter.<kind>.<draw>``."""
        return cls(*(source.streams(f"filter.{kind}.{draw}") for draw in cls.__dataclass_fields__))


@dataclass(frozen=True)
class ParticleSet:
    """Weighted particles.

    `mean` and `covariance` are those of the weighted particles before resampling, which only adds noise to them.

    Args:
        components: Particles by component, (runs, n, N).
        log_weights: Normalised, (runs, N).
        mean: (runs, n).
        covariance: (runs, n, n).
        parents: Effective number of particles that these were drawn from since the last prediction, (runs,); infinite
            where they were not drawn anew.
        streams: Random streams of the runs.
        centres: f(ancestor) of every particle (runs, n, N), between a prediction and its update, where that needs it.
        noise: The standard normal numbers that led from there to the particle, (runs, r, N), between the two.
        root: What they were multiplied by, (n, r), (runs, n, r) or (runs, N, n, r), likewise.
    """

    components: Array
    log_weights: Array
    mean: Array
    covariance: Array
    parents: Array
    streams: ParticleStreams
    centres: Array | None = None
    noise: Array | None = None
    root: Array | None = None

    @property
    def states(self) -> Array:
        """The particles as a view (runs, N, n)."""
        return transpose(self.components)

    @property
    def weights(self) -> Array:
        """The normalised weights (runs, N)."""
        return np.exp(self.log_weights)


def chosen(streams: Streams, rows: Indices) -> Streams:
    """Return the streams of some of the runs; drawing from them leaves the others' where they are."""
    return Streams([streams.generators[row] for row in rows])


def standard_normals(streams: Streams, *shape: int) -> Array:
    """Return standard normal numbers (runs, *shape), at a third of the cost of the generator's own method."""
    count = prod(shape)
    numbers = streams.uniform(count + count % 2)
    kernels.normals.box_muller(numbers)
    return numbers[:, :count].reshape(len(numbers), *shape)


def square_root(covariance: Array) -> Array:
    """Return G with G G^T = Q, lower triangular.

    A matrix that is only semidefinite gets a factor from its eigenvectors; one (n, n) that all runs share then has as
    many columns as its rank, so that no random number is drawn in vain.

    Args:
        covariance: Q, (n, n) or (..., n, n).
    """
    n = covariance.shape[-1]
    Q = np.ascontiguousarray(covariance).reshape(-1, n, n)
    G, regular = kernels.particles.roots(Q)
    if not regular.all():
        deficient = ~regular & np.isfinite(Q).all(axis=(1, 2))
        G[~regular] = np.nan
        G[deficient], rank = _semidefinite_roots(Q[deficient])
        if covariance.ndim == 2 and deficient[0]:
            G = G[:, :, n - rank[0] :]
    return G.reshape(*covariance.shape[:-1], G.shape[2])


def _semidefinite_roots(Q: Array) -> tuple[Array, Integers]:
    """Return G of semidefinite Q, (count, n, n), whose last columns alone are not zero; and the number of those."""
    deviation = np.sqrt(np.einsum("bii->bi", Q))
    scale = np.where(deviation > 0, deviation, 1.0)
    values, vectors = np.linalg.eigh(Q / (scale[:, :, None] * scale[:, None, :]))
    values = np.where(values > 1e-12 * np.maximum(values[:, -1:], 0), values, 0.0)
    return scale[:, :, None] * vectors * np.sqrt(values)[:, None], np.count_nonzero(values, axis=1)


def spread(centres: Array, root: Array, noise: Array) -> Array:
    """Return f + G xi for every particle, (runs, n, N).

    Args:
        centres: f, (runs, n, N).
        root: G, (n, r), (runs, n, r) or (runs, N, n, r).
        noise: xi, (runs, r, N).
    """
    particles = centres.copy()
    kernels.particles.add_noise(particles, roots_of(root), noise)
    return particles


def roots_of(root: Array) -> Array:
    """Return roots (n, r), (runs, n, r) or (runs, N, n, r) with all four axes, in C order for a kernel."""
    return np.ascontiguousarray(root if root.ndim == 4 else by_run(root)[:, None])


def moments(components: Array, log_weights: Array) -> tuple[Array, Array]:
    """Return mean (runs, n) and covariance (runs, n, n) of particles (runs, n, N) with log-weights (runs, N)."""
    _, mean, covariance, *_ = kernels.particles.weigh(components, log_weights, np.zeros(log_weights.shape))
    return mean, covariance


def log_likelihood(measurement: Measurement, z: Array, states: Array, mean: Array, epoch: int) -> Array:
    """Return log p(z | state) of particles (runs, N, n): (runs, N).

    A measurement's own function where it has one. The default one is worked out here, at a fraction of its cost: the
    particle set's mean, where the noise is wanted, is known.
    """
    if has_own_density(measurement):
        own = measurement.log_likelihood
        return np.asarray(
            called_read_only(lambda particles, at: own(z, particles, at), "log_likelihood", states, epoch), dtype=float
        )
    predicted, mixture = measurement.predict(states, epoch), measurement.mixture(mean, epoch)
    if mixture is not None:
        residual = measurement.residual(z[:, None], predicted)
        return mixture_log_density(residual, mixture.weights, mixture.covariances, mixture.shared)
    angle = wrapped_components(measurement)
    if angle is None:
        # A density that is symmetric does not see the sign.
        z, predicted = np.zeros(z.shape), measurement.residual(z[:, None], predicted)
        angle = np.zeros(measurement.dimension, dtype=bool)
    z, predicted = np.ascontiguousarray(z), np.ascontiguousarray(predicted)
    return kernels.likelihood.gaussian(z, predicted, angle, by_run(measurement.noise(mean, epoch)))


def wrapped_components(measurement: Measurement) -> Mask | None:
    """Return which components (m,) of a residual are wrapped as angles; None: it has a residual of its own."""
    complete = all_channels(measurement)
    function, owner = (getattr(complete.residual, name, None) for name in ("__func__", "__self__"))
    is_default = function is MeasurementDefaults.residual and owner is complete
    if present_channels(measurement) is not None or not is_default:
        return None
    angle = np.zeros(measurement.dimension, dtype=bool)
    angle[list(getattr(complete, "angles", ()))] = True
    return angle


def average(matrices: Array, particle_set: ParticleSet) -> Array:
    """Return the weighted mean over particles of matrices (runs, N, n, n); fewer axes are returned as they are."""
    if matrices.ndim < 4:
        return matrices
    return np.einsum("bp,bpij->bij", particle_set.weights, matrices)


def smoothing(parents: Array, bandwidth: float, observed: int | Integers) -> tuple[Array, Array]:
    """Return how far to draw particles to their mean, and the variance of the kernel to add, as shares (runs, 1, 1).

    Copies x of particles with mean m and covariance C become m + a (x - m) + noise with covariance k C: a^2 = 1 - h^2
    and, to keep the covariance, k = h^2 (Liu and West 2001). But the next update uses the inverse of a covariance that
    comes from p particles: the inverse of a Wishart matrix, for m_z measured components too large by (m_z + 1) / p in
    the mean (Furrer and Bengtsson 2007). Where there is hardly any process noise a set that does not allow for that
    becomes ever surer of itself; so k = h^2 + (m_z + 1) / p.

    Args:
        parents: p, the effective number of particles that were copied, (runs,); infinite where none were.
        bandwidth: h, in standard deviations of the particle set.
        observed: m_z, the number of measured components, for all runs or (runs,).
    """
    h = np.where(np.isinf(parents), 0.0, bandwidth)[:, None, None]
    return np.sqrt(1 - h**2), h**2 + ((observed + 1) / parents)[:, None, None]


def contracted(components: Array, mean: Array, share: Array) -> Array:
    """Return particles (runs, n, N) drawn to their mean (runs, n): m + share (x - m), share (runs, 1, 1)."""
    return kernels.particles.affine(components, share * np.eye(components.shape[1]), (1 - share[..., 0]) * mean)


def pick(array: Array, rows: Indices, ancestors: Indices) -> Array:
    """Return the entries of the chosen runs' ancestors, (chosen runs, ..., N).

    Args:
        array: (runs, ..., N).
        rows: The chosen runs.
        ancestors: (chosen runs, N).
    """
    runs, *shape, N = array.shape
    picked = kernels.resampling.copies(array.reshape(runs, -1, N), rows, ancestors)
    return picked.reshape(len(rows), *shape, N)


def pick_roots(roots: Array, rows: Indices, ancestors: Indices) -> Array:
    """Return the roots (n, r), (runs, n, r) or (runs, N, n, r) that go with the chosen runs' ancestors."""
    if roots.ndim == 2:
        return roots
    return roots[rows] if roots.ndim == 3 else roots[rows[:, None], ancestors]


def put(array: Array, rows: Indices, entries: Array) -> Array:
    """Return `array` with the chosen runs' entries replaced; it is left as it is, the rows are ascending."""
    if len(rows) == len(array):
        return entries
    changed = array.copy()
    changed[rows] = entries
    return changed


def kernel_bandwidth(n: int, particles: int) -> float:
    """Return Silverman's optimal width of a Gaussian kernel, in standard deviations of the set (1986, eq. 4.14)."""
    return float((4 / (n + 2)) ** (1 / (n + 4)) * particles ** (-1 / (n + 4)))
