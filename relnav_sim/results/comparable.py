"""Whether two results can be compared: the same problem, the same random numbers, the same code."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import zip_longest

import numpy as np

from relnav_sim.results import layout
from relnav_sim.results.block import AnyArray
from relnav_sim.results.changes import changed_keys
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.read import Results
from relnav_sim.wording import first_of


def comparable(a: Results, b: Results) -> list[str]:
    """Return the reasons why the figures of two results should not be set side by side; empty: they may be.

    Filters that only one of them has, and other numbers of runs, are no reason: runs are matched by their numbers,
    and the same run has the same random numbers in both if the seeds are the same. Nor are other versions of NumPy or
    other machines, which change the last digits only.

    Args:
        a: A result.
        b: Another.
    """
    reasons = []
    if a.seed != b.seed:
        reasons.append(f"the seeds differ ({a.seed} and {b.seed}), so that the runs can't be paired")
    if keys := [key for key in changed_keys(a.campaign_content, b.campaign_content) if key not in ("seed", "name")]:
        reasons.append(f"the campaigns differ in {first_of(keys)}")
    if not {case.id for case in a.headers} & {case.id for case in b.headers}:
        reasons.append("they have no case in common")
    elif not set(a.runs) & set(b.runs):
        reasons.append("they have no run in common")
    reasons += different_code(a.provenance, b.provenance)
    return reasons


def same_numbers(a: Results, b: Results) -> bool:
    """Return whether two results hold the same cases, filters, runs and numbers, bit for bit but for measured times."""
    if a.path.resolve() == b.path.resolve():
        return True
    if [(case.id, dict(case.filter_ids)) for case in a.headers] != [(c.id, dict(c.filter_ids)) for c in b.headers]:
        return False
    if a.failures() != b.failures():
        return False
    return all(
        _same(_numbers(a, case, filter), _numbers(b, case, filter))
        for case, header in enumerate(a.headers)
        for filter in (None, *header.filters)
    )


def _numbers(results: Results, case: int, filter: str | None) -> Iterator[tuple[str, AnyArray | None]]:
    """Yield everything that a result says of a case, or of one of its filters, by name."""
    yield "bound", results.bound(case, filter)
    if filter is None:
        yield "truth", results.truth(case)
        yield "trajectory", results.truth_runs(case).astype(float)
        yield "time", results.time_s(case)
        return
    yield "perfect_bound", results.perfect_bound(case, filter)
    observed = results.observability(case, filter)
    for part in ("ratio", "direction", "sigma_ratio") if observed is not None else ():
        yield part, getattr(observed, part)
    yield "runs", results.case_runs(case, filter).astype(float)
    for spec in layout.SUMMARY:
        if not spec.timing:
            yield spec.name, results.statistic(case, filter, spec.name)
    yield from results.diagnostics(case, filter).items()
    extra = results.augmented(case, filter)
    for part in ("estimate", "error", "sigma", "mean", "rms") if extra is not None else ():
        yield part, getattr(extra, part)
    by_sensor = results.by_sensor(case, filter)
    for spec in layout.BY_SENSOR if by_sensor is not None else ():
        yield spec.name, getattr(by_sensor, spec.name.removeprefix("sensor_"))
    editing = results.editing(case, filter)
    for spec in layout.EDITING if editing is not None else ():
        yield spec.name, getattr(editing, spec.name.removeprefix("edit_"))
    by_channel = results.by_channel(case, filter)
    for part in ("count", "mean", "product") if by_channel is not None else ():
        yield f"channel_{part}", getattr(by_channel, part)
    for series in (results.error, results.sigma, results.nis, results.nees):
        yield series.__name__, series(case, filter)
    yield "covariance", results.covariance(case, filter)


def _same(one: Iterator[tuple[str, AnyArray | None]], other: Iterator[tuple[str, AnyArray | None]]) -> bool:
    for first, second in zip_longest(one, other, fillvalue=("", None)):
        if first[0] != second[0] or (first[1] is None) != (second[1] is None):
            return False
        if first[1] is not None and second[1] is not None and not np.array_equal(first[1], second[1], equal_nan=True):
            return False
    return True


def different_code(a: Provenance, b: Provenance) -> list[str]:
    """Return whether two results come from different code, as a sentence; empty: from the same."""
    versions = [provenance.versions.get("relnav", "unknown") for provenance in (a, b)]
    if versions[0] != versions[1]:
        return [f"they come from different versions of relnav ({versions[0]} and {versions[1]})"]
    if a.git_commit != b.git_commit:
        return [f"they come from different commits ({a.git_commit[:12] or 'none'} and {b.git_commit[:12] or 'none'})"]
    if 1 in (a.git_dirty, b.git_dirty):
        return ["the source of relnav had changes that no commit holds"]
    return []
