"""Whether two results can be compared: the same problem, the same random numbers, the same code."""

from __future__ import annotations

from relnav_sim.results.changes import changed_keys, in_words
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.read import Results


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
        reasons.append(f"the campaigns differ in {in_words(keys)}")
    if not {case.id for case in a.headers} & {case.id for case in b.headers}:
        reasons.append("they have no case in common")
    elif not set(a.runs) & set(b.runs):
        reasons.append("they have no run in common")
    reasons += different_code(a.provenance, b.provenance)
    return reasons


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
