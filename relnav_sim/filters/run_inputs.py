"""What `run_filter` is given: refused in one sentence where it can't be right, before anything is filtered."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Filter, Gaussian
from relnav_sim.given_arrays import covariances, finite, numbers
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import sensors_of


def checked_readings(z: ArrayLike | Mapping[str, ArrayLike], measurement: Measurement) -> tuple[Array, ...]:
    """Return the measurements of every sensor, (runs, T, m), as read-only views or copies; masked entries are NaN.

    Raises:
        ValueError: Other sensors than the filter's, another shape, something that is no number, or an infinite
            measurement.
    """
    sensors = sensors_of(measurement)
    names = [sensor.name for sensor in sensors if sensor.name]
    if not isinstance(z, Mapping):
        if names:
            raise ValueError(
                f"z is one array, the filter has the sensors {_listed(names)}; give the measurements by sensor"
            )
        return (_checked(z, "z", sensors[0].channels),)
    if not names:
        raise ValueError("z gives measurements by sensor, the filter has one sensor without a name; give one array")
    for name in z:
        if name not in names:
            raise ValueError(f"z has measurements of {name!r}, the filter's sensors are {_listed(names)}")
    for name in names:
        if name not in z:
            raise ValueError(f"z has no measurements of {name!r}; where there are none give an array of NaN")
    readings = tuple(_checked(z[sensor.name], f"z[{sensor.name!r}]", sensor.channels) for sensor in sensors)
    for name, one in zip(names, readings, strict=True):
        if one.shape[:2] != readings[0].shape[:2]:
            (runs, epochs), (B, T) = one.shape[:2], readings[0].shape[:2]
            raise ValueError(
                f"z[{name!r}] has {runs} runs of {epochs} epochs, z[{names[0]!r}] {B} runs of {T}; all sensors must "
                "have the same, with NaN where one does not read"
            )
    return readings


def _checked(z: ArrayLike, name: str, place: slice) -> Array:
    channels = place.stop - place.start
    readings = numbers(z, name, masked_is_missing=True).view()
    if readings.ndim != 3:
        hint = f"; for one run use {name}[None]" if readings.ndim == 2 else ""
        raise ValueError(f"{name} has shape {readings.shape}; it must be (runs, T, m){hint}")
    if readings.shape[2] != channels:
        raise ValueError(f"{name} has {readings.shape[2]} components, the measurement {channels}")
    if np.isinf(readings).any():
        run, epoch, channel = np.argwhere(np.isinf(readings))[0].tolist()
        raise ValueError(
            f"{name} is infinite at run {run}, epoch {epoch}, channel {channel}; a missing measurement is NaN, "
            "not infinity"
        )
    readings.flags.writeable = False
    return readings


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))


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


def check_models(filter: Filter, prior: Gaussian, z: Sequence[Array], step_s: float) -> None:
    """Ask dynamics and measurement once whether they fit the states and the measurements.

    Raises:
        ValueError: They do not, or are not given for all runs and epochs.
    """
    runs, epochs, _ = z[0].shape
    m = filter.measurement.dimension
    if not isinstance(step_s, Real) or not 0 < step_s < np.inf:
        raise ValueError(f"step_s is {step_s!r}; it must be a positive number of seconds")
    for model in (filter.dynamics, filter.measurement):
        check_extent = getattr(model, "check_extent", None)
        if check_extent is not None:
            check_extent(runs, epochs)
    if not runs * epochs:
        return
    n = prior.mean.shape[1]
    _check_covariance("process_noise", filter.dynamics.process_noise(prior.mean, Step(0, step_s)), (runs, n, n), (n, n))
    read = np.flatnonzero(np.any([~np.isnan(one).all(axis=(0, 2)) for one in z], axis=0))
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
        raise ValueError(
            f"{name} returned shape {np.shape(array)}; for these states and measurements it must be {wanted}"
        )
