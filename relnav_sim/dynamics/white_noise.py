"""Process noise added to dynamics: of a step, or white acceleration whose densities are set from outside."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.around import AroundDynamics
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.dynamics.process_noise import ACTS_ON_VELOCITY, van_loan


class AddedNoise(AroundDynamics):
    """Dynamics with the same process noise added in each step.

    Args:
        base: The dynamics.
        Q: Its covariance, (n, n).
    """

    def __init__(self, base: Dynamics, Q: Array) -> None:
        super().__init__(base)
        self._Q = Q

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q of the base and Q."""
        return self._base.process_noise(states, step) + self._Q

    def known_steps(self, first_epoch: int, count: int) -> tuple[Array, Array] | None:
        """Return those of the base with Q added, where it knows them."""
        known = getattr(self._base, "known_steps", None)
        steps = None if known is None else known(first_epoch, count)
        return None if steps is None else (steps[0], steps[1] + self._Q)


class WhiteAcceleration(AroundDynamics):
    """Dynamics of six states with white acceleration on each RTN axis added to their process noise.

    Args:
        base: The dynamics, without white acceleration of their own.
        A: System matrix of the linear relative motion by which the acceleration acts, (6, 6), 1/s.
        densities: Power spectral densities, (3,), m^2/s^3.
        step_s: Time between epochs, s.

    Attributes:
        densities: Those now, (runs, 3), or (1, 3) where all runs have the same.
        noises: Q over one step of a density 1 on each axis, (3, 6, 6).
        step_transition: F of the linear relative motion over one step, (6, 6).
    """

    def __init__(self, base: Dynamics, A: Array, densities: Array, step_s: float) -> None:
        super().__init__(base)
        self.densities: Array = densities[None]
        over_step = [van_loan(A, b[:, None], np.eye(1), step_s) for b in ACTS_ON_VELOCITY.T]
        self.step_transition = over_step[0][0]
        self.noises = np.stack([Q for _, Q in over_step])

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (6, 6), or (runs, 6, 6) whatever the states where the runs have densities of their own."""
        white = (self.densities[:, :, None, None] * self.noises).sum(axis=1)
        return self._base.process_noise(states, step) + (white[0] if len(white) == 1 else white)

    def known_steps(self, first_epoch: int, count: int) -> None:
        """Return None: the densities are found from step to step."""
