"""What a campaign varies: `grid:` (every combination) and `zip:` (parallel lists) to the cases' values.

Values are a list, or have names: ``sensors: {dusk: {...}, noon: {...}}``. A name is what its value is called in labels,
and no more: content, hashes and ids know the values alone.
"""

from __future__ import annotations

import itertools
import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from relnav_sim.campaign.file_model import check_name
from relnav_sim.campaign.paths import PathError, parse_path, replaced, value_at
from relnav_sim.campaign.problems import Path, Problem, did_you_mean, dotted, listed, quoted

MOST_CASES = 10_000
BASE_LABEL = "base"
"""The label of a campaign's only case where nothing is varied."""
LONGEST_LABEL = 120


@dataclass(frozen=True)
class Variable:
    """A path that the campaign varies.

    Attributes:
        text: The path as written, the name of the variable everywhere.
        path: The same as keys and positions.
        section: ``grid`` or ``zip``.
        values: The values as written.
        keys: Where each value stands in its list, or its name.
        labels: A short word for each value, distinct.
        made: The first keys of the path up to one that the file does not have; the whole path where it has all.
    """

    text: str
    path: Path
    section: str
    values: tuple[Any, ...]
    keys: tuple[int | str, ...]
    labels: tuple[str, ...]
    made: Path


@dataclass(frozen=True)
class Point:
    """One case before validation.

    Attributes:
        choices: Each variable with the index of its value.
        data: The file's sections with the values in place.
    """

    choices: tuple[tuple[Variable, int], ...]
    data: dict[str, Any]

    @property
    def label(self) -> str:
        """The values in words: ``sensors.radar.noise.kind=mixture, clock.step_s=1``."""
        words = (f"{variable.labels[index]}" for variable, index in self.choices)
        return ", ".join(words) or BASE_LABEL

    def written(self, problem: Problem) -> Problem:
        """Return a problem of the case's data at the place in the file where the value was written."""
        path = problem.path
        for variable, index in self.choices:
            if path[: len(variable.path)] == variable.path:
                place = (variable.section, variable.text, variable.keys[index], *path[len(variable.path) :])
                return Problem(place, problem.sentence)
            if path[: len(variable.made)] == variable.made:
                sentence = f"nothing but this list gives {dotted(variable.made)}; {dotted(path)}: {problem.sentence}"
                return Problem((variable.section, variable.text), sentence)
        return problem


def read_variables(data: dict[str, Any], sections: tuple[str, ...]) -> tuple[tuple[Variable, ...], tuple[Problem, ...]]:
    """Return what `grid:` and `zip:` vary.

    Args:
        data: The file's data.
        sections: The sections that a path may begin with.
    """
    variables: list[Variable] = []
    problems: list[Problem] = []
    for section in ("grid", "zip"):
        lists = data.get(section)
        if lists is None:
            continue
        if not isinstance(lists, dict):
            problems.append(Problem((section,), "must be a section of paths, each with a list of values"))
            continue
        for text, values in lists.items():
            try:
                variables.append(_variable(text, values, section, data, sections))
            except PathError as error:
                problems.append(Problem((section, text), str(error)))
    problems += _overlaps(variables)
    problems += _unequal(variables)
    cases = case_count(variables)
    if cases > MOST_CASES:
        problems.append(Problem(("grid",), f"makes {cases} cases; a campaign has at most {MOST_CASES}"))
    return tuple(_with_paths_where_names_recur(variables)), tuple(problems)


def case_count(variables: list[Variable] | tuple[Variable, ...]) -> int:
    """Return the number of cases: the product over `grid:` times the length of `zip:`."""
    lengths = [len(variable.values) for variable in variables if variable.section == "grid"]
    return math.prod(lengths) * max([len(v.values) for v in variables if v.section == "zip"], default=1)


def points(data: dict[str, Any], variables: tuple[Variable, ...]) -> Iterator[Point]:
    """Yield every case's data, the first path of `grid:` varying slowest and `zip:` fastest.

    Args:
        data: The file's sections, without `grid:` and `zip:`.
        variables: From `read_variables`, which found no problem in them.
    """
    swept = [variable for variable in variables if variable.section == "grid"]
    together = [variable for variable in variables if variable.section == "zip"]
    steps = len(together[0].values) if together else 1
    for indices in itertools.product(*(range(len(variable.values)) for variable in swept), range(steps)):
        choices = (*zip(swept, indices, strict=False), *((variable, indices[-1]) for variable in together))
        point = data
        for variable, index in choices:
            point = replaced(point, variable.path, variable.values[index])
        yield Point(choices, point)


def _variable(text: str, values: Any, section: str, data: Any, sections: tuple[str, ...]) -> Variable:
    path = parse_path(text, data)
    if path[0] not in sections:
        hint = did_you_mean(str(path[0]), sections) or f"; a path begins with {listed(sections)}"
        raise PathError(f"{quoted(path[0])} cannot be varied{hint}")
    if not isinstance(values, list | dict) or not values:
        raise PathError("must be a list of at least one value, or a section of values by name")
    keys: Sequence[int | str] = list(values) if isinstance(values, dict) else range(len(values))
    names = _checked_names(values) if isinstance(values, dict) else []
    values = list(values.values()) if isinstance(values, dict) else values
    replaced(data, path, values[0])
    flat = [_leaves(value, text) for value in values]
    places: dict[tuple[tuple[str, str], ...], int] = {}
    for position, leaves in enumerate(flat):
        first = places.setdefault(tuple(sorted((name, _word(leaf)) for name, leaf in leaves.items())), position)
        if section == "grid" and first < position:
            which = f"{names[first]} and {names[position]}" if names else f"{first + 1} and {position + 1} of the list"
            raise PathError(f"values {which} are the same; keep one")
    made = next((path[:end] for end in range(1, len(path)) if value_at(data, path[:end]) is None), path)
    return Variable(text, path, section, tuple(values), tuple(keys), tuple(names) or _labels(text, flat), made)


def _checked_names(values: dict[str, Any]) -> list[str]:
    """Return the names of named values.

    Raises:
        PathError: One would not serve as a label, or is that of a case where nothing is varied.
    """
    for name in values:
        if name.isdecimal():
            raise PathError(f"the name {name} of a value would be taken for the number of a case; take another")
        try:
            check_name(name)
        except ValueError as error:
            raise PathError(f"the name {name!r} of a value: {error}") from None
        if name == BASE_LABEL:
            raise PathError(f"{name!r} is the case of a campaign that varies nothing; take another name, as nominal")
    return list(values)


def _with_paths_where_names_recur(variables: Sequence[Variable]) -> Iterator[Variable]:
    """Yield the variables, their paths before the names of those that share one: ``truth.drag=low, sensors=low``."""
    uses = Counter(name for variable in variables for name in variable.labels)
    for variable in variables:
        named = variable.keys == variable.labels
        if named and any(uses[name] > 1 for name in variable.labels):
            variable = replace(variable, labels=tuple(f"{variable.text}={name}" for name in variable.labels))
        yield variable


def _overlaps(variables: list[Variable]) -> list[Problem]:
    problems = []
    for one, other in itertools.combinations(variables, 2):
        shorter = min(len(one.path), len(other.path))
        if one.path[:shorter] == other.path[:shorter]:
            sentence = f"varies the same value as {one.section}.{one.text}; keep one"
            problems.append(Problem((other.section, other.text), sentence))
    return problems


def _unequal(variables: list[Variable]) -> list[Problem]:
    lengths = {variable.text: len(variable.values) for variable in variables if variable.section == "zip"}
    if len(set(lengths.values())) < 2:
        return []
    found = ", ".join(f"{text} has {count}" for text, count in lengths.items())
    return [Problem(("zip",), f"its lists must be equally long: {found}")]


def _labels(text: str, flat: list[dict[str, Any]]) -> tuple[str, ...]:
    """Return a label for each value: every key that differs, or `kind` alone if that tells the values apart.

    Of the keys of a section only the first is written with its whole path: ``truth.drag.area_m2=1,mass_kg=50``.

    Args:
        text: The variable's path.
        flat: Each value's leaves by dotted path.
    """
    varied = [
        name for name in dict.fromkeys(itertools.chain(*flat)) if len({_word(leaves.get(name)) for leaves in flat}) > 1
    ]
    kinds = [name for name in varied if name == f"{text}.kind" and _tells_apart(name, flat)]
    names = kinds or varied or list(flat[0])[:1]
    labels = []
    for leaves in flat:
        shown = [name for name in names if name in leaves]
        words = [f"{name}={_word(leaves[name])}" for name in shown] or [f"{name}=default" for name in names]
        labels.append(",".join([words[0], *(word.removeprefix(f"{text}.") for word in words[1:])]))
    if max(map(len, labels)) > LONGEST_LABEL:
        return tuple(f"{text}=#{position}" for position in range(1, len(flat) + 1))
    return tuple(labels)


def _tells_apart(name: str, flat: list[dict[str, Any]]) -> bool:
    """Return whether the leaf stands in every value and differs wherever two values differ at all."""
    if not all(name in leaves for leaves in flat):
        return False
    whole = {tuple(sorted((key, _word(leaf)) for key, leaf in leaves.items())) for leaves in flat}
    return len({_word(leaves[name]) for leaves in flat}) == len(whole)


def _leaves(value: Any, text: str) -> dict[str, Any]:
    if isinstance(value, dict) and value:
        return {name: leaf for key, inner in value.items() for name, leaf in _leaves(inner, f"{text}.{key}").items()}
    return {text: value}


def _word(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, float) and float(f"{value:g}") == value:
        return f"{value:g}"
    return json.dumps(value)
