"""A block whose bad runs cost only themselves: what raises is halved until the run to blame stands alone."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import FrameType

import numpy as np
from numpy.typing import NDArray

from relnav_sim.campaign import Case
from relnav_sim.results import layout
from relnav_sim.results.block import BlockResult, Failure, FilterResult
from relnav_sim.results.merge import united_columns
from relnav_sim.runner.block import scoring_rules, simulate_block
from relnav_sim.runner.breakdown import Breakdown, breakdown
from relnav_sim.runner.work import with_filters
from relnav_sim.streams import RandomSource
from relnav_sim.truth import truth_trajectory

Array = NDArray[np.float64]
Log = Callable[[str, str], None]


class BlockTimeout(BaseException):
    """A block has taken longer than it may. Not an `Exception`, so that no filter's own handler swallows it."""


def simulate_surviving(
    case: Case,
    seed: int,
    runs: Sequence[int],
    case_index: int = 0,
    timeout_s: float | None = None,
    log: Log = lambda heading, traceback: None,
) -> BlockResult:
    """Return the results of some runs; a run or a filter that fails is recorded as failed, the others are kept.

    A run's bits do not depend on its block or on the other filters, so the parts may be computed again by themselves.

    Args:
        case: The case.
        seed: The campaign's seed.
        runs: Numbers of the runs, ascending.
        case_index: Number of the case.
        timeout_s: Most seconds for these runs; if they take longer, their halves have as long each, down to single
            runs and filters, which then count as failed.
        log: Told of every exception that a failed run is due to: whose it is, and its traceback.
    """

    def again(part: Case, runs: Sequence[int]) -> BlockResult:
        return simulate_surviving(part, seed, runs, case_index, timeout_s, log)

    def failed(part: Case, broken: Breakdown, filter: str) -> BlockResult:
        if broken.traceback:
            whose = f"filter {filter}" if filter else "truth or sensors"
            log(f"case {part.label}, run {runs[0]}, {whose}, epoch {broken.epoch}", broken.traceback)
        return failed_block(part, seed, runs, broken.reason, case_index, filter, broken.epoch)

    names = list(case.config.filters)
    try:
        with time_limit(timeout_s):
            outcome = simulate_block(case, seed, runs, case_index)
    except BlockTimeout:
        if len(runs) == 1 and len(names) > 1:
            return _side_by_side([again(with_filters(case, [name]), runs) for name in names])
        broken, blamed = Breakdown(f"took longer than {timeout_s:g} s"), names[0] if len(names) == 1 else ""
    except Exception as error:  # truth or sensors: whatever the cause, it must not end the campaign
        broken, blamed = breakdown(error, epoch=-1), ""
    else:
        parts = [replace(outcome.result, filters=dict(outcome.result.filters))] if outcome.result.filters else []
        for name, broken in outcome.broken.items():
            alone = with_filters(case, [name])
            if len(runs) == 1:
                parts.append(failed(alone, broken, name))
            else:
                parts.append(_joined([again(alone, half) for half in _halves(runs)]))
        whole = _side_by_side(parts)
        return replace(whole, filters={name: whole.filters[name] for name in names})
    if len(runs) == 1:
        return failed(case, broken, blamed)
    return _joined([again(case, half) for half in _halves(runs)])


def failed_block(
    case: Case, seed: int, runs: Sequence[int], reason: str, case_index: int = 0, filter: str = "", epoch: int = -1
) -> BlockResult:
    """Return the result of runs of which nothing but the reason for their failure is known.

    Args:
        case: The case.
        seed: The campaign's seed.
        runs: Numbers of the runs.
        reason: Why, in words.
        case_index: Number of the case.
        filter: The filter to blame; empty: the whole run.
        epoch: The epoch at which they failed; -1: not known.
    """
    times = scoring_rules(case.config).stored_s
    return BlockResult(
        case_index=case_index,
        case_id=case.id,
        runs=tuple(runs),
        time_s=times,
        relative=_truth(case, seed, runs, times),
        filters={name: FilterResult.all_failed(len(runs), len(times), epoch) for name in case.config.filters},
        failures=tuple(Failure(run, filter, epoch, reason) for run in runs),
        shared_truth=not case.config.truth.is_dispersed,
    )


def _truth(case: Case, seed: int, runs: Sequence[int], times_s: Array) -> Array:
    """Return the true relative states at the stored epochs; NaN where the truth itself is what fails."""
    options = case.config.truth
    try:
        trajectory = truth_trajectory(options, case.config.clock.duration_s, RandomSource(seed, tuple(runs)))
        return trajectory.at(times_s).relative
    except Exception:  # the failure is recorded with its reason already
        trajectories = len(runs) if options.is_dispersed else 1
        return np.full((trajectories, len(times_s), len(layout.COMPONENTS)), np.nan)


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise `BlockTimeout` in the block after so many seconds; main thread only.

    Args:
        seconds: The limit; None: no limit.
    """
    if seconds is None:
        yield
        return

    def expire(number: int, frame: FrameType | None) -> None:
        raise BlockTimeout

    before = signal.signal(signal.SIGALRM, expire)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _halves(runs: Sequence[int]) -> tuple[Sequence[int], Sequence[int]]:
    middle = len(runs) // 2
    return runs[:middle], runs[middle:]


def _joined(parts: Sequence[BlockResult]) -> BlockResult:
    """Return blocks of one case as one, in run order."""
    first = parts[0]
    relative = first.relative if first.shared_truth else np.concatenate([part.relative for part in parts])
    return replace(
        first,
        runs=tuple(run for part in parts for run in part.runs),
        relative=relative,
        filters={name: _joined_filter([part.filters[name] for part in parts]) for name in first.filters},
        failures=tuple(failure for part in parts for failure in part.failures),
    )


def _side_by_side(parts: Sequence[BlockResult]) -> BlockResult:
    """Return the results of different filters for the same runs as one."""
    return replace(
        parts[0],
        filters={name: result for part in parts for name, result in part.filters.items()},
        failures=tuple(dict.fromkeys(failure for part in parts for failure in part.failures)),
    )


def _joined_filter(parts: Sequence[FilterResult]) -> FilterResult:
    columns = united_columns([part.columns for part in parts])
    arrays: list[Mapping[str, np.ndarray]] = [part.arrays(columns) for part in parts]
    joined = {name: np.concatenate([part[name] for part in arrays]) for name in arrays[0]}
    return FilterResult.of_arrays(joined, columns)
