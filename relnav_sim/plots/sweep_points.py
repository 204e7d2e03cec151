"""What a campaign varies, as the points of a trend: swept values of cases, or one option of several filters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from relnav_sim.campaign.problems import no_such
from relnav_sim.plots.data import FigureError
from relnav_sim.plots.facts import CaseFacts, case_facts

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

Leaf = float | str


@dataclass(frozen=True)
class Point:
    """One filter in one case, at a value of what is varied."""

    value: Leaf
    case: CaseFacts
    filter: str


@dataclass(frozen=True)
class Trend:
    """The points of one line, by rising value; ``filter`` sets its colour."""

    label: str
    filter: str
    points: tuple[Point, ...]


def varied_paths(results: Results) -> dict[str, list[Leaf]]:
    """Return the paths whose values differ between cases, with their values in the order of the cases.

    Where a case varies a whole section, its leaves count: ``sensors.radar.noise.fraction``.
    """
    leaves = [_case_leaves(results.headers[index].variables) for index in results.nominal]
    return _differing(leaves)


def trends(
    results: Results,
    case: CaseFacts | None = None,
    along: str | None = None,
    filters: Sequence[str] | None = None,
    known: Sequence[CaseFacts] = (),
) -> tuple[str, tuple[Trend, ...]]:
    """Return what is varied, by its path, and a line per filter over its values.

    Other varied values are held at those of ``case`` (default: the first case with a run). A campaign whose cases
    vary no number may vary a filter's option instead: filters of one kind with different values of it make one line.

    Args:
        results: An opened result.
        case: The case whose other values are kept.
        along: The path, or its end (``alpha``); default: the number with the most values.
        filters: The filters; default: all.
        known: Cases whose facts have been read already.

    Raises:
        FigureError: Nothing of that name is varied.
    """
    names = tuple(results.filters if filters is None else filters)
    if unknown := [name for name in names if name not in results.filters]:
        raise FigureError(no_such("filter", unknown[0], results.filters))
    over_cases = varied_paths(results)
    numeric = {path: values for path, values in over_cases.items() if _all_numbers(values)}
    over_filters = _filter_options(results, names)
    path = _chosen(along, numeric, over_filters)
    if path in numeric:
        return path, _over_cases(results, case, path, over_cases, names, known)
    return path, _over_filters(case or _first(results), over_filters[path])


def grid_paths(results: Results, along: Sequence[str] | None = None) -> tuple[str, str]:
    """Return the two paths of a grid: those named, by their ends, or the two with the most values.

    Raises:
        FigureError: The campaign does not vary two.
    """
    over_cases = varied_paths(results)
    if along is not None and len(along) != 2:
        raise FigureError(f"a grid has two axes, not {len(along)}")
    ordered = sorted(over_cases, key=lambda path: -len(set(over_cases[path])))
    # Leaves of one section that change together (the kind of a noise and its scale) are one axis, not two.
    if along is None:
        pairs = [
            (a, b)
            for place, a in enumerate(ordered)
            for b in ordered[place + 1 :]
            if len(set(zip(over_cases[a], over_cases[b], strict=True)))
            > max(len(set(over_cases[a])), len(set(over_cases[b])))
        ]
        if not pairs:
            raise FigureError("a heat map needs a campaign that varies two parameters independently")
        return pairs[0]
    return _named(along[0], over_cases), _named(along[1], over_cases)


def _over_cases(
    results: Results,
    case: CaseFacts | None,
    path: str,
    varied: Mapping[str, list[Leaf]],
    names: Sequence[str],
    known: Sequence[CaseFacts],
) -> tuple[Trend, ...]:
    kept = (case or _first(results)).index
    together = {other for other in varied if _moves_with(varied[other], varied[path])}
    others = [other for other in varied if other != path and other not in together]
    facts_of = {facts.index: facts for facts in known}
    cases = [
        facts_of.get(index) or case_facts(results, index)
        for index in results.nominal
        if all(varied[other][index] == varied[other][kept] for other in others)
    ]
    found = []
    for name in names:
        points = [Point(varied[path][facts.index], facts, name) for facts in cases if name in facts.names]
        found.append(Trend(name, name, tuple(sorted(points, key=lambda point: float(point.value)))))
    return tuple(trend for trend in found if trend.points)


def _over_filters(case: CaseFacts, options: Mapping[str, float]) -> tuple[Trend, ...]:
    ordered = sorted((value, name) for name, value in options.items() if name in case.names)
    points = tuple(Point(value, case, name) for value, name in ordered)
    return (Trend("", points[0].filter, points),) if points else ()


def _filter_options(results: Results, names: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return the numeric options in which filters of one kind differ, with the filters' values."""
    entries = results.campaign_content.get("filters", {})
    kinds: dict[str, list[str]] = {}
    for name in names:
        kinds.setdefault(str(entries.get(name, {}).get("kind", "")), []).append(name)
    found: dict[str, dict[str, float]] = {}
    for kind, members in kinds.items():
        leaves = [dict(_leaves(entries.get(name, {}))) for name in members]
        for path, values in _differing(leaves).items():
            if len(members) > 1 and _all_numbers(values):
                found[f"{kind} {path}"] = dict(zip(members, map(float, values), strict=True))
    return found


def _chosen(along: str | None, numeric: Mapping[str, Any], options: Mapping[str, Any]) -> str:
    if along is not None:
        return _named(along, {**numeric, **options})
    if numeric:
        return max(numeric, key=lambda path: len(set(numeric[path])))
    if options:
        return max(options, key=lambda path: len(set(options[path].values())))
    raise FigureError("nothing with a number is varied: neither the cases nor filters of one kind differ in one")


def _named(end: str, paths: Mapping[str, Any]) -> str:
    found = [path for path in paths if path == end or path.endswith((f".{end}", f" {end}"))]
    if len(found) == 1:
        return found[0]
    what = "more than one of these" if found else "none of these"
    raise FigureError(f"{end!r} is {what}: {', '.join(found or paths) or 'nothing is varied'}")


def _first(results: Results) -> CaseFacts:
    for index in results.nominal:
        if (facts := case_facts(results, index)).filters:
            return facts
    raise FigureError("no run has been computed yet")


def _moves_with(other: Sequence[Leaf], path: Sequence[Leaf]) -> bool:
    """Return whether one value is known once the other is: zipped lists, leaves of one section."""
    return len(set(zip(other, path, strict=True))) == len(set(path)) and len(set(other)) > 1


def _differing(leaves: Sequence[Mapping[str, Leaf]]) -> dict[str, list[Leaf]]:
    paths = dict.fromkeys(path for found in leaves for path in found)
    columns = {path: [found.get(path, "") for found in leaves] for path in paths}
    return {path: values for path, values in columns.items() if len(set(values)) > 1}


def _all_numbers(values: Sequence[Leaf]) -> bool:
    return all(isinstance(value, float) for value in values)


def _case_leaves(variables: Mapping[str, Any]) -> dict[str, Leaf]:
    return {path: leaf for name, value in variables.items() for path, leaf in _leaves(value, name)}


def _leaves(value: Any, path: str = "") -> list[tuple[str, Leaf]]:
    if isinstance(value, Mapping):
        return [leaf for key, inner in value.items() for leaf in _leaves(inner, f"{path}.{key}" if path else str(key))]
    if isinstance(value, int | float) and not isinstance(value, bool):
        return [(path, float(value))]
    return [(path, str(value))]
