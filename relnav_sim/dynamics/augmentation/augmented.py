"""Augmented states behind a model's own: the dynamics of the concatenated state [x; b].

The one mechanism by which any filter estimates sensor biases, drag or an accelerometer's error, or accounts for them
without estimating them (Schmidt 1966): the filter sees a larger state and is otherwise unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step, is_still, moves_by_transition


class unless_assigned:  # noqa: N801  # as `property`
    """A property that a derived class, or one object, may be given another value of, as of any attribute."""

    def __init__(self, found: Callable[[Any], bool]) -> None:
        self._found = found
        self.__doc__ = found.__doc__

    def __get__(self, owner: Any, kind: type) -> bool:
        return self._found(owner)


class AugmentedDynamics:
    """Dynamics of [x; b]: x_k = f(x_{k-1}) + G b_{k-1} + w, and the augmented states b_k = D b_{k-1} + u.

    Alone, an augmented state is a constant (a factor 1 on the diagonal of D, no noise), a random walk (factor 1) or a
    first-order Gauss-Markov process (factor exp(-step / tau), noise sigma^2 (1 - factor^2)); a clock's bias and drift
    are coupled. u is independent of w, unless `within_step` says what it does to x before the step ends.

    Args:
        base: How x moves, n states.
        decay: D over one step, (e, e), or its diagonal (e,).
        noise: Covariance of u, (e, e), or its diagonal (e,); 0 for a constant.
        inputs: G, (n, e), or a function ``inputs(step)`` that returns it, (n, e) or (runs, n, e); default: the extra
            states do not move x.
        considered: Numbers, from 0, of the augmented states that a filter is to account for without estimating them.
        within_step: What u adds to the covariance of x, and its covariance with u, (n, n + e); default: nothing.

    Attributes:
        considered: Their places in [x; b].

    Raises:
        ValueError: Sizes that do not fit, a noise that is no covariance, or a considered state that is not there.
    """

    def __init__(
        self,
        base: Dynamics,
        decay: ArrayLike,
        noise: ArrayLike,
        inputs: ArrayLike | Callable[[Step], Array] | None = None,
        considered: Sequence[int] = (),
        within_step: ArrayLike | None = None,
    ) -> None:
        self.base = base
        self._n = n = base.dimension
        self._D, self._noise = _square(decay), _square(noise)
        if self._D.shape != self._noise.shape or not _is_covariance(self._noise):
            raise ValueError(
                "decay and noise must be (e,) or (e, e) over the same augmented states, and the noise a covariance"
            )
        self._factors = np.diagonal(self._D)
        self._coupled = bool((np.diag(self._factors) != self._D).any())
        e = len(self._D)
        self.dimension = n + e
        if any(not 0 <= place < e for place in considered):
            raise ValueError(f"considered {tuple(considered)} does not fit {e} augmented states")
        self.considered = tuple(n + place for place in considered)
        self._known: tuple[Array | None, Array] = None, self._noise
        """The latest constant Q of the base, and what `process_noise` makes of it."""
        self._within: Array | None = None if within_step is None else np.array(within_step, dtype=float)
        if self._within is not None:
            self._check_within(self._within)
        self._inputs: Callable[[Step], Array] | None
        if inputs is None or callable(inputs):
            self._inputs = inputs
        else:
            G = np.array(inputs, dtype=float)
            if G.shape != (n, e):
                raise ValueError(f"inputs has shape {G.shape}; it must be {(n, e)}")
            self._inputs = lambda step: G

    def _check_within(self, within: Array) -> None:
        n = self._n
        if within.shape != (n, self.dimension):
            raise ValueError(f"within_step has shape {within.shape}; it must be {(n, self.dimension)}")
        if not _is_covariance(np.block([[within], [within[:, n:].T, self._noise]])):
            raise ValueError("within_step and noise are no covariance of [x; b]")

    @unless_assigned
    def linear(self) -> bool:
        """Whether `propagate` is the multiplication, as it is where that of the base is."""
        return self.base.linear and is_still(self, AugmentedDynamics.propagate, AugmentedDynamics.transition)

    @unless_assigned
    def moves_by_transition(self) -> bool:
        """Whether a filter may do both in one."""
        return moves_by_transition(self.base) and self.linear

    def propagate(self, states: Array, step: Step) -> Array:
        """Return states (runs, ..., n + e) after the step."""
        x, b = states[..., : self._n], states[..., self._n :]
        moved = np.empty(states.shape)
        moved[..., : self._n] = self.base.propagate(x, step)
        if self._inputs is not None:
            G = self._inputs(step)
            if G.ndim == 3:
                G = G.reshape(len(G), *[1] * (states.ndim - 2), *G.shape[1:])
            moved[..., : self._n] += np.einsum("...ij,...j->...i", G, b)
        moved[..., self._n :] = np.einsum("ij,...j->...i", self._D, b) if self._coupled else self._factors * b
        return moved

    def transition(self, mean: Array, step: Step) -> Array:
        """Return [[F, G], [0, D]], (n + e, n + e) or (runs, n + e, n + e)."""
        n = self._n
        F = self.base.transition(mean[..., :n], step)
        G = None if self._inputs is None else self._inputs(step)
        runs = F.shape[:-2] if G is None else np.broadcast_shapes(F.shape[:-2], G.shape[:-2])
        whole = np.zeros((*runs, self.dimension, self.dimension))
        whole[..., :n, :n] = F
        if G is not None:
            whole[..., :n, n:] = G
        whole[..., n:, n:] = self._D
        return whole

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return the covariance of [w; u], (n + e, n + e), or (runs, ..., n + e, n + e) where Q depends on the state.

        It is blockdiag(Q, noise) and what u does within the step.
        """
        n = self._n
        Q = self.base.process_noise(states[..., :n], step)
        if Q is self._known[0]:
            return self._known[1]
        whole = np.zeros((*Q.shape[:-2], self.dimension, self.dimension))
        whole[..., :n, :n] = Q
        whole[..., n:, n:] = self._noise
        if self._within is not None:
            whole[..., :n, :] += self._within
            whole[..., n:, :n] += self._within[:, n:].T
        if Q.base is None and not Q.flags.writeable:  # a constant, which comes again
            whole.setflags(write=False)
            self._known = Q, whole
        return whole


def _square(given: ArrayLike) -> Array:
    """Return a matrix (e, e) as given or of its diagonal (e,)."""
    matrix = np.array(given, dtype=float)
    return np.diag(matrix) if matrix.ndim == 1 else matrix


def _is_covariance(matrix: Array) -> bool:
    """Return whether a matrix is square, symmetric and, to rounding, positive semidefinite."""
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not np.array_equal(matrix, matrix.T):
        return False
    # Scaled to a unit diagonal: the units of the states may lie many powers of ten apart.
    scale = np.sqrt(np.where(np.diagonal(matrix) > 0, np.diagonal(matrix), 1.0))
    return bool(np.linalg.eigvalsh(matrix / np.multiply.outer(scale, scale)).min(initial=0.0) >= -1e-9)
