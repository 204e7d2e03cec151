"""Measurement noise as a user gives it: one covariance, one an epoch, one a run and epoch, or a mixture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.given_arrays import covariances, numbers
from relnav_sim.measurements.interface import Mixture


@dataclass(frozen=True)
class MixtureNoise:
    """Zero-mean Gaussian mixture noise.

    Args:
        weights: (k,) positive, summing to 1.
        covariances: (k, m, m).
        shared: True when one switch draws the component for all channels at once; False when each channel
            switches by itself (the covariances must then be diagonal).

    Raises:
        ValueError: Shapes that do not fit, weights that are not positive or do not sum to 1, or a matrix that is no
            covariance.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearMeasurement, MixtureNoise
        >>> glint = MixtureNoise([0.9, 0.1], [[[1.0]], [[25.0]]])  # one measurement in ten is five times as noisy
        >>> LinearMeasurement([[1.0, 0.0]], glint).dimension
        1
    """

    weights: Array
    covariances: Array
    shared: bool = True

    def __post_init__(self) -> None:
        weights = numbers(self.weights, "weights of MixtureNoise")
        matrices = covariances(self.covariances, "covariances of MixtureNoise", "(k, m, m)", [["component"]])
        if weights.shape != matrices.shape[:1]:
            raise ValueError(
                f"MixtureNoise has weights of shape {weights.shape} and covariances of shape {matrices.shape}; "
                "they must be (k,) and (k, m, m)"
            )
        if not (weights > 0).all() or not abs(weights.sum() - 1) <= 1e-9:
            raise ValueError(f"the weights of MixtureNoise must be positive and sum to 1; they are {weights.tolist()}")
        if not self.shared and not np.array_equal(matrices * np.eye(matrices.shape[-1]), matrices):
            raise ValueError("MixtureNoise with shared=False needs diagonal covariances")
        weights = weights.copy()
        for array in (weights, matrices):
            array.setflags(write=False)  # what follows from them is remembered
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "covariances", matrices)

    @cached_property
    def covariance(self) -> Array:
        """The total (moment-matched) covariance (m, m), read-only."""
        total: Array = np.einsum("k,kij->ij", self.weights, self.covariances)
        total.setflags(write=False)
        return total


def checked_noise(noise: ArrayLike | MixtureNoise, dimension: int | None) -> Array | MixtureNoise:
    """Return a noise as given, checked: a copy that can't be written to.

    Args:
        noise: (m, m), (T, m, m), (runs, T, m, m) or a mixture.
        dimension: Number m of components; None: any.

    Raises:
        ValueError: It is no covariance, or for another number of components.
    """
    if isinstance(noise, MixtureNoise):
        size = noise.covariances.shape[-1]
    else:
        shapes = "(m, m), (T, m, m) or (runs, T, m, m)"
        noise = covariances(noise, "noise", shapes, ([], ["epoch"], ["run", "epoch"]))
        noise.setflags(write=False)  # who is given a part of it and writes into that would change the next epochs
        size = noise.shape[-1]
    if dimension is not None and size != dimension:
        raise ValueError(f"noise is for {size} components, the measurement has {dimension}")
    return noise


def check_noise_extent(noise: Array | MixtureNoise, runs: int, epochs: int) -> None:
    """Refuse a block of measurements that the noise is not for.

    Raises:
        ValueError: It has other runs, or more epochs, than the noise.
    """
    if isinstance(noise, MixtureNoise) or noise.ndim == 2:
        return
    if noise.ndim == 4 and len(noise) != runs:
        raise ValueError(f"noise is given for {len(noise)} runs, the measurements have {runs}")
    if noise.shape[-3] < epochs:
        raise ValueError(f"noise is given for {noise.shape[-3]} epochs, the measurements have {epochs}")


def noise_at(noise: Array | MixtureNoise, epoch: int) -> Array:
    """Return R of an epoch, (m, m) or (runs, m, m)."""
    if isinstance(noise, MixtureNoise):
        return noise.covariance
    if noise.ndim == 2:
        return noise
    epochs = noise.shape[0] if noise.ndim == 3 else noise.shape[1]
    if epoch >= epochs:
        raise ValueError(f"noise is given for {epochs} epochs, but there is an epoch {epoch}")
    matrix: Array = noise[epoch] if noise.ndim == 3 else noise[:, epoch]
    return matrix


def mixture_of(noise: Array | MixtureNoise) -> Mixture | None:
    """Return the components of a noise that is a mixture, else None."""
    if isinstance(noise, MixtureNoise):
        return Mixture(noise.weights, noise.covariances, noise.shared)
    return None
