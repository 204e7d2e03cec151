"""`stress:`, truths that no filter is told of: overrides of the truth, the sensors and the error at the start."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from relnav_sim.campaign.cases import ValidatedPoint
from relnav_sim.campaign.checks import Parts, check_together
from relnav_sim.campaign.expand import MOST_CASES
from relnav_sim.campaign.file_model import SECTIONS, PartValidator, check_name
from relnav_sim.campaign.former import present_path
from relnav_sim.campaign.models import CaseConfig, FirstFixStart, GivenStart, Untold
from relnav_sim.campaign.paths import PathError, parse_path, replaced, value_at
from relnav_sim.campaign.problems import Path, Problem, did_you_mean, dotted, listed, no_such, quoted
from relnav_sim.sensors import SensorOptions, sensor_kinds

NOMINAL = "nominal"
"""What the case without a stress is called; no stress may have that name."""
FACTOR = "times"
"""The key of a value that multiplies what filters are told of, as ``{times: 2}``."""
STRESSED = ("truth", "sensors", "start")
_NEVER = {
    "filters": "a stress is a truth that filters are not told of, so it leaves them as they are; for other settings "
    "give another filter",
    "clock": "filters know the time, and all cases of a comparison have the same",
    "statistics": "all cases of a comparison are scored alike",
}
_INSTEAD_OF_SIGMA = {FirstFixStart: "start.velocity_m_s", GivenStart: "start.position_m or start.velocity_m_s"}
"""What to stress where a start draws no error from its sigmas, so that these are what filters are told and no more."""
_GRAVITY, _ZONALS = ("truth", "forces", "gravity"), ("truth", "forces", "zonals")
_OF_A_FIELD = tuple(("truth", "constants", key) for key in ("mu_m3_s2", "radius_m", "j2", "j3", "j4"))
"""What a gravity field brings along."""


@dataclass(frozen=True)
class Override:
    """One value of a stress.

    Attributes:
        text: The path as written.
        path: The same as keys and positions.
        value: What stands there in truth.
        factor: By what the told value is multiplied; None: `value` stands in its place.
    """

    text: str
    path: Path
    value: Any
    factor: float | None = None


@dataclass(frozen=True)
class Stress:
    """A named truth that no filter is told of."""

    name: str
    overrides: tuple[Override, ...]

    def written(self, problem: Problem) -> Problem:
        """Return a problem of the stressed data at the place in the file where the value was written."""
        for override in self.overrides:
            if problem.path[: len(override.path)] == override.path:
                below = problem.path[len(override.path) :]
                if isinstance(override.value, dict | list) and override.factor is None:
                    return Problem(("stress", self.name, override.text, *below), problem.sentence)
                return Problem(("stress", self.name, override.text), problem.sentence)
        return Problem(("stress", self.name), f"{dotted(problem.path)}: {problem.sentence}")

    def content(self, config: CaseConfig) -> dict[str, Any]:
        """Return the overrides as plain data for the campaign's content, from a stressed case."""
        assert config.untold is not None  # the case is stressed
        flown = config.untold.model_dump(mode="json")
        kinds, found = sensor_kinds(), {}
        for override in self.overrides:
            path = present_path(override.path, flown, kinds)
            found[dotted(path)] = override.value if override.factor is not None else value_at(flown, path)
        return found


def read_stress(data: Mapping[str, Any]) -> tuple[tuple[Stress, ...], tuple[Problem, ...]]:
    """Return the stresses of a file, and what is wrong with their names, paths and factors."""
    section = data.get("stress")
    if section is None:
        return (), ()
    if not isinstance(section, dict):
        said = "must be a section of names, each with paths and values, as 'noisy: {sensors.radar.range_sigma_m: 8}'"
        return (), (Problem(("stress",), said),)
    stresses, problems = [], []
    for name, values in section.items():
        place: Path = ("stress", name)
        try:
            check_name(name)
        except ValueError as error:
            problems.append(Problem(place, str(error)))
            continue
        if name == NOMINAL:
            problems.append(Problem(place, "this is what the case without a stress is called; take another name"))
        if not isinstance(values, dict) or not values:
            problems.append(Problem(place, "must be paths with values, as 'sensors.radar.range_sigma_m: 8'"))
            continue
        overrides = []
        for text, value in values.items():
            try:
                overrides.append(_override(text, value, data))
            except PathError as error:
                problems.append(Problem((*place, text), str(error)))
        problems += _overlaps(name, overrides)
        stresses.append(Stress(name, tuple(overrides)))
    return tuple(stresses), tuple(problems)


def _override(text: str, value: Any, data: Mapping[str, Any]) -> Override:
    path = parse_path(text, data)
    section = str(path[0])
    if section in _NEVER:
        raise PathError(_NEVER[section])
    if section not in STRESSED:
        hint = did_you_mean(section, SECTIONS) or f"; a path begins with {listed(STRESSED)}"
        raise PathError(f"{quoted(section)} cannot be stressed{hint}")
    if len(path) < (3 if section == "sensors" else 2):
        example = {"truth": "truth.forces.gravity", "sensors": "sensors.radar.noise"}.get(section, "start.position_m")
        raise PathError(f"give the path of what is different, as {example}: the rest stays as filters are told")
    if not isinstance(value, dict) or FACTOR not in value:
        return Override(text, path, value)
    factor = value[FACTOR]
    if list(value) != [FACTOR] or isinstance(factor, bool) or not isinstance(factor, int | float):
        raise PathError(f"a factor is one number, as '{{{FACTOR}: 2}}'")
    return Override(text, path, value, float(factor))


def _overlaps(name: str, overrides: Sequence[Override]) -> Iterator[Problem]:
    for one, other in itertools.combinations(overrides, 2):
        shorter = min(len(one.path), len(other.path))
        if one.path[:shorter] == other.path[:shorter]:
            yield Problem(("stress", name, other.text), f"overrides the same value as {one.text}; keep one")


def stressed(
    stresses: Sequence[Stress], cases: Sequence[tuple[ValidatedPoint, CaseConfig]], validator: PartValidator
) -> tuple[list[tuple[int, Stress, CaseConfig]], list[Problem]]:
    """Return every case under every stress, as the case's number, the stress and the config, and the problems.

    Args:
        stresses: From `read_stress`, which found no problem in them.
        cases: The campaign's cases: the point with the file's data, and what it became.
        validator: Of this file.
    """
    if stresses and (many := len(cases) * (1 + len(stresses))) > MOST_CASES:
        said = f"makes {many} cases with those of the grid; a campaign has at most {MOST_CASES}"
        return [], [Problem(("stress",), said)]
    made: list[tuple[int, Stress, CaseConfig]] = []
    found: dict[Problem, list[str]] = {}
    for (number, (valid, config)), stress in itertools.product(enumerate(cases), stresses):
        untold, problems = _untold(stress, valid, config, validator)
        for problem in problems:
            found.setdefault(problem, []).append(valid.point.label)
        if untold is not None:
            made.append((number, stress, config.model_copy(update={"untold": untold})))
    return made, [_of_cases(problem, labels, len(cases)) for problem, labels in found.items()]


def _of_cases(problem: Problem, labels: Sequence[str], cases: int) -> Problem:
    if len(labels) == cases:
        return problem
    which = labels[0] if len(labels) == 1 else f"{labels[0]} and {len(labels) - 1} more"
    return Problem(problem.path, f"{problem.sentence} (in the case {which})")


def _untold(
    stress: Stress, valid: ValidatedPoint, config: CaseConfig, validator: PartValidator
) -> tuple[Untold | None, list[Problem]]:
    """Return what happens under a stress in one case, or what is wrong with it."""
    told = config.model_dump(mode="json", exclude={"name", "filters"})
    data: dict[str, Any] = {"start": told["start"], **valid.point.data}
    for override in stress.overrides:
        path = ("stress", stress.name, override.text)
        if override.path[0] == "sensors" and override.path[1] not in config.sensors:
            return None, [Problem(path, no_such("sensor", str(override.path[1]), config.sensors))]
        try:
            data = replaced(data, override.path, _value(override, told))
        except PathError as error:
            return None, [Problem(path, str(error))]
    data = _of_one_gravity(data, told, stress)
    problems: list[Problem] = []
    parts: dict[str, Any] = {"truth": config.truth, "start": config.start, "sensors": dict(config.sensors)}
    for place in dict.fromkeys(o.path[:2] if o.path[0] == "sensors" else o.path[:1] for o in stress.overrides):
        value, wrong = validator.part(place, value_at(data, place))
        problems += wrong
        if place[0] == "sensors":
            parts["sensors"][place[1]] = value
        else:
            parts[str(place[0])] = value
    if not problems:
        problems += check_together(Parts(clock=config.clock, **parts), validator.tried)
    problems = [stress.written(problem) for problem in problems]
    if problems:
        return None, problems
    untold = Untold(**parts)
    return untold, list(_amiss(stress, config, untold, told))


def _of_one_gravity(data: dict[str, Any], told: Mapping[str, Any], stress: Stress) -> dict[str, Any]:
    """Return the data without what belongs to the gravity that filters are told of, where another one takes its place.

    Zonal harmonics and a gravity field exclude each other, and a field has constants of its own.
    """
    given = [override.path for override in stress.overrides]
    replaced_by = {_GRAVITY: _ZONALS, _ZONALS: _GRAVITY}
    gone = [other for model, other in replaced_by.items() if any(path[:3] == model for path in given)]
    if any(path[:2] == ("truth", "forces") for path in given) and (
        value_at(data, _GRAVITY) or value_at(told, _GRAVITY)
    ):
        gone += _OF_A_FIELD
    for path in gone:
        section = value_at(data, path[:-1])
        if isinstance(section, dict) and path[-1] in section and path not in given:
            rest = {key: value for key, value in section.items() if key != path[-1]}
            data = replaced(data, path[:-1], rest)
    return data


def _value(override: Override, told: Mapping[str, Any]) -> Any:
    """Return the value to fly: the override's own, or the told one times its factor."""
    if override.factor is None:
        return override.value
    found = value_at(told, present_path(override.path, told, sensor_kinds()))
    scaled = _scaled(found, override.factor)
    if scaled is None:
        raise PathError("there is no number here to multiply, in the file or by default; give the value itself")
    return scaled


def _scaled(value: Any, factor: float) -> Any:
    """Return a number, or each of a list of numbers, times a factor; None where it is anything else."""
    if isinstance(value, list):
        parts = [_scaled(one, factor) for one in value]
        return None if not parts or None in parts else parts
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    product = value * factor
    return int(product) if isinstance(value, int) and product.is_integer() else product


def _amiss(stress: Stress, config: CaseConfig, untold: Untold, told: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield what no stress may change, and what changes nothing."""
    flown = untold.model_dump(mode="json")
    for override in stress.overrides:
        place = ("stress", stress.name, override.text)
        section, name = override.path[:2]
        path = present_path(override.path, flown, sensor_kinds())
        if section == "sensors" and (said := _another_sensor(config.sensors[str(name)], untold.sensors[str(name)])):
            yield Problem(place, said)
        elif section == "start" and type(config.start) is not type(untold.start):
            yield Problem(
                place, f"filters start as told, {config.start.kind}; a stress changes the error of that start"
            )
        elif section == "start" and (said := _only_told(config, str(path[1]))):
            yield Problem(place, said)
        elif value_at(flown, path) == value_at(told, path):
            yield Problem(place, "filters are told of the same value, so this is no stress")


def _another_sensor(told: SensorOptions, flown: SensorOptions) -> str:
    same = all(getattr(told, key) == getattr(flown, key) for key in ("kind", "host", "channels", "forms"))
    return "" if same else "a stress changes how a sensor errs or when it reads, not its kind, its host or its channels"


def _only_told(config: CaseConfig, key: str) -> str:
    """Return why a key of the start can't be stressed, where it is nothing but what filters are told."""
    instead = _INSTEAD_OF_SIGMA.get(type(config.start), "")
    if not instead or "sigma" not in key:
        return ""
    return f"of this start it is what filters are told, and no error follows from it; stress {instead}"
