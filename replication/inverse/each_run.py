"""Dynamics and a radar that differ from run to run, so that settings that share nothing fly in one block."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from relnav_sim import LinearDynamics, Step
from relnav_sim.arrays import Array
from relnav_sim.astro.line_of_sight import mounting_matrix
from relnav_sim.dynamics.gp.dynamics import GpDynamics
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar


class DynamicsOfEachRun:
    """Linear dynamics x_k = F x_{k-1} + w, w ~ N(0, Q), with F and Q of each run's own, (runs, n, n).

    Args:
        dynamics: Those of each setting.
        runs: Runs on end that have the same setting.
    """

    linear = True
    leaves_arguments_alone = True

    def __init__(self, dynamics: Sequence[LinearDynamics], runs: int = 1) -> None:
        step, nothing = Step(0), np.empty((1, 0))
        self.F = np.repeat([each.transition(nothing, step) for each in dynamics], runs, axis=0)
        self.Q = np.repeat([each.process_noise(nothing, step) for each in dynamics], runs, axis=0)
        self.dimension = self.F.shape[-1]

    def propagate(self, states: Array, step: Step) -> Array:
        """Return F x of states (runs, ..., n)."""
        points = states.reshape(len(self.F), -1, self.dimension)
        return np.asarray(points @ self.F.swapaxes(1, 2)).reshape(states.shape)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F, (runs, n, n)."""
        return self.F

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (runs, n, n)."""
        return self.Q


class LearnedOfEachRun:
    """Learned dynamics of each run's own.

    Args:
        models: Those of each run.
    """

    linear = False
    leaves_arguments_alone = True

    def __init__(self, models: Sequence[GpDynamics]) -> None:
        self._models = models
        self.dimension = models[0].dimension

    def propagate(self, states: Array, step: Step) -> Array:
        """Return the means of the next states (runs, ..., n)."""
        return np.concatenate([model.propagate(own, step) for model, own in self._paired(states)])

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobians (runs, n, n) of `propagate` at `mean` (runs, n)."""
        return np.concatenate([model.transition(own, step) for model, own in self._paired(mean)])

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q at states (runs, ..., n): (runs, ..., n, n)."""
        return np.concatenate([model.process_noise(own, step) for model, own in self._paired(states)])

    def _paired(self, states: Array) -> Iterator[tuple[GpDynamics, Array]]:
        return ((model, states[run : run + 1]) for run, model in enumerate(self._models))


class RadarOfEachRun(SphericalRadar):
    """A radar on the chief with sigmas of each run's own.

    Args:
        sigmas: Standard deviations of range, azimuth and elevation, (runs, 3), m and rad.
        mounting_deg: Yaw, pitch and roll from the nadir frame to the radar's.
    """

    def __init__(self, sigmas: Array, mounting_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        first = SightNoise(np.ones(1), sigmas[:1], sigmas[0], np.zeros((3, 3)))
        super().__init__(mounting_matrix(*mounting_deg), first)
        self._R = sigmas[:, :, None] ** 2 * np.eye(3)

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R, (runs, 3, 3)."""
        return self._R
