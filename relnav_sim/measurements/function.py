"""A measurement given by a user's function."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence

from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.given_arrays import returned_numbers
from relnav_sim.measurements.given_noise import MixtureNoise, check_noise_extent, checked_noise, mixture_of, noise_at
from relnav_sim.measurements.interface import MeasurementDefaults, Mixture
from relnav_sim.read_only_call import called_read_only


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

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import FunctionMeasurement, Step
        >>> def bearing(states, epoch):
        ...     return np.arctan2(states[..., 1], states[..., 0])[..., None]
        >>> camera = FunctionMeasurement(bearing, [[1e-6]], angles=[0])
        >>> camera.predict(np.array([[3.0, 3.0, 0.0, 0.0]]), Step(0)).round(4).tolist()
        [[0.7854]]
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
        self._noise = checked_noise(noise, None)
        noise_matrix = self._noise.covariance if isinstance(self._noise, MixtureNoise) else self._noise
        self.dimension = int(noise_matrix.shape[-1])
        self.angles = _checked_angles(angles, self.dimension)

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a block of measurements that the noise is not for.

        Raises:
            ValueError: It has other runs, or more epochs, than the noise.
        """
        check_noise_extent(self._noise, runs, epochs)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the user's h(states).

        Raises:
            ValueError: The function returned an array of another shape or kind, or wrote into its argument.
        """
        result = called_read_only(self._predict, self._names[0], states, epoch)
        predicted = returned_numbers(result, "what predict returned")
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
        H = returned_numbers(result, "what jacobian returned")
        expected = (*states.shape[:-1], self.dimension, states.shape[-1])
        if H.shape != expected and H.shape != expected[-2:]:
            raise ValueError(f"jacobian returned shape {H.shape} for states {states.shape}; expected {expected}")
        return H

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R of this epoch, (m, m) or (runs, m, m)."""
        return noise_at(self._noise, epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the mixture's components, if the noise is one."""
        return mixture_of(self._noise)


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
