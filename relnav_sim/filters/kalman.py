"""The Gaussian update that the Kalman filters share, and the linear Kalman filter."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array, Indices
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.belief import Gaussian, Innovation, KeepsModels, considered_states, keep_considered
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    covariance_prediction,
    gaussian_numbers,
    linearised_update,
    mean_in_single,
)
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.single_precision import SinglePrecision, joseph_in_single
from relnav_sim.filters.square_root import semidefinite_root
from relnav_sim.filters.square_root_update import degenerate_innovation, square_root_update
from relnav_sim.linalg import DOUBLE, SINGLE, by_run
from relnav_sim.measurements.interface import CompiledUpdate, Measurement, Stretch, linearised
from relnav_sim.measurements.partial import present_channels, unit_where_absent
from relnav_sim.options import Options, Tunable
from relnav_sim.streams import RandomSource


class GaussianFilterOptions(Options):
    """Options of every filter with a Gaussian belief."""

    gate_probability: float | None = Field(
        default=None,
        gt=0,
        lt=1,
        description="Former name of `editing: {probability}`, which also says what happens when too many measurements "
        "are rejected; use that. Default: none",
    )


class LinearisedFilterOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of the filters with a Gaussian belief and linearised models."""


class GaussianFilter(KeepsModels):
    """Prediction and starting of a filter whose belief is a Gaussian; `correct` is the algorithm's own.

    Attributes:
        considers: Whether the filter can account for states without estimating them.
        matches_covariance: Whether its corrections tell how much process noise there is, see `CovarianceMatching`.
        nominal_gain: Whether its gain follows from its models along a trajectory, whatever the measurements say, so
            that an error budget can be drawn up for it.
        edits: Whether its NIS is chi-square where its models are right, so that measurements can be edited by it.
    """

    stochastic = False
    considers = True
    matches_covariance = True
    nominal_gain = False
    edits = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: GaussianFilterOptions) -> None:
        self.dynamics = dynamics
        self.measurement = measurement
        # Options of other filters have no such key: they compute in float64.
        in_single = getattr(options, "arithmetic", "float64") == "float32"
        self._single = SinglePrecision(dynamics, measurement) if in_single else None

    def start(self, prior: Gaussian, source: RandomSource) -> Any:
        """Return the prior."""
        return prior if self._single is None else self._single.own(prior)

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the belief with mean f(m) and covariance F P F^T + Q."""
        if self._single is not None:
            return self._single.predict(belief, step)
        dynamics, m, P = self.dynamics, np.ascontiguousarray(belief.mean), np.ascontiguousarray(belief.covariance)
        F, Q = by_run(dynamics.transition(m, step)), by_run(dynamics.process_noise(m, step))
        if getattr(dynamics, "moves_by_transition", False):  # as `moves_by_transition`, without another call
            return Gaussian(*kernels.kalman.predict_linear(m, P, F, Q))
        return Gaussian(dynamics.propagate(m, step), kernels.kalman.predict(P, F, Q))

    def linear_step(self, belief: Any, step: Step) -> tuple[Array, Array]:
        """Return F and Q, (runs or 1, n, n), of the linear step that `predict` amounts to; a smoother goes back by it.

        The prediction has the covariance F P F^T + Q, and F P is its covariance with the state before.
        """
        m = np.ascontiguousarray(belief.mean, dtype=np.float64)
        return by_run(self.dynamics.transition(m, step)), by_run(self.dynamics.process_noise(m, step))

    def update(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the corrected belief, its considered states as they were."""
        corrected, innovation = self.correct(belief, z, step)
        return self.keep_considered(belief, corrected), innovation

    def keep_considered(self, predicted: Any, corrected: Any) -> Any:
        """Return the corrected belief with the considered states as predicted."""
        if self._single is not None:
            return self._single.keep_considered(predicted, corrected)
        considered = getattr(self.dynamics, "considered", None)  # as `considered_states`, without more calls an epoch
        return corrected if considered is None else keep_considered(predicted, corrected, tuple(considered))

    def epochs_by(
        self, of: type, update: CompiledUpdate, belief: Gaussian, stretch: Stretch, first_epoch: int
    ) -> int | None:
        """Do what a class whose `correct` is there as a compiled update says as ``compiled_epochs``.

        Not where anything of that class is replaced in the class of this filter, by itself or by another of its bases,
        or in this filter alone: whatever it is, a step may go through it.

        Args:
            of: The class whose update it is.
            update: The compiled update.
            belief: One epoch before the first.
            stretch: The epochs, which are filled.
            first_epoch: Number of the first.

        Returns:
            For how many epochs it was done; None: it can't be for any.
        """
        own: type = type(self)
        as_it_is = _goes_as(own, of) and _functions(of).isdisjoint(vars(self))
        known = getattr(self.dynamics, "known_steps", None)
        filtered = getattr(self.measurement, "filtered", None)
        if self._single or considered_states(self.dynamics) or known is None or filtered is None or not as_it_is:
            return None
        F_and_Q = known(first_epoch, len(stretch.z))
        return None if F_and_Q is None else filtered(belief.mean, belief.covariance, *F_and_Q, update, stretch)

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the belief after the measurement, and its innovation."""
        raise TypeError(f"{type(self).__name__} has no correct(belief, z, step)")


@lru_cache(maxsize=64)
def _goes_as(kind: type, base: type) -> bool:
    """Whether no class that one derived from a base adds replaces anything of the base, its special methods aside.

    Nor where the base's own comes first: by `super` it may call the other.
    """
    names = {name for name in dir(base) if not name.startswith("__")} - {"compiled_epochs"}
    return all(names.isdisjoint(vars(added)) for added in kind.__mro__ if added not in base.__mro__)


@lru_cache(maxsize=64)
def _functions(kind: type) -> frozenset[str]:
    """Names of the functions of a class."""
    return frozenset(name for name in dir(kind) if callable(getattr(kind, name)))


def joseph_update(belief: Gaussian, residual: Array, H: Array, R: Array) -> tuple[Gaussian, Innovation]:
    """Return the Kalman update, exact however wide the prior, and where noise or prediction are singular.

    One Cholesky factor S = L L^T serves all: with W = L^-1 H P and w = L^-1 nu the mean moves by W^T w and the
    covariance becomes P - W^T W, symmetric to the bit where P is. That difference loses as many digits as the prior is
    wider than the noise, so runs where it is a million times as wide get Joseph's form instead (Bucy and Joseph,
    Filtering for Stochastic Processes, 1968), and the update from roots where even S has lost the noise or is singular.
    Each run decides for itself. In float32 it is Joseph's form, and a run whose covariance is lost fails.

    Args:
        belief: The prediction, mean (runs, n) and covariance (runs, n, n).
        residual: z - h(m), angles wrapped, (runs, m).
        H: Jacobian (runs, m, n) or (m, n).
        R: Measurement noise, positive semidefinite, (runs, m, m) or (m, m).

    Returns:
        The posterior and the innovation. Where S is singular, NIS and log-likelihood are those of its range; a
        residual outside it fails the run, because no state explains it.
    """
    if belief.mean.dtype == SINGLE:
        mean, P, innovation = joseph_in_single(belief.mean, belief.covariance, residual, H, R)
        return Gaussian(mean, P), innovation
    H, R = by_run(H), by_run(R)
    m, P, nu = map(np.ascontiguousarray, (belief.mean, belief.covariance, residual))
    mean, P, nis, log_likelihood, rows = kernels.kalman.update(m, P, nu, H, R)
    update = Gaussian(mean, P), Innovation(nis, log_likelihood)
    if not rows.size:
        return update
    prior, h = Gaussian(belief.mean[rows], belief.covariance[rows]), of_runs(H, rows)
    X = semidefinite_root(prior.covariance)
    exact = square_root_update(prior, h, X, h @ X, of_runs(R, rows), residual[rows], reading_size(prior, h))
    return replace_runs(rows, update, exact)


def reading_size(belief: Gaussian, H: Array) -> Array:
    """Return how large the numbers are that H m is a sum of, (runs, m): its rounding is a share of that."""
    size = np.abs(belief.mean) + np.sqrt(np.abs(np.einsum("bii->bi", belief.covariance)))
    return np.einsum("bij,bj->bi", np.abs(H), size)


def replace_runs(
    rows: Indices, update: tuple[Gaussian, Innovation], by: tuple[Gaussian, Innovation]
) -> tuple[Gaussian, Innovation]:
    """Return an update whose runs `rows` are those of another, given for these runs alone."""
    (posterior, innovation), (exact, told) = update, by
    for whole, part in (
        (posterior.mean, exact.mean),
        (posterior.covariance, exact.covariance),
        (innovation.nis, told.nis),
        (innovation.log_likelihood, told.log_likelihood),
    ):
        whole[rows] = part
    return posterior, replace(innovation, failed={int(rows[place]): why for place, why in told.failed.items()})


def of_runs(A: Array, rows: Indices) -> Array:
    """Return the matrices (rows, p, q) of some runs from (runs, p, q) or (1, p, q)."""
    return A[rows] if len(A) > 1 else np.broadcast_to(A, (len(rows), *A.shape[1:]))


def innovation_of(S: Array, residual: Array, reading: Array) -> Innovation:
    """Return NIS and log-likelihood of a residual, in the range of its covariance where that is singular.

    Args:
        S: Its covariance (runs, m, m).
        residual: (runs, m).
        reading: How large the compared measurements are, (runs, m); only decides what counts as rounding.
    """
    # Of whichever arithmetic: it is a figure of the statistics.
    S, residual, reading = (np.ascontiguousarray(A, dtype=DOUBLE) for A in (S, residual, reading))
    nis, log_likelihood, rows = kernels.kalman.innovation(S, residual)
    if len(rows):
        told = degenerate_innovation(S[rows], residual[rows], reading[rows])
        nis[rows], log_likelihood[rows] = told.nis, told.log_likelihood
    return Innovation(nis, log_likelihood)


class KalmanOptions(LinearisedFilterOptions):
    """Options of the linear Kalman filter."""

    r_scale: Annotated[float, Tunable(0.1, 100, scales_noise=True)] = Field(
        default=1.0,
        gt=0,
        description="Factor on R; r_scale = 1/alpha gives exactly what the one-step alpha-divergence filter tends "
        "to with many samples on a linear measurement",
    )


def linearised_operations(size: Size, options: Any) -> Operations:
    """Return what a linear or extended Kalman filter costs; in float32 its update is Joseph's, and F m is its own."""
    n, m, width = size.n, size.m, bytes_of(options)
    count = covariance_prediction(n) + mean_in_single(n, width) + linearised_update(n, m, width)
    return Operations(count, gaussian_numbers(n, m), width)


@register_filter(
    "kf",
    KalmanOptions,
    measurement="cartesian",
    cost_us=0.7,
    overhead_us=25.0,
    linear_only=True,
    operations=linearised_operations,
)
class KalmanFilter(GaussianFilter):
    """Linear Kalman filter (Kalman 1960) on linear measurements: a radar's are converted to Cartesian coordinates.

    The baseline of every comparison: with linear dynamics and the converted measurement nothing is
    approximated but the noise. Use it when range times angle error is small against the range.
    """

    nominal_gain = True

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: KalmanOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._r_scale = options.r_scale

    def believed_noise(self, belief: Any, epoch: int) -> Array:
        """Return r_scale R."""
        return self._r_scale * self.measurement.noise(belief.mean, epoch)

    def compiled_epochs(self, belief: Gaussian, stretch: Stretch, first_epoch: int) -> int | None:
        """Take as many epochs of a stretch in one go as dynamics and measurement can; None: they can't."""
        update = CompiledUpdate("filtered", self._r_scale)
        return self.epochs_by(KalmanFilter, update, belief, stretch, first_epoch)

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the Kalman update with the measurement matrix at the prediction."""
        single = self._single
        if single is not None:
            residual, H, R = single.linearised(z, belief, step.epoch)
        else:
            residual, H, R = linearised(self.measurement, z, belief.mean, step.epoch)
        if self._r_scale != 1:
            R, present = R * self._r_scale, present_channels(self.measurement)
            if present is not None:
                R = unit_where_absent(R, present)
        return (joseph_update if single is None else single.joseph_update)(belief, residual, H, R)
