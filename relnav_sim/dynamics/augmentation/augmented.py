"""Extra states behind a model's own: the dynamics of the concatenated state [x; b].

The one mechanism by which any filter estimates sensor biases, drag or an accelerometer's error, or accounts for them
without estimating them (Schmidt 1966): the filter sees a larger state and is otherwise unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.dynamics.interface import Dynamics, Step

Array = NDArray[np.float64]


class AugmentedDynamics:
    """Dynamics of [x; b]: x_k = f(x_{k-1}) + G b_{k-1} + w, and each extra state b_k = decay b_{k-1} + u.

    The extra states are constants (decay 1, no noise), random walks (decay 1) or first-order Gauss-Markov processes
    (decay exp(-step / tau), noise sigma^2 (1 - decay^2)), independent of each other and of w.

    Args:
        base: How x moves, n states.
        decay: Factors of the e extra states over one step, (e,).
        noise: Variances of u, (e,); 0 for a constant.
        inputs: G, (n, e), or a function ``inputs(step)`` that returns it, (n, e) or (runs, n, e); default: the extra
            states do not move x.
        considered: Numbers, from 0, of the extra states that a filter is to account for without estimating them.

    Attributes:
        considered: Their places in [x; b].

    Raises:
        ValueError: Sizes that do not fit, a negative variance, or a considered state that is not there.
    """

    def __init__(
        self,
        base: Dynamics,
        decay: ArrayLike,
        noise: ArrayLike,
        inputs: ArrayLike | Callable[[Step], Array] | None = None,
        considered: Sequence[int] = (),
    ) -> None:
        self.base = base
        self.linear = base.linear
        self._n = n = base.dimension
        self._decay, self._noise = np.array(decay, dtype=float), np.array(noise, dtype=float)
        if self._decay.ndim != 1 or self._decay.shape != self._noise.shape or (self._noise < 0).any():
            raise ValueError("decay and noise must be (e,), one number for each extra state, the noise not negative")
        self.dimension = n + len(self._decay)
        if any(not 0 <= place < len(self._decay) for place in considered):
            raise ValueError(f"considered {tuple(considered)} does not fit {len(self._decay)} extra states")
        self.considered = tuple(n + place for place in considered)
        self._inputs: Callable[[Step], Array] | None
        if inputs is None or callable(inputs):
            self._inputs = inputs
        else:
            G = np.array(inputs, dtype=float)
            if G.shape != (n, len(self._decay)):
                raise ValueError(f"inputs has shape {G.shape}; it must be {(n, len(self._decay))}")
            self._inputs = lambda step: G

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
        moved[..., self._n :] = self._decay * b
        return moved

    def transition(self, mean: Array, step: Step) -> Array:
        """Return [[F, G], [0, decay]], (n + e, n + e) or (runs, n + e, n + e)."""
        n = self._n
        F = self.base.transition(mean[..., :n], step)
        G = np.zeros((n, len(self._decay))) if self._inputs is None else self._inputs(step)
        runs = np.broadcast_shapes(F.shape[:-2], G.shape[:-2])
        whole = np.zeros((*runs, self.dimension, self.dimension))
        whole[..., :n, :n] = F
        whole[..., :n, n:] = G
        whole[..., range(n, self.dimension), range(n, self.dimension)] = self._decay
        return whole

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return blockdiag(Q, noise), (n + e, n + e), or (runs, ..., n + e, n + e) where Q depends on the state."""
        n = self._n
        Q = self.base.process_noise(states[..., :n], step)
        whole = np.zeros((*Q.shape[:-2], self.dimension, self.dimension))
        whole[..., :n, :n] = Q
        whole[..., range(n, self.dimension), range(n, self.dimension)] = self._noise
        return whole
