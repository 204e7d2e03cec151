"""The points of a campaign's grid, each validated: its parts by themselves, and together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

from relnav_sim.campaign.checks import Parts, check_together
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.expand import Point, Variable, points
from relnav_sim.campaign.file_model import DEFAULTS, SECTIONS, PartValidator, check_name
from relnav_sim.campaign.manoeuvres import default_thrust
from relnav_sim.campaign.problems import SHOWN, Problem, did_you_mean, listed
from relnav_sim.sensors import Sensors, sensor_kinds

_CASES_WITH_PROBLEMS = 8
"""Enough to tell a problem of one value from a problem of the whole file."""


@dataclass(frozen=True)
class ValidatedPoint:
    """A point of the grid with what of it is valid."""

    point: Point
    parts: Parts


def validated_points(
    data: dict[str, Any], variables: tuple[Variable, ...], validator: PartValidator
) -> tuple[list[ValidatedPoint], list[Problem]]:
    """Return every point of the grid with its valid parts, and the problems of all.

    Args:
        data: The file's data.
        variables: What it varies, from `read_variables`.
        validator: Of this file.
    """
    base = {key: data[key] for key in (*SECTIONS, "filters") if key in data}
    cases: list[ValidatedPoint] = []
    found: dict[Problem, list[Point]] = {}
    seen = 0
    for point in points(base, variables):
        seen += 1
        case, problems = _validated(point, validator)
        for problem in problems:
            found.setdefault(point.written(problem), []).append(point)
        cases.append(case)
        if problems and seen >= _CASES_WITH_PROBLEMS:
            break
    return cases, [_of_cases(problem, having, seen) for problem, having in found.items()]


def in_one_spelling(cases: Sequence[ValidatedPoint]) -> list[ValidatedPoint]:
    """Return valid cases with `known_thrust` left out of the filters that say what its default means in every case.

    The default depends on the sensors, so that unlike others it can't be filled in before they are known.
    """
    having: dict[str, list[ValidatedPoint]] = {}
    for case in cases:
        for name in case.parts.filters:
            having.setdefault(name, []).append(case)
    spelt_out = {
        name
        for name, own in having.items()
        if all(_says_the_default(case.parts.filters[name], case.parts.sensors) for case in own)
    }
    return [replace(case, parts=replace(case.parts, filters=_without_thrust(case, spelt_out))) for case in cases]


def _says_the_default(entry: FilterEntry, sensors: Sensors | None) -> bool:
    return sensors is not None and entry.known_thrust == default_thrust(sensors)


def _without_thrust(case: ValidatedPoint, names: Collection[str]) -> dict[str, FilterEntry]:
    return {
        name: entry.model_copy(update={"known_thrust": None}) if name in names else entry
        for name, entry in case.parts.filters.items()
    }


def _of_cases(problem: Problem, found: list[Point], seen: int) -> Problem:
    """Return the problem with the values of the cases that have it, where the place does not say them already."""
    if len(found) == seen or problem.path[0] in ("grid", "zip"):
        return problem
    common = [choice for choice in found[0].choices if all(choice in other.choices for other in found)]
    label = Point(tuple(common), {}).label if common else f"{found[0].label} and {len(found) - 1} more"
    return Problem(problem.path, f"{problem.sentence} (in the case {label})")


def _validated(point: Point, validator: PartValidator) -> tuple[ValidatedPoint, list[Problem]]:
    parts: dict[str, Any] = {}
    filters: dict[str, Any] = {}
    problems: list[Problem] = []
    for section, (_, words) in SECTIONS.items():
        if section == "sensors" and section in point.data:
            parts[section], found = _sensors(point.data[section], validator)
            problems += found
        elif section in point.data:
            value, found = validator.part((section,), point.data[section])
            problems += found
            if value is not None:
                parts[section] = value
        elif section in DEFAULTS:
            parts[section] = DEFAULTS[section]
        else:
            problems.append(Problem((section,), f"this section is missing: {words}"))
    entries = point.data.get("filters")
    if not isinstance(entries, dict) or not entries:
        problems.append(Problem(("filters",), "a campaign needs at least one filter, as 'name: {kind: ekf}'"))
        entries = {}
    for name, entry in entries.items():
        value, found = validator.part(("filters", name), entry)
        problems += found
        try:
            check_name(name)
        except ValueError as error:
            problems.append(Problem(("filters", name), str(error)))
        if value is not None:
            filters[name] = value
        if len(problems) > SHOWN:
            break
    together = Parts(**parts, filters=filters)
    return ValidatedPoint(point, together), [*problems, *check_together(together, validator.tried)]


def _sensors(section: Any, validator: PartValidator) -> tuple[dict[str, Any] | None, list[Problem]]:
    """Return the valid sensors by name, or nothing where one is wrong, and the problems; an empty entry is none."""
    if not isinstance(section, dict):
        return None, [Problem(("sensors",), "must be a section of sensors, as 'radar: {range_sigma_m: 4, ...}'")]
    sensors: dict[str, Any] = {}
    problems: list[Problem] = []
    for name, entry in section.items():
        if entry is None:
            continue
        if isinstance(entry, dict) and "kind" not in entry and name not in sensor_kinds():
            kinds = sensor_kinds()
            hint = did_you_mean(name, kinds) or f"; the kinds are {listed(list(kinds), 'and')}"
            problems.append(Problem(("sensors", name), f"no kind of sensor has this name, so give its kind{hint}"))
            continue
        value, found = validator.part(("sensors", name), entry)
        problems += found
        try:
            check_name(name)
        except ValueError as error:
            problems.append(Problem(("sensors", name), str(error)))
        sensors[name] = value
        if len(problems) > SHOWN:
            break
    return (None if problems else sensors), problems
