"""pydantic's errors rewritten for people: a path of the file, and what to write there."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from relnav_sim.campaign.paths import has, inside, value_at
from relnav_sim.campaign.problems import MOST_NAMED, SHOWN, Path, Problem, did_you_mean, dotted, listed, quoted
from relnav_sim.campaign.shape import Shape
from relnav_sim.campaign.units import meant_key, meant_value
from relnav_sim.filters.registry import double_only, filter_kinds
from relnav_sim.wording import first_of

_MOST_KINDS_NAMED = 14
_PLAIN = 1e12  # numbers from here on are shown with an exponent


def explain(error: ValidationError, data: Any, shape: Shape, path: Path, whole: Shape) -> list[Problem]:
    """Return the problems of one validated part of a campaign.

    Args:
        error: What pydantic said.
        data: The part as it stands in the file.
        shape: What may stand there.
        path: Where the part stands in the file.
        whole: What the whole file may hold, to say where a misplaced key belongs.
    """
    by_place: dict[Path, list[ErrorDetails]] = {}
    for detail in error.errors(include_url=False):
        by_place.setdefault(_place(detail, data), []).append(detail)
    problems = []
    for place, details in itertools.islice(by_place.items(), SHOWN + 1):
        sentence = _sentence(place, details, data, shape, whole)
        problems.append(Problem((*path, *place), sentence))
    return problems


def _place(detail: ErrorDetails, data: Any) -> Path:
    """Return where in the data an error is: pydantic's location without the union members it tried."""
    place: list[str | int] = []
    *parents, last = detail["loc"] or ("",)
    for part in (*parents, last):
        if has(data, part):
            data = inside(data, part)
            place.append(part)
    if detail["type"] == "missing" and isinstance(last, str) and isinstance(data, dict):
        place.append(last)
    if detail["type"] in ("union_tag_not_found", "union_tag_invalid"):
        place.append("kind")
    return tuple(place)


def _sentence(place: Path, details: list[ErrorDetails], data: Any, shape: Shape, whole: Shape) -> str:
    """Return one sentence for everything that is wrong with one value."""
    detail = details[0]
    kind = detail["type"]
    parent = place[:-1]
    value, known = value_at(data, place), shape.at(place, data)
    if kind == "extra_forbidden":
        section = shape.at(parent, data)
        if section is None:
            return unknown_key(str(place[-1]), value, whole, whole)
        if place[-1] == "arithmetic" and (filter_kind := _filter_kind(value_at(data, parent))):
            return double_only(filter_kind)
        others = [form.kind for form in section.alternatives if form.kind and place[-1] in form.keys]
        return unknown_key(str(place[-1]), value, section.chosen(value_at(data, parent)), whole, others)
    if kind == "missing" and isinstance(detail["loc"][-1], str):
        return "this key is missing" + (f": {known.description}" if known and known.description else "")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _unknown_kind(value_at(data, parent), shape.at(parent, data))
    if kind == "value_error":
        return str(detail.get("ctx", {})["error"])
    expected = listed(list(dict.fromkeys(word for detail in details for word in _expected(detail, known))))
    if value is None:
        return f"has no value; it must be {expected}"
    if isinstance(value, str) and known is not None and value in known.keys:
        return f"must be {expected}, not {_shown(value)}; write {{{value}: ...}}"
    return f"must be {expected}, not {_shown(value)}{_hint(place, value, details)}"


def _filter_kind(entry: Any) -> str | None:
    """Return the kind of a section that is a filter."""
    kind = entry.get("kind") if isinstance(entry, dict) else None
    return kind if isinstance(kind, str) and kind in filter_kinds() else None


def unknown_key(key: str, value: Any, section: Shape, whole: Shape, kinds: Sequence[str] = ()) -> str:
    """Return the sentence for a key that a section does not know.

    Args:
        key: The key.
        value: What it is given.
        section: What may stand in the section.
        whole: What the whole file may hold.
        kinds: Other kinds of the section that know the key.
    """
    if key == "kind" and section.keys and key not in section.keys:  # what it is, is said by which key it has
        named = str(value) if str(value) in section.keys else ""
        return f"unknown key; write {named}: ... in its place" if named else _known_here(section)
    # A key that the section of the file knows is unknown to the kind that a case has in its place.
    meant = [] if key in section.keys else section.keys
    known_elsewhere = bool(kinds or whole.homes.get(key))  # and so no misspelling of what is known here
    hint = meant_key(key, value, meant) or ("" if known_elsewhere else did_you_mean(key, meant))
    if not hint and 0 < len(kinds) <= _MOST_KINDS_NAMED:
        hint = f"; it belongs to the kind {listed(list(map(quoted, kinds)))}"
    homes = list(dict.fromkeys(whole.homes.get(key, ()))) if not hint else []
    if homes:
        words = [quoted(dotted(home)) if home else "the top level" for home in homes[:3]]
        hint = f"; it belongs in {listed(words)}"
    elif not hint and section.keys:
        return _known_here(section)
    return f"unknown key{hint}"


def _known_here(section: Shape) -> str:
    return f"unknown key; known here: {first_of(list(section.keys), MOST_NAMED)}"


def _unknown_kind(value: Any, section: Shape | None) -> str:
    kinds = [form.kind for form in section.alternatives if form.kind] if section else []
    if isinstance(value, dict) and "kind" in value:
        hint = did_you_mean(str(value["kind"]), kinds) or f"; the kinds are {listed(kinds, 'and')}"
        return f"there is no kind {quoted(value['kind'])}{hint}"
    return f"this key is missing: {listed(kinds)}"


_TYPES = {
    "bool_type": "true or false",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "string_type": "text",
    "dict_type": "a section with keys",
    "model_type": "a section with keys",
    "model_attributes_type": "a section with keys",
    "list_type": "a list",
}
_BOUNDS = {
    "greater_than": ("greater than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}
_LENGTHS = ("tuple_type", "missing", "too_short", "too_long")


def _expected(detail: ErrorDetails, known: Shape | None) -> list[str]:
    """Return what pydantic wanted, as words to follow "must be"."""
    kind, context = detail["type"], detail.get("ctx", {})
    if kind in _TYPES:
        return [_TYPES[kind]]
    if kind in _BOUNDS:
        words, key = _BOUNDS[kind]
        return [f"{words} {context[key]:.12g}"]
    if kind == "literal_error":
        # Numbers stand in pydantic's text without quotes.
        return [quoted(word) for word in _literals(detail)] or [context["expected"]]
    if kind in _LENGTHS:
        node = known.chosen([]).node if known else {}
        least, most = node.get("minItems"), node.get("maxItems")
        if least == most:
            return ["a list" if least is None else f"a list of {least} values"]
        return [f"a list of at least {least} values" if most is None else f"a list of at most {most} values"]
    if kind == "string_pattern_mismatch":
        return [f"text of the form {context['pattern']}"]
    message = detail["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    return [message[:1].lower() + message[1:]]


def _literals(detail: ErrorDetails) -> list[str]:
    """Return the words that a literal allows, from pydantic's "'a', 'b' or 'c'"."""
    expected = detail.get("ctx", {}).get("expected", "") if detail["type"] == "literal_error" else ""
    return re.findall(r"'([^']*)'", expected)


def _shown(value: Any) -> str:
    match value:
        case bool():
            return str(value).lower()
        case float() if value.is_integer() and abs(value) < _PLAIN:
            return f"{value:.1f}"
        case int() | float():
            return f"{value:.12g}"
        case str():
            return f"the text {quoted(value)}"
        case dict():
            return "a section with keys"
        case list():
            return f"a list of {len(value)}"
        case _:
            return "nothing"


def _hint(place: Path, value: Any, details: list[ErrorDetails]) -> str:
    wanted = {detail["type"] for detail in details}
    if isinstance(value, float) and wanted & {"int_type", "int_from_float"} and value.is_integer():
        return f"; write {int(value)}" if abs(value) < _PLAIN else ""
    if place and (most := [detail["ctx"]["le"] for detail in details if detail["type"] == "less_than_equal"]):
        return meant_value(str(place[-1]), value, most[0])
    if not isinstance(value, str):
        return ""
    if wanted & {"float_type", "int_type"} and re.match(r"[-+.]?[0-9]", value):
        return "; write the number alone, in the unit of the key's name"
    return did_you_mean(value, [word for detail in details for word in _literals(detail)])
