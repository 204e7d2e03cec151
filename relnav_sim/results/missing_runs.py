"""Runs of a campaign that no piece of it holds: which, in a list and in a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from relnav_sim.results.campaign_header import ResultHeader
from relnav_sim.results.pieces import Piece

_MOST_NAMED = 4  # cases with a filter, and ranges of runs of each


@dataclass(frozen=True)
class MissingRuns:
    """The runs of one filter in one case that no piece holds; at least one."""

    case: str
    filter: str
    runs: tuple[int, ...]


def missing_runs(by_case: Mapping[str, Sequence[Piece]], header: ResultHeader) -> list[MissingRuns]:
    """Return the runs that no piece holds, by case and filter.

    Args:
        by_case: Pieces by the id of their case.
        header: The campaign.
    """
    missing = []
    for case in header.cases:
        infos = [piece.info for piece in by_case.get(case.id, ()) if not piece.info.retry]
        for name in case.filters:
            held = {run for info in infos if name in info.filters for run in info.runs}
            if absent := [run for run in header.planned if run not in held]:
                missing.append(MissingRuns(case.label, name, tuple(absent)))
    return missing


def missing_in_words(missing: Sequence[MissingRuns]) -> str:
    """Return how many runs are missing, and the first of them by case and filter.

    Example:
        >>> missing_in_words([MissingRuns("a=1", "ekf", (0, 1, 2, 7))])
        '4 runs are missing: case a=1, filter ekf: runs 0-2, 7'
    """
    count = sum(len(one.runs) for one in missing)
    shown = [
        f"case {one.case}, filter {one.filter}: {run_ranges(one.runs, _MOST_NAMED)}" for one in missing[:_MOST_NAMED]
    ]
    if len(missing) > _MOST_NAMED:
        shown.append(f"and {len(missing) - _MOST_NAMED} more filters and cases")
    return f"{count} {'run is' if count == 1 else 'runs are'} missing: {'; '.join(shown)}"


def run_ranges(runs: Iterable[int], most: int | None = None) -> str:
    """Return run numbers in words: ``run 3``, ``runs 0-7, 9``.

    Args:
        runs: The numbers.
        most: Most ranges that are named; default: all.
    """
    ordered = sorted(runs)
    spans: list[list[int]] = []
    for run in ordered:
        if spans and run == spans[-1][1] + 1:
            spans[-1][1] = run
        else:
            spans.append([run, run])
    words = [str(first) if first == last else f"{first}-{last}" for first, last in spans[:most]]
    left = sum(last - first + 1 for first, last in spans[len(words) :])
    return f"run{'s' if len(ordered) > 1 else ''} {', '.join(words)}{f' and {left} more' if left else ''}"
