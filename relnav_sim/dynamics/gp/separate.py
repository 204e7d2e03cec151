"""Gaussian processes that have nothing in common but their inputs, one for each output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.gp.process import GaussianProcess, Kernel, condition


@dataclass(frozen=True)
class SeparateProcesses:
    """One process of one output for each output; predictions are those of `GaussianProcess`, output by output.

    Args:
        processes: The processes, in the order of the outputs.
    """

    processes: tuple[GaussianProcess, ...]

    @property
    def output_scale(self) -> Array:
        """The outputs' scales s_y, (q,)."""
        return np.concatenate([process.output_scale for process in self.processes])

    def predict(self, points: Array) -> Array:
        """Return the outputs' means (runs, N, q) at points (runs, N, d)."""
        return np.concatenate([process.predict(points) for process in self.processes], axis=2)

    def predict_with_variance(self, points: Array) -> tuple[Array, Array]:
        """Return the means, and the variances of the standardised outputs, (runs, N, q) both."""
        predicted = [process.predict_with_variance(points) for process in self.processes]
        means, variances = zip(*predicted, strict=True)
        return np.concatenate(means, axis=2), np.stack(variances, axis=2)

    def variance(self, points: Array) -> Array:
        """Return the variances of the standardised outputs at points (runs, N, d): (runs, N, q)."""
        return np.stack([process.variance(points) for process in self.processes], axis=2)

    def jacobian(self, points: Array) -> Array:
        """Return the derivatives of the means with respect to the inputs, (runs, q, d), at points (runs, d)."""
        return np.concatenate([process.jacobian(points) for process in self.processes], axis=1)


def conditioned(
    kernels: Sequence[Kernel], inputs: Array, outputs: Array, noise_counted: bool = True
) -> GaussianProcess | SeparateProcesses:
    """Return what is known of outputs (S, q) after training inputs (S, d): one process, or one for each output.

    Args:
        kernels: That of all outputs, or one for each.
        inputs: (S, d).
        outputs: (S, q).
        noise_counted: Whether variances are those of noisy outputs.
    """
    known = partial(condition, noise_counted=noise_counted)
    if len(kernels) == 1:
        return known(kernels[0], inputs, outputs)
    columns = np.split(outputs, outputs.shape[1], axis=1)
    return SeparateProcesses(
        tuple(known(*each) for each in zip(kernels, [inputs] * len(columns), columns, strict=True))
    )
