"""A block whose bad runs cost only themselves: what raises is halved until the run to blame stands alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign import Case
from relnav_sim.results import layout
from relnav_sim.results.block import BlockResult, Failure, FilterResult
from relnav_sim.results.case_rows import united_columns
from relnav_sim.runner.work import with_filters
from relnav_sim.simulation.block import scoring_rules, simulate_block
from relnav_sim.simulation.breakdown import Breakdown, breakdown
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.memory import lacks_memory
from relnav_sim.streams import RandomSource
from relnav_sim.truth import truth_trajectory

Log = Callable[[str, str], None]


def simulate_surviving(
    case: Case,
    seed: int,
    runs: Sequence[int],
    case_index: int = 0,
    log: Log = lambda heading, traceback: None,
    learned: Learned | None = None,
) -> BlockResult:
    """Return the results of some runs; a run or a filter that fails is recorded as failed, the others are kept.

    A run's bits do not depend on its block or on the other filters, so the parts may be computed again by themselves.

    Args:
        case: The case.
        seed: The campaign's seed.
        runs: Numbers of the runs, ascending.
        case_index: Number of the case.
        log: Told of every exception that a failed run is due to: whose it is, and its traceback.
        learned: What is learned already; default: nothing.

    Raises:
        MemoryError: There is too little memory: no fault of a run or a filter.
    """
    learned = learned or Learned()

    def again(part: Case, runs: Sequence[int]) -> BlockResult:
        return simulate_surviving(part, seed, runs, case_index, log, learned)

    def failed(part: Case, broken: Breakdown, filter: str = "") -> BlockResult:
        whose = f"filter {filter}" if filter else "truth or sensors"
        log(f"case {part.label}, run {runs[0]}, {whose}, epoch {broken.epoch}", broken.traceback)
        truth = _truth(part, seed, runs)
        return failed_block(part, runs, truth, broken.reason, case_index, filter, epoch=broken.epoch)

    names = list(case.config.filters)
    try:
        outcome = simulate_block(case, seed, runs, case_index, learned)
    except Exception as error:  # truth or sensors: whatever the cause, it must not end the campaign
        if lacks_memory(error):
            raise
        broken = breakdown(error, epoch=-1)
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
        return failed(case, broken)
    return _joined([again(case, half) for half in _halves(runs)])


def failed_block(
    case: Case,
    runs: Sequence[int],
    truth: Array,
    reason: str,
    case_index: int = 0,
    filter: str = "",
    retry: bool = False,
    epoch: int = -1,
) -> BlockResult:
    """Return the result of runs of which nothing but the truth and the reason for their failure is known.

    Args:
        case: The case.
        runs: Numbers of the runs.
        truth: True relative states at the stored epochs, as in `BlockResult`; NaN where they are not known.
        reason: Why, in words.
        case_index: Number of the case.
        filter: The filter to blame; empty: the whole run.
        retry: Whether another attempt may succeed.
        epoch: The epoch at which they failed; -1: not known.
    """
    times = scoring_rules(case.config).stored_s
    return BlockResult(
        case_index=case_index,
        case_id=case.id,
        runs=tuple(runs),
        time_s=times,
        relative=truth,
        filters={name: FilterResult.all_failed(len(runs), len(times), epoch) for name in case.config.filters},
        failures=tuple(Failure(run, filter, epoch, reason) for run in runs),
        shared_truth=not case.config.flown.truth.is_dispersed,
        retry=retry,
    )


def unknown_truth(case: Case, runs: Sequence[int]) -> Array:
    """Return the relative states of a truth that may be what hangs, or what kills its process: NaN."""
    trajectories = len(runs) if case.config.flown.truth.is_dispersed else 1
    return np.full((trajectories, len(scoring_rules(case.config).stored_s), len(layout.COMPONENTS)), np.nan)


def _truth(case: Case, seed: int, runs: Sequence[int]) -> Array:
    """Return the true relative states at the stored epochs; NaN where the truth itself is what fails."""
    config = case.config
    try:
        trajectory = truth_trajectory(config.flown.truth, config.clock.duration_s, RandomSource(seed, tuple(runs)))
        return trajectory.at(scoring_rules(config).stored_s).relative
    except Exception:  # the failure is recorded with its reason already
        return unknown_truth(case, runs)


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
