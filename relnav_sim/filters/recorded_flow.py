"""How a filter's dynamics moved its estimates, kept for a smoother that goes back over all of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step


class RecordedFlow:
    """Dynamics as they were at the filtered means of some epochs, and nowhere else.

    Dynamics may be fed what arrives during a run, chunk by chunk, and know of an earlier chunk no more. A smoother
    needs them last epoch first.

    Args:
        first_epoch: Epoch k at which the first of the steps ends.
        image: Means of the epochs before, propagated to the epochs, (runs, T, n).
        F: Transition matrices there, (runs, T, n, n).
        Q: Process noise, (runs, T, n, n).
    """

    linear = False

    def __init__(self, first_epoch: int, image: Array, F: Array, Q: Array) -> None:
        self.first_epoch = first_epoch
        self.image, self.F, self.Q = image, F, Q
        self.dimension: int = image.shape[-1]

    def propagate(self, states: Array, step: Step) -> Array:
        """Return the propagated means of the epoch before, (runs, n), whatever the states."""
        return self.image[:, step.epoch - self.first_epoch]

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F of the step to this epoch, (runs, n, n)."""
        return self.F[:, step.epoch - self.first_epoch]

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q of the step to this epoch, (runs, n, n)."""
        return self.Q[:, step.epoch - self.first_epoch]


def recorded_flow(dynamics: Dynamics, means: Array, first_epoch: int, step_s: float) -> RecordedFlow:
    """Return what dynamics do to means (runs, T, n), each in the step to the epoch after.

    Args:
        dynamics: The filter's, as they are during these epochs.
        means: Means one epoch before each of the epochs.
        first_epoch: The first of the epochs.
        step_s: Time between epochs, s.
    """
    runs, T, n = means.shape
    image, F, Q = np.empty((runs, T, n)), np.empty((runs, T, n, n)), np.empty((runs, T, n, n))
    with np.errstate(all="ignore"):  # a run that has diverged is NaN in its own row
        for k in range(T):
            step = Step(first_epoch + k, step_s)
            mean = np.ascontiguousarray(means[:, k])
            image[:, k] = dynamics.propagate(mean, step)
            F[:, k] = dynamics.transition(mean, step)
            Q[:, k] = dynamics.process_noise(mean, step)
    return RecordedFlow(first_epoch, image, F, Q)


def joined_flow(parts: Sequence[RecordedFlow]) -> RecordedFlow:
    """Return successive parts as one."""
    return RecordedFlow(
        parts[0].first_epoch,
        np.concatenate([part.image for part in parts], axis=1),
        np.concatenate([part.F for part in parts], axis=1),
        np.concatenate([part.Q for part in parts], axis=1),
    )
