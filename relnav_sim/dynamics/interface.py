"""Relative dynamics as a filter sees them: the interface, and the linear case."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.given_arrays import covariances, finite, numbers


@dataclass(frozen=True)
class Step:
    """One epoch of a filter.

    Args:
        epoch: Its index in the time axis of the measurements, 0 to T - 1.
        duration_s: Time since the epoch before, s.

    Examples:
        >>> from relnav_sim import Step
        >>> Step(3, 10.0).duration_s
        10.0
    """

    epoch: int
    duration_s: float = 1.0


class Dynamics(Protocol):
    """How the state moves over one step, x_k = f(x_{k-1}) + w, w ~ N(0, Q).

    `linear` promises that `propagate` is exactly multiplication by `transition`. Dynamics that have no other
    `propagate` than that may say so by an attribute ``moves_by_transition``: a filter then does both in one. It asks
    for both at each step. Where F and Q follow from the epoch alone, ``known_steps(first_epoch, count)`` may return
    them for many epochs, or None; what it returns counts, whatever function is assigned to the dynamics beside it.
    """

    dimension: int

    @property
    def linear(self) -> bool:
        """Whether `propagate` is exactly multiplication by `transition`."""
        ...

    def propagate(self, states: Array, step: Step) -> Array:
        """Return f(states), (runs, ..., n) -> (runs, ..., n)."""
        ...

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian of f at `mean` (runs, n): (n, n) or (runs, n, n)."""
        ...

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q at `states` (runs, ..., n): (n, n), or (runs, ..., n, n) where it depends on the state."""
        ...


class _WithPropagate:
    """Whether `propagate` is the multiplication by `transition`; a derived class, or one object, may say otherwise."""

    def __get__(self, owner: Any, kind: Any) -> bool:
        return kind.propagate is ByTransition.propagate and (owner is None or "propagate" not in vars(owner))


class ByTransition:
    """Dynamics that move by their transition, unless a derived class, or one object, has another `propagate`."""

    linear = moves_by_transition = _WithPropagate()
    leaves_arguments_alone = True

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute; a function that is the class's own is only put back."""
        super().__setattr__(name, value)
        if name in ("propagate", "transition", "process_noise") and is_still(self, getattr(type(self), name)):
            super().__delattr__(name)

    def propagate(self, states: Array, step: Step) -> Array:
        """Return F x for every state, (runs, ..., n)."""
        return linear_images(self.transition(states, step), states)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F of this epoch, (n, n)."""
        raise NotImplementedError


class LinearDynamics(ByTransition):
    """Linear dynamics x_k = F x_{k-1} + w, w ~ N(0, Q).

    The matrices are copied. A function that a derived class, or one object, has in the place of one of these counts,
    and with another `propagate` the dynamics are `linear` no more.

    Args:
        transition: F, (n, n), or (T, n, n) with one matrix per epoch.
        process_noise: Q, (n, n), or (T, n, n) with one matrix per epoch.

    Raises:
        ValueError: A matrix is not square, the sizes differ, an entry is not finite, or Q is no covariance.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, Step
        >>> constant_velocity = LinearDynamics([[1.0, 10.0], [0.0, 1.0]], np.diag([0.0, 1e-4]))
        >>> constant_velocity.propagate(np.array([[0.0, 2.0]]), Step(0)).tolist()  # 10 s later
        [[20.0, 2.0]]
    """

    def __init__(self, transition: ArrayLike, process_noise: ArrayLike) -> None:
        F = numbers(transition, "transition")
        if F.ndim not in (2, 3) or F.shape[-1] != F.shape[-2]:
            raise ValueError(f"transition has shape {F.shape}; it must be (n, n) or (T, n, n)")
        self._F = finite(F, "transition", ("epoch", "row", "column")[-F.ndim :]).copy()
        self._Q = covariances(process_noise, "process_noise", "(n, n) or (T, n, n)", ([], ["epoch"]))
        if self._F.shape[-1] != self._Q.shape[-1]:
            raise ValueError(f"transition is for {self._F.shape[-1]} states, process_noise for {self._Q.shape[-1]}")
        self.dimension = self._F.shape[-1]
        for matrices in (self._F, self._Q):
            matrices.setflags(write=False)  # a filter that wrote into them would change its next steps

    def known_steps(self, first_epoch: int, count: int) -> tuple[Array, Array] | None:
        """Return F and Q of steps, (count or 1, n, n) each; None where a derived class or an object has its own."""
        base = LinearDynamics
        if not is_still(self, base.propagate, base.transition, base.process_noise):
            return None
        self.check_extent(1, first_epoch + count)
        epochs = slice(first_epoch, first_epoch + count)
        F, Q = (A[None] if A.ndim == 2 else A[epochs] for A in (self._F, self._Q))
        return F, Q

    def check_extent(self, runs: int, epochs: int) -> None:
        """Refuse a block that has more epochs than there are matrices.

        Raises:
            ValueError: It has.
        """
        for name, matrices in (("transition", self._F), ("process_noise", self._Q)):
            if matrices.ndim == 3 and len(matrices) < epochs:
                raise ValueError(f"{name} is given for {len(matrices)} epochs, the measurements have {epochs}")

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F of this epoch, (n, n)."""
        return _of_epoch(self._F, "transition", step)

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q of this epoch, (n, n)."""
        return _of_epoch(self._Q, "process_noise", step)


def is_still(owner: Any, *functions: Callable[..., Any]) -> bool:
    """Return whether an object has these functions of a class, and no others by their names.

    A derived class may have others, and so may the object alone, where one is assigned to it: that of a second object
    of the same class, too.
    """
    kind, assigned = type(owner), vars(owner)
    for function in functions:
        name = function.__name__
        if getattr(kind, name) is not function or (name in assigned and not _bound_to(owner, function)):
            return False
    return True


def _bound_to(owner: Any, function: Callable[..., Any]) -> bool:
    """Return whether what an object has under the name of a function is that function, as when it was put back."""
    found = getattr(owner, function.__name__)
    return getattr(found, "__func__", None) is function and found.__self__ is owner


def moves_by_transition(dynamics: Dynamics) -> bool:
    """Return whether dynamics say that they have no other `propagate` than the multiplication by `transition`."""
    return getattr(dynamics, "moves_by_transition", False)


def linear_images(F: Array, states: Array) -> Array:
    """Return F x for every state (runs, ..., n), F (n, n)."""
    points = np.ascontiguousarray(states, dtype=float).reshape(-1, F.shape[1])
    return kernels.maps.linear(np.ascontiguousarray(F, dtype=float), points).reshape(states.shape)


def _of_epoch(matrices: Array, name: str, step: Step) -> Array:
    if matrices.ndim == 2:
        return matrices
    if step.epoch >= len(matrices):
        raise ValueError(f"{name} is given for {len(matrices)} epochs, but there is an epoch {step.epoch}")
    matrix: Array = matrices[step.epoch]
    return matrix
