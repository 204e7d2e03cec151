"""What failed in a night, by kind, with the command that looks into one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from relnav_sim.cli.output import count_in_words

if TYPE_CHECKING:
    from relnav_sim.results import Results

KINDS_SHOWN = 8
MOST_COUNTED = 2_000
"""Pairs of a case and a filter up to which diverged runs are counted here; the report counts them in any case."""


def failure_summary(results: Results) -> list[str]:
    """Return what failed, a line for each kind and one with the command to look into the first.

    Runs that lacked memory, or a worker, are no failures and not among them.
    """
    from relnav_sim.results.failure_kinds import grouped

    lacking = set(results.lacked_memory())
    groups = grouped(failure for failure in results.failures() if failure not in lacking)
    lines = []
    for group in groups[:KINDS_SHOWN]:
        run, filter = group.first.run, group.first.filter
        whose = f", filter {filter}" if filter else ""
        lines += [
            f"  {group.count} of kind: {group.kind}",
            f"    first: case {group.case}, run {run}{whose}; {_look(results, group.case, run)}",
        ]
    if len(groups) > KINDS_SHOWN:
        lines.append(f"  and {count_in_words(len(groups) - KINDS_SHOWN, 'more kind')}")
    return lines


def divergence_summary(results: Results) -> list[str]:
    """Return how many runs diverged without failing, by the share of time outside their own ellipsoid, and the first.

    The report also counts those that were outside it earlier, far beyond the Cramér-Rao bound.
    """
    from relnav_sim.statistics.divergence import diverged

    pairs = [(header, name) for header in results.headers for name in header.filters]
    found = []
    for header, name in pairs if len(pairs) <= MOST_COUNTED else ():
        if not len(results.case_runs(header.id, name)):  # all its runs lacked memory, say
            continue
        failed = results.statistic(header.id, name, "failed") == 1
        lost = diverged(failed, results.statistic(header.id, name, "outside_late")) & ~failed
        runs = results.case_runs(header.id, name)
        found += [(header.label, name, int(run)) for run in runs[lost]]
    if not found:
        return []
    case, name, run = found[0]
    return [
        f"  {count_in_words(len(found), 'run of a filter', 'runs of filters')} diverged without failing",
        f"    first: case {case}, run {run}, filter {name}; {_look(results, case, run)}",
    ]


def _look(results: Results, case: str, run: int) -> str:
    from relnav_sim.plots.commands import run_command

    index = results.case_index(case)
    stress = " --stress" if results.headers[index].stress else ""
    return f"look into it: {run_command(results)}{stress} --only {index}:{run} --trace"
