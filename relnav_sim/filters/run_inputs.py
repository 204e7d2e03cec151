"""What `run_filter` is given: refused in one sentence where it can't be right, before anything is filtered."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Filter, Gaussian
from relnav_sim.given_arrays import covariances, finite, numbers

Array = NDArray[np.float64]


def checked_readings(z: ArrayLike, channels: int) -> Array:
    """Return z (runs, T, m) as a read-only view or copy; masked entries are NaN, which means missing.

    Raises:
        ValueError: Another shape, something that is no number, or an infinite reading.
    """
    readings = numbers(z, "z", masked_is_missing=True).view()
    if readings.ndim != 3:
        hint = "; for one run use z[None]" if readings.ndim == 2 else ""
        raise ValueError(f"z has shape {readings.shape}; it must be (runs, T, m){hint}")
    if readings.shape[2] != channels:
        raise ValueError(f"z has {readings.shape[2]} components, the measurement {channels}")
    if np.isinf(readings).any():
        run, epoch, channel = np.argwhere(np.isinf(readings))[0].tolist()
        raise ValueError(
            f"z is infinite at run {run}, epoch {epoch}, channel {channel}; a missing reading is NaN, not infinity"
        )
    readings.flags.writeable = False
    return readings


def checked_prior(mean0: ArrayLike, cov0: ArrayLike, runs: int, n: int) -> Gaussian:
    """Return mean (runs, n) and covariance (runs, n, n), copies of their own.

    Raises:
        ValueError: Other shapes than (n,) or (runs, n) and (n, n) or (runs, n, n), an entry that is not finite, or a
            matrix that is no covariance.
    """
    mean = numbers(mean0, "mean0")
    if mean.shape not in ((n,), (runs, n)):
        raise ValueError(
            f"mean0 has shape {mean.shape}; for {runs} run{'s' * (runs != 1)} of {n} states it must be ({n},) or "
            f"({runs}, {n})"
        )
    finite(mean, "mean0", ("run", "state")[-mean.ndim :])
    covariance = covariances(cov0, "cov0", f"({n}, {n}) or ({runs}, {n}, {n})", ([], ["run"]))
    if covariance.shape not in ((n, n), (runs, n, n)):
        raise ValueError(
            f"cov0 has shape {covariance.shape}; for {runs} run{'s' * (runs != 1)} of {n} states it must be ({n}, {n}) "
            f"or ({runs}, {n}, {n})"
        )
    return Gaussian(np.broadcast_to(mean, (runs, n)).copy(), np.broadcast_to(covariance, (runs, n, n)).copy())


def checked_runs(runs: Sequence[int] | None, count: int) -> tuple[int, ...]:
    """Return the run numbers, default 0, 1, ...

    Raises:
        ValueError: Not one for each run, or numbers that are negative, no integers or given twice.
    """
    if runs is None:
        return tuple(range(count))
    try:
        chosen = tuple(operator.index(run) for run in runs)
    except TypeError:
        raise ValueError(f"runs is {runs!r}; it must list whole numbers, one for each run of z") from None
    if len(chosen) != count:
        raise ValueError(f"{len(chosen)} run numbers for {count} runs")
    if any(run < 0 for run in chosen):
        raise ValueError(f"runs holds {min(chosen)}; run numbers start at 0")
    if len(set(chosen)) != count:
        twice = next(run for run in chosen if chosen.count(run) > 1)
        raise ValueError(f"runs holds {twice} twice; two runs of one number would get the same random numbers")
    return chosen


def check_models(filter: Filter, prior: Gaussian, z: Array, step_s: float) -> None:
    """Ask dynamics and measurement once whether they fit the states and the readings.

    Raises:
        ValueError: They do not, or are not given for all runs and epochs.
    """
    runs, epochs, m = z.shape
    if not isinstance(step_s, Real) or not 0 < step_s < np.inf:
        raise ValueError(f"step_s is {step_s!r}; it must be a positive number of seconds")
    for model in (filter.dynamics, filter.measurement):
        check_extent = getattr(model, "check_extent", None)
        if check_extent is not None:
            check_extent(runs, epochs)
    if not z.size:
        return
    n = prior.mean.shape[1]
    _check_covariance("process_noise", filter.dynamics.process_noise(prior.mean, Step(0, step_s)), (runs, n, n), (n, n))
    read = np.flatnonzero(~np.isnan(z).all(axis=(0, 2)))
    if not len(read):
        return
    epoch = int(read[0])
    _check_shape("predict", filter.measurement.predict(prior.mean, epoch), (runs, m))
    _check_shape("jacobian", filter.measurement.jacobian(prior.mean, epoch), (runs, m, n), (m, n))
    _check_covariance("noise", filter.measurement.noise(prior.mean, epoch), (runs, m, m), (m, m))


def checked_seed(seed: int) -> int:
    """Return the seed.

    Raises:
        ValueError: It is no whole number from 0 on.
    """
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if number < 0:
        raise ValueError(f"seed is {seed!r}; it must be a whole number from 0 on")
    return number


def _check_covariance(name: str, matrix: Array, *shapes: tuple[int, ...]) -> None:
    """Refuse a model's matrix that is no covariance; one that is not finite at the prior may be so later."""
    _check_shape(name, matrix, *shapes)
    if np.isfinite(matrix).all():
        covariances(matrix, f"what {name} returned", "", ([], ["run"]))


def _check_shape(name: str, array: Array, *expected: tuple[int, ...]) -> None:
    if np.shape(array) not in expected:
        wanted = " or ".join(map(str, expected))
        raise ValueError(f"{name} returned shape {np.shape(array)}; for these states and readings it must be {wanted}")
