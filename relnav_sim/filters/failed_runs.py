"""Which runs of a filter failed, when, and why: as the filter says, or as its numbers show."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from relnav_sim.filters.belief import Gaussian

Array = NDArray[np.float64]

# A variance below zero by more than this share of the largest that the state has had is no rounding.
_ROUNDING = 1e-9


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
    """The failures that a filter states itself while it goes over a stretch of epochs, the first of each run."""

    by_place: dict[int, tuple[int, str]] = field(default_factory=dict)

    def add(self, column: int, failed: Mapping[int, str], present: NDArray[np.bool_]) -> None:
        """Take down what failed at a column of the stretch, by place in the block, where there was a measurement."""
        for place, reason in failed.items():
            if present[place]:
                self.by_place.setdefault(int(place), (column, reason))


def failures_of(
    stated: StatedFailures, before: Gaussian, mean: Array, covariance: Array, nis: Array, log_likelihood: Array
) -> list[tuple[int, int, str]]:
    """Return place, column and reason of every run that failed; its estimates become NaN from there on, in place.

    Args:
        stated: What the filter said.
        before: Mean and covariance one epoch before the first column.
        mean: (runs, K, n).
        covariance: (runs, K, n, n).
        nis: (runs, K); set to NaN with the estimates.
        log_likelihood: (runs, K), likewise, so that a sum over it shows the failure too.
    """
    failed = dict(stated.by_place)
    for place, (column, reason) in _shown_by_the_numbers(before, mean, covariance).items():
        if place not in failed or column < failed[place][0]:
            failed[place] = (column, reason)
    for place, (column, _) in failed.items():
        for series in (mean, covariance, nis, log_likelihood):
            series[place, column:] = np.nan
    return [(place, *failed[place]) for place in sorted(failed)]


def _shown_by_the_numbers(before: Gaussian, mean: Array, covariance: Array) -> dict[int, tuple[int, str]]:
    B, K, n = mean.shape
    variances = np.einsum("bkii->bki", covariance)
    # A sum is finite only if all its terms are, and one product with ones is many times faster than isfinite.
    with np.errstate(all="ignore"):
        mean_ok = np.isfinite(mean @ np.ones(n))
        covariance_ok = np.isfinite(covariance.reshape(B, K, n * n) @ np.ones(n * n))
        negative = (variances < 0).any(axis=-1)
    ok = mean_ok & covariance_ok & ~negative
    found: dict[int, tuple[int, str]] = {}
    for place in np.flatnonzero(~ok.all(axis=1)):
        with np.errstate(invalid="ignore"):
            largest = np.nanmax(np.abs(variances[place]), axis=0, initial=0.0)
            negative_beyond = (variances[place] < -_ROUNDING * largest).any(axis=-1)
        ok[place] = mean_ok[place] & covariance_ok[place] & ~negative_beyond
        if ok[place].all():
            continue
        k = int(np.argmin(ok[place]))
        last = (before.mean, before.covariance) if k == 0 else (mean[:, k - 1], covariance[:, k - 1])
        if mean_ok[place, k] and covariance_ok[place, k]:
            reason = "a negative variance"
        else:
            reason = _reason(last[0][place], last[1][place], bool(mean_ok[place, k]))
        found[int(place)] = (k, reason)
    return found


def _reason(mean: Array, covariance: Array, mean_ok: bool) -> str:
    """Return why a run is not finite any more, as far as its last finite mean and covariance tell."""
    lost = "non-finite covariance" if mean_ok else "non-finite mean"
    if not (np.isfinite(mean).all() and np.isfinite(covariance).all()):
        return f"{lost} from the start"
    if max(np.abs(mean).max(), np.abs(covariance).max()) > _HUGE:
        return f"{lost}: the estimate grew beyond what a number can hold"
    values = np.linalg.eigvalsh((covariance + covariance.T) / 2)
    if values[0] < -_ROUNDING * max(values[-1], 0.0):
        return f"{lost} after a covariance that was not positive definite"
    return lost


_HUGE = 1e140


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
