"""The loop over epochs: a filter, a block of measurements, a history."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Filter, Gaussian, Innovation, in_c_order, where_runs
from relnav_sim.filters.channel_residuals import ResidualRecorder
from relnav_sim.filters.failed_runs import StatedFailures, failures_of, sentence
from relnav_sim.filters.history import FilterHistory as FilterHistory
from relnav_sim.filters.history import Innovations
from relnav_sim.filters.in_one_go import InOneGo
from relnav_sim.filters.passes import last_pass, unfit, with_unfit
from relnav_sim.filters.readings import Readings
from relnav_sim.filters.returned import Returned
from relnav_sim.filters.run_inputs import check_models, checked_prior, checked_readings, checked_runs, checked_seed
from relnav_sim.measurements.partial import sensors_of
from relnav_sim.streams import RandomSource


def run_filter(
    filter: Filter,
    z: ArrayLike | Mapping[str, ArrayLike],
    mean0: ArrayLike,
    cov0: ArrayLike,
    seed: int = 0,
    runs: Sequence[int] | None = None,
    step_s: float = 1.0,
) -> FilterHistory:
    """Run a filter over a block of measurements: each epoch predicts, then updates.

    Args:
        filter: From `create_filter`, or any object of the same interface.
        z: Measurements (runs, T, m), or {sensor: (runs, T, m)} where the filter was made with measurements by name.
            NaN in a channel, or a masked entry, is that channel missing: the others are used as they are. A row of NaN
            is a missing measurement: predict only. Within an epoch sensors are processed in the order of the filter's.
        mean0: State estimate one step before the first measurement, (runs, n) or (n,).
        cov0: Its covariance, (runs, n, n) or (n, n); zeros are states that are known.
        seed: Seed of the filter's random numbers.
        runs: Run numbers for the random streams, default 0, 1, ...; the same run number gets the same numbers
            whatever the block.
        step_s: Time between epochs, s, for dynamics that ask for it.

    Raises:
        ValueError: Shapes do not fit together, something given is no array of real numbers, a measurement is infinite,
            the prior is not finite or its covariance none, a function of the models writes into its argument, the
            measurements are not those of the filter's sensors, one has channels missing for which the measurement's
            own log_likelihood has no density, or a measurement has other `angles`, say, than when the filter was made.

    Warns:
        RuntimeWarning: Runs failed; it names them, with epoch and reason, as the history's `failures` do.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
        >>> dynamics = LinearDynamics(np.array([[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.eye(2))
        >>> position = LinearMeasurement(np.array([[1.0, 0.0]]), np.eye(1))
        >>> rate = LinearMeasurement(np.array([[0.0, 1.0]]), 0.1 * np.eye(1))
        >>> filter = create_filter("kf", dynamics, {"radar": position, "doppler": rate})
        >>> z = {"radar": np.array([[[1.1], [2.2], [2.9]]]), "doppler": np.array([[[0.9], [np.nan], [1.0]]])}
        >>> history = run_filter(filter, z, mean0=np.zeros(2), cov0=np.eye(2))
        >>> history.dof.tolist()
        [[2, 1, 2]]
        >>> history.nis_by["doppler"].round(2).tolist()
        [[0.37, nan, 0.09]]
    """
    readings = checked_readings(z, filter.measurement)
    count = len(readings[0])
    prior = checked_prior(mean0, cov0, count, filter.dynamics.dimension)
    numbered = checked_runs(runs, count)
    with np.errstate(all="ignore"):  # for the reason in `advance`
        check_models(filter, prior, readings, step_s)
        belief = filter.start(prior, RandomSource(checked_seed(seed), numbered))
    by_sensor = {sensor.name: one for sensor, one in zip(sensors_of(filter.measurement), readings, strict=True)}

    def go(begin: Any) -> tuple[Any, FilterHistory]:
        return advance(filter, begin, by_sensor, first_epoch=0, step_s=step_s)

    belief = last_pass(filter, belief, lambda begin: go(begin)[0])
    history = with_unfit(go(belief)[1], unfit(filter, belief), epoch=0)
    failures = tuple(replace(failure, run=numbered[failure.run]) for failure in history.failures)
    if failures:
        warnings.warn(sentence(failures), RuntimeWarning, stacklevel=2)
    return replace(history, failures=failures)


def advance(
    filter: Filter,
    belief: Any,
    z: Array | Mapping[str, Array],
    first_epoch: int,
    step_s: float,
    reached: Callable[[int], None] = lambda epoch: None,
    with_residuals: bool = False,
) -> tuple[Any, FilterHistory]:
    """Carry a belief over a chunk of epochs; return the last belief and the chunk's history.

    Args:
        filter: The filter.
        belief: Belief one step before the first epoch of z.
        z: Measurements of the chunk, (runs, K, m), NaN where a channel is missing; by sensor where the filter was made
            with several.
        first_epoch: Number of the chunk's first epoch.
        step_s: Time between epochs, s.
        reached: Told of every epoch that begins.
        with_residuals: Whether the history is to have the residuals by channel, which cost one more prediction of each
            measurement.

    Returns:
        The last belief, and the history, whose failures name runs by their place in the block.

    Raises:
        ValueError: The filter has returned something else than arrays of the right type and shape.
    """
    _keep_freed_memory()
    readings = Readings(filter.measurement, z, first_epoch)
    B, K = readings.sensors[0].read.shape
    n = filter.dynamics.dimension
    # What belongs to an epoch lies together: it is written an epoch at a time.
    means, covariances = np.empty((K, B, n)), np.empty((K, B, n, n))
    innovations = Innovations(readings, B, K)
    residuals = ResidualRecorder(readings, B, K) if with_residuals else None
    whole = filter if residuals is None else None
    in_one_go = InOneGo(whole, readings, first_epoch, means, covariances, innovations)
    returned = Returned(B, n)
    belief = returned.belief(belief, "start")
    stated, before = StatedFailures(), Gaussian(belief.mean, belief.covariance)
    # A diverging run turns to inf and NaN in its own row; its failure is reported from there.
    with np.errstate(all="ignore"), readings:
        k = 0
        while k < K:
            step = Step(first_epoch + k, step_s)
            reached(step.epoch)
            if in_one_go.goes_on:
                belief, taken = in_one_go.take(belief, k)
                k += taken
                if taken:
                    continue
            readings.begin(k)
            belief = returned.belief(filter.predict(belief, step), "predict")
            for place, one in enumerate(readings.sensors):
                if filter.stochastic or one.any_read[k]:
                    if readings.several:
                        belief = in_c_order(belief)
                    z_k = readings.attend(place, k)
                    read = one.read[:, k]
                    if residuals is not None and one.any_read[k]:
                        residuals.add(place, k, filter, belief, z_k, read, step.epoch)
                    if one.all_read[k]:
                        belief, innovation = returned.update(filter.update(belief, z_k, step))
                    else:
                        belief, innovation = update_read(filter, belief, z_k, read, step, returned)
                    innovations.add(place, k, innovation)
                    if residuals is not None and innovation.refused is not None:
                        residuals.reject(place, k, innovation.refused)
                    if innovation.failed:
                        stated.add(k, innovation.failed, read)
            means[k] = returned.moment(belief, "mean")
            covariances[k] = returned.moment(belief, "covariance")
            k += 1
    first = Step(first_epoch, step_s)
    history = innovations.history(means.swapaxes(0, 1), covariances.swapaxes(0, 1))
    history = with_failures(history, stated, filter, before, first)
    if residuals is None:
        return belief, history
    failed = {each.run: each.epoch for each in history.failures}
    return belief, replace(history, residuals_by=residuals.by_sensor(failed, first), residuals_cpu_s=residuals.cpu_s)


def with_failures(
    history: FilterHistory, stated: StatedFailures, filter: Filter, before: Gaussian, first: Step
) -> FilterHistory:
    """Return the history of a chunk with the runs that have failed, whose numbers end there.

    Args:
        history: Of the chunk, without failures; it is changed in place.
        stated: What the filter said.
        filter: The filter.
        before: Mean and covariance one epoch before the chunk.
        first: The first step of the chunk.
    """
    both = history.mean, history.covariance
    failures = failures_of(stated, filter, before, first, *both, history.nis, history.log_likelihood)
    for failure in failures:
        lost = failure.run, slice(failure.epoch - first.epoch, None)
        history.dof[lost] = 0
        for name, nis in history.nis_by.items():
            nis[lost], history.dof_by[name][lost] = np.nan, 0
    return replace(history, failures=failures)


def update_read(
    filter: Filter, belief: Any, z: Array, read: Mask, step: Step, returned: Returned
) -> tuple[Any, Innovation]:
    """Return the update and its innovation where not all runs are read, (runs,); the others keep their belief."""
    # A missing row is given its own prediction, so that the arithmetic stays harmless; the result is not used.
    expected = filter.measurement.predict(belief.mean, step.epoch)
    posterior, innovation = returned.update(filter.update(belief, np.where(read[:, None], z, expected), step))
    return where_runs(read, posterior, belief), Innovation(
        np.where(read, innovation.nis, np.nan),
        np.where(read, innovation.log_likelihood, 0.0),
        {name: np.where(read, value, np.nan) for name, value in innovation.extras.items()},
        innovation.failed,
        {name: np.where(read, count, 0) for name, count in innovation.edits.items()},
        innovation.refused,
    )


def _keep_freed_memory() -> None:
    """Let the allocator keep what is freed for the next epoch instead of returning it to the kernel.

    glibc returns freed memory above twice the largest block it has seen freed; faulting a few MB in again at every
    epoch then costs more than the sampling itself (measured: 48 us a run-step instead of 14 with 512 samples and
    200 runs). Freeing one large block, never touched, raises that bound. Elsewhere it does nothing.
    """
    largest_that_counts = 31 << 20  # bytes; glibc's DEFAULT_MMAP_THRESHOLD_MAX is 32 MiB
    np.empty(largest_that_counts, dtype=np.uint8)
