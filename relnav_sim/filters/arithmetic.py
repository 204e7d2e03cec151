"""The arithmetic that a filter computes in: float64, or the float32 of many flight computers."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.linalg import DOUBLE, SINGLE
from relnav_sim.measurements.interface import (
    Measurement,
    Mixture,
    linearised,
    one_by_one,
    squares_of_states,
)
from relnav_sim.options import AddedLater, Options

EPS = float(np.finfo(np.float64).eps)
"""The unit of rounding of float64."""

Arithmetic = Literal["float64", "float32"]


class ArithmeticOptions(Options):
    """Options of the filters that can compute in single precision."""

    arithmetic: Annotated[Arithmetic, AddedLater()] = Field(
        default="float64",
        description="What the filter computes in: float64 (default), or float32 as many flight computers do: its "
        "belief, the matrices that its models give it, its prediction and its update. Truth, sensors, statistics and "
        "the inside of the models stay float64",
    )


class ModelsInArithmetic:
    """Dynamics and measurement as a filter of some arithmetic sees them.

    In float64 what they return, as it is. In float32 the functions are evaluated in float64 at the states of the
    filter, and what they return is rounded; so are measurements, before predicted ones are subtracted from them.

    Args:
        dynamics: The filter's.
        measurement: The filter's.
        arithmetic: What it computes in.

    Attributes:
        single: Whether that is float32.
        eps: Its unit of rounding.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, arithmetic: Arithmetic) -> None:
        self._dynamics, self._measurement = dynamics, measurement
        self.single = arithmetic == "float32"
        self._dtype = np.dtype(arithmetic)
        self.eps = float(np.finfo(self._dtype).eps)

    def own(self, A: Array) -> Array:
        """Return an array in the filter's arithmetic, in C order; a matrix (p, q) for all runs as (1, p, q)."""
        return np.ascontiguousarray(A, dtype=self._dtype)

    def propagate(self, mean: Array, step: Step) -> Array:
        """Return f(mean), (runs, n)."""
        return self.own(self._dynamics.propagate(_double(mean), step))

    def matrices(self, mean: Array, step: Step) -> tuple[Array, Array]:
        """Return F and Q at `mean` (runs, n), (runs, n, n) each, or (1, n, n) for all runs."""
        return self.transition(mean, step), self.process_noise(mean, step)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F at `mean` (runs, n), (runs or 1, n, n)."""
        return self._by_run(self._dynamics.transition(_double(mean), step))

    def process_noise(self, mean: Array, step: Step) -> Array:
        """Return Q at `mean` (runs, n), (runs or 1, n, n)."""
        return self._by_run(self._dynamics.process_noise(_double(mean), step))

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R at `mean` (runs, n), (runs or 1, m, m)."""
        return self._by_run(self._measurement.noise(_double(mean), epoch))

    def images(self, points: Array, epoch: int) -> tuple[Array, Array]:
        """Return h of points (runs, p, n), (runs, p, m), and what each differs by from that of the first."""
        images = self.own(self._measurement.predict(_double(points), epoch))
        return images, self.residual(images, images[:, :1])

    def residual(self, z: Array, expected: Array) -> Array:
        """Return what measurements differ by from others, both rounded before: (..., m).

        The difference of two numbers of float32, taken in float64 and rounded, is their difference in float32.
        """
        return self.own(self._measurement.residual(_double(self.own(z)), _double(expected)))

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), H and R, (runs or 1, m, n) and (runs or 1, m, m), of a measurement z at `mean`."""
        measurement, m = self._measurement, _double(mean)
        if self.single:
            residual = self.residual(z, self.own(measurement.predict(m, epoch)))
            H, R = measurement.jacobian(m, epoch), measurement.noise(m, epoch)
        else:
            residual, H, R = linearised(measurement, z, m, epoch)
        return self.own(residual), self._by_run(H), self._by_run(R)

    def coarse(self, mean: Array, covariance: Array) -> dict[int, str]:
        """Return why runs can't go on, by place, whose states are rounded by more than their sigmas.

        Args:
            mean: (runs, n).
            covariance: (runs, n, n), in float64.
        """
        variance = np.einsum("bii->bi", covariance)
        lost = (np.square(self.eps * mean.astype(np.float64)) > variance) & (variance > 0)
        return {
            run: f"float32 holds state {int(np.argmax(lost[run])) + 1} more coarsely than its sigma; take float64, or "
            "states that are small against their sigmas"
            for run in np.flatnonzero(lost.any(axis=1)).tolist()
        }

    def _by_run(self, A: Array) -> Array:
        return self.own(A if A.ndim == 3 else A[None])


class RoundedMeasurement:
    """A measurement whose functions are evaluated in float64 at states of float32, and what they return is rounded.

    Measurements are rounded before predicted ones are subtracted from them. All else is as in the one behind it.

    Args:
        base: The measurement.
    """

    def __init__(self, base: Measurement) -> None:
        self._base = base
        self.dimension = base.dimension

    def __getattr__(self, name: str) -> Any:
        if name == "_base":
            raise AttributeError(name)  # while it is unpickled
        found = getattr(self._base, name)
        return RoundedMeasurement(found) if name == "complete" else found

    def predict(self, states: Array, epoch: int) -> Array:
        """Return h(states)."""
        return _single(self._base.predict(_double(states), epoch))

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return dh/dx."""
        return _single(self._base.jacobian(_double(states), epoch))

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R."""
        return _single(self._base.noise(_double(mean), epoch))

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the noise."""
        found = self._base.mixture(_double(mean), epoch)
        return found and Mixture(_single(found.weights), _single(found.covariances), found.shared)

    def residual(self, z: Array, predicted: Array) -> Array:
        """Return z - predicted: the difference of two numbers of float32, taken in float64 and rounded, is theirs."""
        return _single(self._base.residual(_double(_single(z)), _double(_single(predicted))))

    def log_likelihood(self, z: Array, states: Array, epoch: int) -> Array:
        """Return log p(z | states)."""
        return _single(self._base.log_likelihood(_double(_single(z)), _double(states), epoch))

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual, dh/dx and R by the functions above."""
        return one_by_one(self, z, mean, epoch)

    def squared_errors(self, z: Array, W: Array, centre: Array, root: Array, e: Array, epoch: int) -> Array:
        """Return squared errors of samples by the functions above."""
        return squares_of_states(self, z, W, centre, root, e, epoch)


def _single(A: Array) -> Array:
    return np.ascontiguousarray(A, dtype=SINGLE)


def _double(A: Array) -> Array:
    return np.ascontiguousarray(A, dtype=DOUBLE)
