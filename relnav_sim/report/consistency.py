"""Whether filters' errors match their covariances, in words, over one case or several."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.run_figures import Span, span_index
from relnav_sim.statistics.consistency_verdict import SIGMA_KNOWN, Consistency, ConsistencyVerdict, consistency_of
from relnav_sim.wording import significant

_ORDER: tuple[ConsistencyVerdict, ...] = ("overconfident", "conservative", "may be consistent", "consistent")
PARTS: Mapping[str, str] = {"full": "", "position": "position ", "velocity": "velocity "}
"""What errors are of, before the word, by the part of the state: nothing for the whole."""


def consistency_verdict(item: FilterFacts, span: Span) -> Consistency | None:
    """Return the verdict on a filter in one case; None where there is no ANEES."""
    return consistency_of(item.per_run("anees", span_index(span)))


def consistency_in_words(found: Sequence[Consistency], several: bool = False) -> str:
    """Return what is to be said of a filter, or of several alike, by the verdicts of its cases; without names."""
    parts = []
    for verdict in _ORDER:
        alike = [one for one in found if one.verdict == verdict]
        if alike:
            where = f" in {len(alike)} of {len(found)} cases" if len(alike) < len(found) else ""
            parts.append(_in_words(verdict, where, alike, several))
    return ", ".join(parts)


def size_range(factors: Sequence[float], digits: int = 3) -> str:
    """Return the smallest and the largest of some ratios, or the one where they look alike."""
    low, high = (f"{size:.{digits}g}" if size < 10**digits else f"{size:.0f}" for size in (min(factors), max(factors)))
    return low if low == high else f"{low} to {high}"


def _in_words(verdict: ConsistencyVerdict, where: str, alike: Sequence[Consistency], several: bool) -> str:
    verb, its = ("are", "their") if several else ("is", "its")
    # Where the cases differ in the part of the state that is farthest off, the sizes are of either.
    of = " or ".join(dict.fromkeys(PARTS[one.block].strip() for one in alike if one.block != "full"))
    of = f"{of} " if of and all(one.block != "full" for one in alike) else ""
    if verdict == "consistent":
        return f"{verb} consistent{where} (ANEES near 1)"
    if verdict == "may be consistent":
        ends = [end for one in alike for end in (one.low, one.high)]
        if not all(map(math.isfinite, ends)):
            return f"may be consistent{where} (one run does not tell)"
        size = f"{significant(min(ends), 2)} to {significant(max(ends), 2)} times"
        seems = "may be consistent"
        if all(one.factor > 1 + SIGMA_KNOWN for one in alike):
            seems = f"{'seem' if several else 'seems'} overconfident, not surely"
        return f"{seems}{where} ({its} {of}errors are {size} as large as {its} formal sigma)"
    if verdict == "conservative":
        size = size_range([1 / one.factor for one in alike])
        return f"{verb} conservative{where}: formal {of}sigma {size} times the actual error"
    size = size_range([one.factor for one in alike])
    return f"{verb} overconfident{where}: actual {of}error {size} times the formal sigma"
