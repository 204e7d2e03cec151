"""Which runs of a filter failed, when, and why: as the filter says, or as its numbers show."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Filter, Gaussian

# A variance below zero by more than this share of the largest that the state has had is no rounding.
_ROUNDING = 1e-9
# From here on squares of squares overflow.
_HUGE = 1e140


@dataclass(frozen=True)
class FailedRun:
    """A run that a filter could not go on with; its estimates are NaN from that epoch on.

    Args:
        run: Number of the run.
        epoch: The first epoch without an estimate.
        reason: Why, in words.
    """

    run: int
    epoch: int
    reason: str


@dataclass
class StatedFailures:
    """The failures that a filter states itself while it goes over a chunk of epochs, the first of each run."""

    by_place: dict[int, tuple[int, str]] = field(default_factory=dict)

    def add(self, column: int, failed: Mapping[int, str], present: Mask) -> None:
        """Take down what failed at a column of the chunk, by place in the block, where there was a measurement."""
        for place, reason in failed.items():
            if present[place]:
                self.by_place.setdefault(int(place), (column, reason))


def failures_of(
    stated: StatedFailures,
    filter: Filter,
    before: Gaussian,
    first: Step,
    mean: Array,
    covariance: Array,
    nis: Array,
    log_likelihood: Array,
) -> tuple[FailedRun, ...]:
    """Return every run that failed over a chunk, by place in the block; its series become NaN from there on.

    Args:
        stated: What the filter said.
        filter: The filter, whose models are asked again where it said nothing.
        before: Mean and covariance one epoch before the chunk.
        first: The first step of the chunk.
        mean: (runs, K, n), changed in place, as the others.
        covariance: (runs, K, n, n).
        nis: (runs, K).
        log_likelihood: (runs, K).
    """
    failed = dict(stated.by_place)
    for place, column in _not_numbers(mean, covariance).items():
        if place not in failed or column < failed[place][0]:
            last = before if column == 0 else Gaussian(mean[:, column - 1], covariance[:, column - 1])
            step = replace(first, epoch=first.epoch + column)
            lost = "a negative variance"
            if not np.isfinite(mean[place, column]).all():
                lost = "non-finite mean"
            elif not np.isfinite(covariance[place, column]).all():
                lost = "non-finite covariance"
            failed[place] = (
                column,
                lost + _cause(filter, last.mean[place], last.covariance[place], len(mean), place, step),
            )
    for place, (column, _) in failed.items():
        for series in (mean, covariance, nis, log_likelihood):
            series[place, column:] = np.nan
    return tuple(FailedRun(place, first.epoch + failed[place][0], failed[place][1]) for place in sorted(failed))


def _not_numbers(mean: Array, covariance: Array) -> dict[int, int]:
    """Return the first column, by place, at which a run is not finite or a variance is negative beyond rounding."""
    found: dict[int, int] = {}
    by_epoch = np.ascontiguousarray(mean.swapaxes(0, 1)), np.ascontiguousarray(covariance.swapaxes(0, 1))
    for place in np.flatnonzero(kernels.statistics.doubtful(*by_epoch)).tolist():
        variances = np.einsum("kii->ki", covariance[place])
        finite = np.isfinite(mean[place]).all(axis=1) & np.isfinite(covariance[place]).all(axis=(1, 2))
        sizes = np.abs(variances)
        largest = np.max(sizes, axis=0, initial=0.0, where=np.isfinite(sizes))
        with np.errstate(invalid="ignore"):
            bad = ~finite | (variances < -_ROUNDING * largest).any(axis=-1)
        if bad.any():
            found[place] = int(np.argmax(bad))
    return found


def _cause(filter: Filter, mean: Array, covariance: Array, runs: int, place: int, step: Step) -> str:
    """Return, as the end of a sentence, why a run is lost, as far as its last mean and covariance tell.

    The models are asked again, for this run in the place of all, so that no other lost run disturbs them.
    """
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        return " from the start"
    if max(np.abs(mean).max(), np.abs(covariance).max()) > _HUGE:
        return ": the estimate grew beyond what a number can hold"
    values = np.linalg.eigvalsh((covariance + covariance.T) / 2)
    if values[0] < -_ROUNDING * max(values[-1], 0.0):
        return " after a covariance that was not positive definite"
    dynamics, measurement = filter.dynamics, filter.measurement
    states = np.repeat(mean[None], runs, axis=0)
    questions: tuple[tuple[str, Callable[[], Array]], ...] = (
        ("propagate of the dynamics", lambda: dynamics.propagate(states, step)),
        ("transition of the dynamics", lambda: dynamics.transition(states, step)),
        ("process_noise of the dynamics", lambda: dynamics.process_noise(states, step)),
        ("predict of the measurement", lambda: measurement.predict(dynamics.propagate(states, step), step.epoch)),
        ("jacobian of the measurement", lambda: measurement.jacobian(dynamics.propagate(states, step), step.epoch)),
        ("noise of the measurement", lambda: measurement.noise(dynamics.propagate(states, step), step.epoch)),
    )
    for name, ask in questions:
        with np.errstate(all="ignore"):
            try:
                answer = np.asarray(ask())
            except AttributeError:  # a filter without derivatives needs no model that has them
                continue
        if not np.isfinite(answer[place] if len(answer) == runs else answer).all():
            return f": {name} gives no finite number"
    return ""


def sentence(failed: Iterable[FailedRun]) -> str:
    """Return one sentence that names the runs, the epoch and the reason; many runs are summed up by reason."""
    by_reason: dict[str, list[FailedRun]] = {}
    for run in failed:
        by_reason.setdefault(run.reason, []).append(run)
    parts = []
    for reason, runs in by_reason.items():
        named = ", ".join(f"{one.run} at epoch {one.epoch}" for one in runs[:5])
        more = f" and {len(runs) - 5} more" if len(runs) > 5 else ""
        parts.append(f"run{'s' if len(runs) > 1 else ''} {named}{more}: {reason}")
    return "the filter failed in " + "; ".join(parts)
