"""Measurements as a filter sees them: the interface, the linear case, and a user's own function."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.linalg import log_density, mixture_log_density
from relnav_sim.models.given_arrays import covariances, finite, numbers
from relnav_sim.models.read_only import called_read_only

Array = NDArray[np.float64]


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
        object.__setattr__(self, "weights", weights.copy())
        object.__setattr__(self, "covariances", matrices)

    @property
    def covariance(self) -> Array:
        """The total (moment-matched) covariance (m, m)."""
        total: Array = np.einsum("k,kij->ij", self.weights, self.covariances)
        return total


@dataclass(frozen=True)
class Mixture:
    """The components of a mixture noise at one epoch: weights (k,), covariances (k, m, m) or (runs, k, m, m)."""

    weights: Array
    covariances: Array
    shared: bool


class Measurement(Protocol):
    """What a sensor should read in a given state, z = h(x) + v, and how noisy the reading is."""

    dimension: int

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states), (runs, ..., n) -> (runs, ..., m)."""
        ...

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx at `states` (runs, ..., n): (runs, ..., m, n), or (m, n) where it is constant."""
        ...

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the covariance R of v at `mean` (runs, n): (m, m) or (runs, m, m)."""
        ...

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of v where it is a Gaussian mixture, else None."""
        ...

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return z - predicted with angles wrapped to [-pi, pi); shapes broadcast, last axis m."""
        ...

    def log_likelihood(self, z: Array, states: Array, epoch: int) -> Array:
        """Return log p(z | states) for z (runs, m) and states (runs, ..., n): (runs, ...)."""
        ...


def wrap_angle(angle: Array) -> Array:
    """Return the angle in [-pi, pi], rad. A value already inside is returned to the last bit."""
    return angle - 2 * np.pi * np.rint(angle / (2 * np.pi))


class MeasurementDefaults:
    """The parts of a measurement that follow from the others; a measurement may replace any.

    Attributes:
        angles: Components of z that are angles, rad.
        depends_on: States that z depends on; None: any. Sampling filters draw only those.
        states: Number n of states it is for; None: any.
    """

    angles: tuple[int, ...] = ()
    depends_on: tuple[int, ...] | None = None
    states: int | None = None

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states)."""
        raise TypeError(f"{type(self).__name__} has no predict(states, epoch)")

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R."""
        raise TypeError(f"{type(self).__name__} has no noise(mean, epoch)")

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return None: the noise is Gaussian."""
        return None

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return z - predicted with the components in `angles` wrapped."""
        difference = z - predicted
        for component in self.angles:
            angle = difference[..., component]
            # Most differences need no turn, and looking is cheaper than wrapping. NaN compares false, so it wraps.
            if not np.abs(angle).max(initial=0.0) <= np.pi:
                difference[..., component] = wrap_angle(angle)
        return difference

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx by central differences, (runs, ..., m, n)."""
        n = states.shape[-1]
        columns = []
        for j in range(n):
            # Cube root of the rounding error balances truncation against cancellation.
            width = np.cbrt(np.finfo(float).eps) * np.maximum(np.abs(states[..., j]), 1.0)
            ahead, behind = states.copy(), states.copy()
            ahead[..., j] += width
            behind[..., j] -= width
            change = self.residual(self.predict(ahead, epoch), self.predict(behind, epoch))
            columns.append(change / (ahead[..., j] - behind[..., j])[..., None])
        return np.stack(columns, axis=-1)

    def log_likelihood(self, z: Array, states: Array, epoch: int) -> Array:
        """Return log p(z | states) under the mixture where there is one, else under N(0, R)."""
        extra = states.ndim - 2
        spread = (slice(None), *[None] * extra)
        residual = self.residual(z[spread], self.predict(states, epoch))
        mean = states.reshape(len(states), -1, states.shape[-1]).mean(axis=1)
        mixture = self.mixture(mean, epoch)
        if mixture is None:
            return log_density(residual, self.noise(mean, epoch))
        return mixture_log_density(residual, mixture.weights, mixture.covariances, mixture.shared)


class LinearMeasurement(MeasurementDefaults):
    """Linear measurement z = H x + v.

    Args:
        matrix: H, (m, n).
        noise: R (m, m), (T, m, m) per epoch, (runs, T, m, m) per run and epoch, or a `MixtureNoise`.

    Raises:
        ValueError: Shapes that do not fit, entries that are not finite, or a noise that is no covariance.
    """

    leaves_arguments_alone = True

    def __init__(self, matrix: ArrayLike, noise: ArrayLike | MixtureNoise) -> None:
        H = numbers(matrix, "matrix")
        if H.ndim != 2 or not H.size:
            raise ValueError(f"matrix has shape {H.shape}; it must be (m, n)")
        self._H = finite(H, "matrix", ("row", "column")).copy()
        self._H.setflags(write=False)  # a filter that wrote into it would change its next updates
        self.dimension, self.states = self._H.shape
        self.depends_on = tuple(np.flatnonzero(self._H.any(axis=0)).tolist())
        self._noise = _checked_noise(noise, self.dimension)

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a block of readings that the noise is not for.

        Raises:
            ValueError: It has other runs, or more epochs, than the noise.
        """
        _check_noise_extent(self._noise, runs, epochs)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return H x, (runs, ..., m)."""
        predicted: Array = np.einsum("ij,...j->...i", self._H, states)
        return predicted

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return H, (m, n)."""
        return self._H

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R of this epoch, (m, m) or (runs, m, m)."""
        return _noise_at(self._noise, epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the mixture's components, if the noise is one."""
        return _mixture_of(self._noise)


class FunctionMeasurement(MeasurementDefaults):
    """A measurement given by a function.

    Args:
        predict: ``predict(states, epoch)``, (runs, ..., n) -> (runs, ..., m). Axis 0 is always all runs of
            the block in order, so per-run data (sensor positions, say) index with it; particle or sigma-point
            axes follow it.
        noise: (m, m), (T, m, m), (runs, T, m, m) or `MixtureNoise`.
        jacobian: ``jacobian(states, epoch)`` -> (runs, ..., m, n); default: central differences.
        angles: Components of z that are angles in rad; their differences are wrapped.

    Raises:
        ValueError: Something that is no function, a noise that is no covariance, or angles that are no components.
    """

    leaves_arguments_alone = True

    def __init__(
        self,
        predict: Callable[[Array, int], Array],
        noise: ArrayLike | MixtureNoise,
        jacobian: Callable[[Array, int], Array] | None = None,
        angles: Sequence[int] = (),
    ) -> None:
        self._predict = predict
        self._jacobian = jacobian
        self._names = f"the measurement's predict{_named(predict)}", f"the measurement's jacobian{_named(jacobian)}"
        for name, function in (("predict", predict), ("jacobian", jacobian)):
            if not callable(function) and not (name == "jacobian" and function is None):
                raise ValueError(f"{name} is {function!r}; it must be a function of states and epoch")
        self._noise = _checked_noise(noise, None)
        noise_matrix = self._noise.covariance if isinstance(self._noise, MixtureNoise) else self._noise
        self.dimension = int(noise_matrix.shape[-1])
        self.angles = _checked_angles(angles, self.dimension)

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a block of readings that the noise is not for.

        Raises:
            ValueError: It has other runs, or more epochs, than the noise.
        """
        _check_noise_extent(self._noise, runs, epochs)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the user's h(states).

        Raises:
            ValueError: The function returned an array of another shape or kind, or wrote into its argument.
        """
        result = called_read_only(self._predict, self._names[0], states, epoch)
        predicted = numbers(result, "what predict returned")
        expected = (*states.shape[:-1], self.dimension)
        if predicted.shape != expected:
            raise ValueError(
                f"predict returned shape {predicted.shape} for states {states.shape}; expected {expected}, because the "
                f"noise is for {self.dimension} components"
            )
        return predicted

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the user's dh/dx, or central differences.

        Raises:
            ValueError: The function returned an array of another shape or kind, or wrote into its argument.
        """
        if self._jacobian is None:
            return super().jacobian(states, epoch)
        result = called_read_only(self._jacobian, self._names[1], states, epoch)
        H = numbers(result, "what jacobian returned")
        expected = (*states.shape[:-1], self.dimension, states.shape[-1])
        if H.shape != expected and H.shape != expected[-2:]:
            raise ValueError(f"jacobian returned shape {H.shape} for states {states.shape}; expected {expected}")
        return H

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R of this epoch, (m, m) or (runs, m, m)."""
        return _noise_at(self._noise, epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the mixture's components, if the noise is one."""
        return _mixture_of(self._noise)


def _checked_noise(noise: ArrayLike | MixtureNoise, dimension: int | None) -> Array | MixtureNoise:
    if isinstance(noise, MixtureNoise):
        size = noise.covariances.shape[-1]
    else:
        shapes = "(m, m), (T, m, m) or (runs, T, m, m)"
        noise = covariances(noise, "noise", shapes, ([], ["epoch"], ["run", "epoch"]))
        size = noise.shape[-1]
    if dimension is not None and size != dimension:
        raise ValueError(f"noise is for {size} components, the measurement has {dimension}")
    return noise


def _check_noise_extent(noise: Array | MixtureNoise, runs: int, epochs: int) -> None:
    if isinstance(noise, MixtureNoise) or noise.ndim == 2:
        return
    if noise.ndim == 4 and len(noise) != runs:
        raise ValueError(f"noise is given for {len(noise)} runs, the readings have {runs}")
    if noise.shape[-3] < epochs:
        raise ValueError(f"noise is given for {noise.shape[-3]} epochs, the readings have {epochs}")


def _checked_angles(angles: Sequence[int], components: int) -> tuple[int, ...]:
    try:
        places = tuple(operator.index(place) for place in angles)
    except TypeError:
        raise ValueError(f"angles is {angles!r}; it must list components by number, from 0") from None
    if len(set(places)) != len(places) or any(not 0 <= place < components for place in places):
        raise ValueError(f"angles {places} do not fit a measurement of {components} components")
    return places


def _named(function: object) -> str:
    """Return `` (name)`` of a user's function, or nothing where it has none worth saying."""
    name = getattr(function, "__name__", "<lambda>")
    return "" if name == "<lambda>" else f" ({name})"


def _noise_at(noise: Array | MixtureNoise, epoch: int) -> Array:
    if isinstance(noise, MixtureNoise):
        return noise.covariance
    if noise.ndim == 2:
        return noise
    epochs = noise.shape[0] if noise.ndim == 3 else noise.shape[1]
    if epoch >= epochs:
        raise ValueError(f"noise is given for {epochs} epochs, but there is an epoch {epoch}")
    matrix: Array = noise[epoch] if noise.ndim == 3 else noise[:, epoch]
    return matrix


def _mixture_of(noise: Array | MixtureNoise) -> Mixture | None:
    if isinstance(noise, MixtureNoise):
        return Mixture(noise.weights, noise.covariances, noise.shared)
    return None
