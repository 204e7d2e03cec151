"""A linear measurement."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.given_arrays import finite, numbers
from relnav_sim.linalg import images
from relnav_sim.measurements.given_noise import MixtureNoise, check_noise_extent, checked_noise, mixture_of, noise_at
from relnav_sim.measurements.interface import MeasurementDefaults, Mixture, squares_of_linear


class LinearMeasurement(MeasurementDefaults):
    """Linear measurement z = H x + v.

    Args:
        matrix: H, (m, n).
        noise: R (m, m), (T, m, m) per epoch, (runs, T, m, m) per run and epoch, or a `MixtureNoise`.

    Raises:
        ValueError: Shapes that do not fit, entries that are not finite, or a noise that is no covariance.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearMeasurement, Step
        >>> position = LinearMeasurement([[1.0, 0.0]], [[0.25]])  # of a position and a velocity, sigma 0.5 m
        >>> position.predict(np.array([[7.0, 2.0]]), Step(0)).tolist()
        [[7.0]]
    """

    leaves_arguments_alone = True

    def __init__(self, matrix: ArrayLike, noise: ArrayLike | MixtureNoise) -> None:
        H = numbers(matrix, "matrix")
        if H.ndim != 2 or not H.size:
            raise ValueError(f"matrix has shape {H.shape}; it must be (m, n)")
        self._H = finite(H, "matrix", ("row", "column")).copy(order="C")
        self._H.setflags(write=False)  # a filter that wrote into it would change its next updates
        self.dimension, self.states = self._H.shape
        self.depends_on = tuple(np.flatnonzero(self._H.any(axis=0)).tolist())
        self._noise = checked_noise(noise, self.dimension)

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a block of measurements that the noise is not for.

        Raises:
            ValueError: It has other runs, or more epochs, than the noise.
        """
        check_noise_extent(self._noise, runs, epochs)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return H x, (runs, ..., m)."""
        return images(self._H, states)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return H, (m, n)."""
        return self._H

    def squared_errors(self, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
        """Return |W (z - H x)|^2 of the samples x = centre + root e, (runs, N)."""
        return squares_of_linear(self, z, W, centre, root, e, epoch)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R of this epoch, (m, m) or (runs, m, m)."""
        return noise_at(self._noise, epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the mixture's components, if the noise is one."""
        return mixture_of(self._noise)
