"""Square-root information filter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Dynamics, Step, moves_by_transition
from relnav_sim.filters.arithmetic import EPS, ModelsInArithmetic
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.kalman import GaussianFilter, LinearisedFilterOptions
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    cholesky,
    gaussian_numbers,
    householder,
    product,
    triangle,
    udu,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.measurements.interface import Measurement
from relnav_sim.streams import RandomSource

_NEEDS = "srif holds the inverse of the covariance, so it needs "
SINGULAR_PRIOR = f"{_NEEDS}a prior with variance in every state; take ud_ekf"
SINGULAR_TRANSITION = f"{_NEEDS}a transition matrix that can be inverted; take ud_ekf"
SINGULAR_NOISE = f"{_NEEDS}measurement noise in every channel; take ud_ekf"

UNEQUAL = (
    "the information of the states is so unequal that float32 can't hold the least of it; take ud_ekf, or states in "
    "units in which their sigmas are alike"
)


@dataclass(frozen=True)
class Information:
    """A Gaussian belief per run: mean x (runs, n), lower-triangular L (runs, n, n) with L L^T = P^-1.

    Attributes:
        x: The mean.
        L: The root.
        prior_lost: Runs (runs,) whose prior had no inverse.
        flow_lost: Runs whose transition had none.
    """

    x: Array
    L: Array
    prior_lost: Mask
    flow_lost: Mask

    @property
    def mean(self) -> Array:
        """The mean (runs, n), in float64 whatever it is held in."""
        return self.x.astype(np.float64)

    @property
    def covariance(self) -> Array:
        """The covariance (L L^T)^-1, (runs, n, n), worked out in float64."""
        return kernels.srif.covariance(np.ascontiguousarray(self.L, dtype=np.float64))


def _operations(size: Size, options: Any) -> Operations:
    """Return what it costs: F^-T L by elimination, and triangular forms of (2 n, 2 n) and (n + 1, n + m).

    The covariance, which relnav's statistics ask for and the filter does not, is not counted.
    """
    n, m = size.n, size.m
    eliminated = sum(1 + n + k * (1 + 2 * k + 4 * n) for k in range(n))
    root_of_noise = udu(n) + n + triangle(n)
    prediction = product(n, n, 1) + root_of_noise + eliminated + n * n * (2 * n - 1) + householder(2 * n, 2 * n)
    whitened = cholesky(m) + m * m * n + m * m
    update = whitened + householder(n + 1, n + m) + 3 + 4 * m + 2 * n + n * (n - 1) + 2 * n
    return Operations(prediction + update, gaussian_numbers(n, m), bytes_of(options))


@register_filter("srif", LinearisedFilterOptions, cost_us=2.0, overhead_us=50.0, operations=_operations)
class SquareRootInformationFilter(GaussianFilter):
    """Square-root information filter: the extended Kalman filter with the root of the inverse covariance held.

    Bierman, Factorization Methods for Discrete Sequential Estimation, 1977. Prediction and update are one orthogonal
    transformation each, and no covariance is formed. Mathematically it is `ekf`. Use it where a prior is extremely
    wide, and where the information of many measurements is to be added up. It needs a prior with variance in every
    state, a transition matrix that can be inverted and noise in every channel, and can't account for a state without
    estimating it; `ud_ekf` has none of these limits.
    """

    considers = False
    nominal_gain = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: LinearisedFilterOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._models = ModelsInArithmetic(dynamics, measurement, options.arithmetic)

    def start(self, prior: Gaussian, source: RandomSource) -> Any:
        """Return the prior with the root of its information, worked out in float64 and then rounded."""
        L, flat = kernels.srif.information(np.ascontiguousarray(prior.covariance), EPS)
        lost = np.zeros(len(L), dtype=bool)
        lost[flat] = True
        L[flat] = np.nan
        own = self._models.own
        return Information(own(prior.mean), own(L), lost, np.zeros(len(L), dtype=bool))

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the belief with mean f(m) and the root of (F P F^T + Q)^-1."""
        prior: Information = belief
        models = self._models
        F, Q = models.matrices(prior.x, step)
        predict = kernels.srif.predict_single if models.single else kernels.srif.predict
        mean, L, flat = predict(np.ascontiguousarray(prior.x), np.ascontiguousarray(prior.L), F, Q, models.eps)
        if not moves_by_transition(self.dynamics):
            mean = models.propagate(prior.x, step)
        if len(flat) == 0:
            return replace(prior, x=mean, L=L)
        lost = prior.flow_lost.copy()
        lost[flat] = True
        return replace(prior, x=mean, L=L, flow_lost=lost)

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the update from the triangular form of information and whitened measurement."""
        prior: Information = belief
        models = self._models
        update = kernels.srif.update_single if models.single else kernels.srif.update
        x, L = np.ascontiguousarray(prior.x), np.ascontiguousarray(prior.L)
        mean, L, nis, log_likelihood, flat = update(x, L, *models.linearised(z, x, step.epoch), models.eps)
        corrected = replace(prior, x=mean, L=L)
        failed = models.coarse(mean, corrected.covariance) if models.single else {}
        if models.single:
            failed |= dict.fromkeys(np.flatnonzero(_unequal(prior, models.eps)).tolist(), UNEQUAL)
        failed |= dict.fromkeys(flat.tolist(), SINGULAR_NOISE)
        failed |= dict.fromkeys(np.flatnonzero(prior.flow_lost).tolist(), SINGULAR_TRANSITION)
        failed |= dict.fromkeys(np.flatnonzero(prior.prior_lost).tolist(), SINGULAR_PRIOR)
        return corrected, Innovation(nis, log_likelihood, failed=failed)


def _unequal(belief: Information, eps: float) -> Mask:
    """Return the runs (runs,) whose least root of information is held to less than a quarter of itself.

    A transformation rounds every entry by about n eps of the norm of L, and its least singular value is above
    1 / sqrt(trace P).
    """
    n = belief.x.shape[1]
    largest = np.square(belief.L.astype(np.float64)).sum(axis=(1, 2))
    return np.asarray(np.square(4 * n * eps) * largest * np.einsum("bii->b", belief.covariance) > 1)
