"""Extended Kalman filter whose covariance is held as U D U^T."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from relnav_sim import kernels
from relnav_sim.arrays import Array, Integers
from relnav_sim.dynamics.interface import Dynamics, Step, moves_by_transition
from relnav_sim.filters.arithmetic import EPS, ModelsInArithmetic
from relnav_sim.filters.belief import Gaussian, Innovation, considered_states
from relnav_sim.filters.kalman import GaussianFilter, LinearisedFilterOptions
from relnav_sim.filters.operations import Operations, Size, bytes_of, gram_schmidt, models, product, udu
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.square_root_update import CONTRADICTION
from relnav_sim.linalg import symmetric, transpose
from relnav_sim.measurements.interface import Measurement
from relnav_sim.options import AddedLater
from relnav_sim.streams import RandomSource


class FactoredOptions(LinearisedFilterOptions):
    """Options of the Bierman-Thornton filter."""

    compensated: Annotated[bool, AddedLater()] = Field(
        default=False,
        description="With arithmetic: float32, hold each state as a sum of two numbers of float32, so that what an "
        "update adds is not rounded to the size of the state; default false",
    )

    @model_validator(mode="after")
    def _of_single(self) -> Self:
        if self.compensated and self.arithmetic != "float32":
            raise ValueError("compensated is for arithmetic: float32; float64 holds a state in one number")
        return self


@dataclass(frozen=True)
class FactoredGaussian:
    """A Gaussian belief per run: its mean, and the factors of its covariance.

    Attributes:
        x: The mean, (runs, n).
        U: Unit upper triangular, (runs, n, n).
        D: Not negative, (runs, n).
        rest: What x leaves of the mean, (runs, n); None where states are held in one number.
    """

    x: Array
    U: Array
    D: Array
    rest: Array | None = None

    @property
    def mean(self) -> Array:
        """The mean (runs, n), in float64 whatever it is held in."""
        x = self.x.astype(np.float64)
        return x if self.rest is None else x + self.rest

    @property
    def covariance(self) -> Array:
        """The covariance U D U^T, (runs, n, n), multiplied out in float64."""
        U = self.U.astype(np.float64)
        return symmetric((U * self.D[:, None, :]) @ transpose(U))


def _operations(size: Size, options: Any) -> Operations:
    """Return what it costs: factors of Q and R, Gram-Schmidt on a matrix (n, 2 n), and m scalar updates."""
    n, m = size.n, size.m
    prediction = product(n, n, 1) + n * n * (n - 1) + udu(n) + gram_schmidt(n, 2 * n)
    decorrelation = udu(m) + m * (m - 1) // 2 * (2 + 2 * n)
    update = m * (11 * n + 3 * n * (n - 1)) + 6 * m + 2 + n
    more = 10 * n if options.compensated else 0
    numbers = 2 * (n * n + (3 if more else 2) * n) + models(n, m)
    return Operations(prediction + decorrelation + update + more, numbers, bytes_of(options))


@register_filter("ud_ekf", FactoredOptions, cost_us=1.6, overhead_us=45.0, operations=_operations)
class FactoredKalmanFilter(GaussianFilter):
    """Bierman-Thornton filter: the extended Kalman filter with its covariance held as U D U^T.

    Bierman, Factorization Methods for Discrete Sequential Estimation, 1977; Thornton and Bierman, Control and Dynamic
    Systems 16, 1980. Thornton's modified weighted Gram-Schmidt process in time, Bierman's scalar updates at a
    measurement, whose noise is first made independent by its own factors. Mathematically it is `ekf`; in numbers it
    is positive semidefinite whatever the rounding and needs no square root. Use it where the flight computer has
    float32, or where a precise sensor meets a wide prior. A singular prior, process noise or measurement noise, R = 0
    too, is no obstacle.
    """

    nominal_gain = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: FactoredOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._compensated = options.compensated
        self._models = ModelsInArithmetic(dynamics, measurement, options.arithmetic)

    def start(self, prior: Gaussian, source: RandomSource) -> Any:
        """Return the prior with its covariance factored, in float64; then its factors are rounded."""
        U, D = kernels.ud.factor(np.ascontiguousarray(prior.covariance), EPS)
        x, rest = self._held(prior.mean)
        return FactoredGaussian(x, self._models.own(U), self._models.own(D), rest)

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the belief with mean f(m) and the factors of F U D U^T F^T + Q."""
        prior: FactoredGaussian = belief
        models = self._models
        F, Q = models.matrices(prior.x, step)
        predict = kernels.ud.predict_single if models.single else kernels.ud.predict
        x, U, D = map(np.ascontiguousarray, (prior.x, prior.U, prior.D))
        mean, U, D = predict(x, U, D, F, Q, models.eps)
        if self._compensated:
            x, rest = self._held(self.dynamics.propagate(prior.mean, step))
            return FactoredGaussian(x, U, D, rest)
        if not moves_by_transition(self.dynamics):
            mean = models.propagate(prior.x, step)
        return FactoredGaussian(mean, U, D)

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the update by one channel after the other."""
        prior: FactoredGaussian = belief
        models = self._models
        update = kernels.ud.update_single if models.single else kernels.ud.update
        x, U, D = map(np.ascontiguousarray, (prior.x, prior.U, prior.D))
        model = models.linearised(z, x if prior.rest is None else prior.mean, step.epoch)
        places: Integers = np.array(considered_states(self.dynamics), dtype=np.int64)
        moved, U, D, nis, log_likelihood, contradicted = update(
            x if prior.rest is None else np.zeros_like(x), U, D, *model, places, models.eps
        )
        mean, rest = (moved, None) if prior.rest is None else _added(x, prior.rest, moved)
        corrected = FactoredGaussian(mean, U, D, rest)
        # In two numbers a state is rounded no more, but measurements of its size are.
        failed = models.coarse(mean, corrected.covariance) if models.single else {}
        if contradicted:
            failed |= dict.fromkeys(np.flatnonzero(np.isposinf(nis)).tolist(), CONTRADICTION)
        return corrected, Innovation(nis, log_likelihood, failed=failed)

    def _held(self, mean: Array) -> tuple[Array, Array | None]:
        """Return a mean (runs, n) in the filter's arithmetic, and what that leaves of it where it is compensated."""
        x = self._models.own(mean)
        return x, self._models.own(mean - x) if self._compensated else None

    def keep_considered(self, predicted: Any, corrected: Any) -> Any:
        """Return the corrected belief, whose considered states `correct` has kept already."""
        return corrected


def _added(x: Array, rest: Array, move: Array) -> tuple[Array, Array]:
    """Return x + rest + move as two arrays again, by sums whose rounding is known.

    Knuth, The Art of Computer Programming, vol. 2, section 4.2.2, theorem B; Moller, BIT 5, 1965.
    """
    total = x + move
    part = total - x
    rest = rest + ((x - (total - part)) + (move - part))
    held = total + rest
    return held, rest - (held - total)
