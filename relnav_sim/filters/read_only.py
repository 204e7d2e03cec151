"""A user's models get read-only arguments, so that one that writes into them is refused instead of believed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from relnav_sim.arrays import Array
from relnav_sim.dynamics.around import AroundDynamics
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.given_arrays import returned_numbers
from relnav_sim.measurements.interface import Mixture, one_by_one, squares_of_states
from relnav_sim.read_only_call import called_read_only


class ReadOnlyDynamics(AroundDynamics):
    """Dynamics whose functions see read-only states and must return the right shapes; all else is as in those behind.

    Args:
        base: The dynamics.
    """

    def __init__(self, base: Dynamics) -> None:
        super().__init__(base)
        self._name = type(base).__name__

    def propagate(self, states: Array, step: Step) -> Array:
        """Return f(states)."""
        return self._result("propagate", self._base.propagate, states, step, states.shape)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian of f."""
        n = self.dimension
        return self._result("transition", self._base.transition, mean, step, (n, n), (len(mean), n, n))

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q."""
        n = self.dimension
        shapes = (n, n), (len(states), n, n), (*states.shape[:-1], n, n)
        return self._result("process_noise", self._base.process_noise, states, step, *shapes)

    def _result(
        self, name: str, function: Callable[[Array, Any], Any], states: Array, step: Step, *shapes: tuple[int, ...]
    ) -> Array:
        name = f"{name} of {self._name}"
        result = returned_numbers(called_read_only(function, name, states, step), f"what {name} returned")
        if result.shape not in shapes:
            wanted = " or ".join(map(str, dict.fromkeys(shapes)))
            raise ValueError(f"{name} returned shape {result.shape} for states {states.shape}; it must be {wanted}")
        return result


class ReadOnlyMeasurement:
    """A measurement whose functions see read-only states; everything else is that of the one behind it.

    Args:
        base: The measurement.
    """

    def __init__(self, base: Any) -> None:
        self._base = base
        self._name = type(base).__name__

    def __getattr__(self, name: str) -> Any:
        if name == "_base":
            raise AttributeError(name)  # while it is unpickled
        return getattr(self._base, name)

    def __setattr__(self, name: str, value: Any) -> None:
        """Give what a user assigns to the measurement behind it."""
        if name in ("_base", "_name"):
            super().__setattr__(name, value)
        else:
            setattr(self._base, name, value)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states)."""
        return self._result("predict", self._base.predict, states, epoch)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx."""
        return self._result("jacobian", self._base.jacobian, states, epoch)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R."""
        return self._result("noise", self._base.noise, mean, epoch)

    def mixture(self, mean: Array, epoch: int) -> Any:
        """Return the components of the noise."""
        name = f"mixture of {self._name}"
        found = called_read_only(self._base.mixture, name, mean, epoch)
        if found is None:
            return None
        weights = returned_numbers(found.weights, f"the weights that {name} returned")
        covariances = returned_numbers(found.covariances, f"the covariances that {name} returned")
        return Mixture(weights, covariances, found.shared)

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return z - predicted."""
        return returned_numbers(self._base.residual(z, predicted), f"what residual of {self._name} returned")

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual, dh/dx and R by the functions above."""
        return one_by_one(self, z, mean, epoch)

    def squared_errors(self, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
        """Return squared errors of samples by the functions above."""
        return squares_of_states(self, z, W, centre, root, e, epoch)

    def _result(self, name: str, function: Callable[[Array, Any], Any], states: Array, epoch: int) -> Array:
        name = f"{name} of {self._name}"
        return returned_numbers(called_read_only(function, name, states, epoch), f"what {name} returned")


def read_only(model: Any, guarded: Callable[[Any], Any]) -> Any:
    """Return the model, guarded unless it says by ``leaves_arguments_alone`` that it needs no guard."""
    return model if getattr(model, "leaves_arguments_alone", False) else guarded(model)
