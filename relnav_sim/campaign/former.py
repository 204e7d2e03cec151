"""Former spellings: names that campaigns may still use, and that hashes are taken over so that no rename changes them.

A model says which of its keys and words had another name (`Options.former_keys`, `Options.former_words`) and which keys
campaigns did not have at first (`AddedLater`). Reading goes from former to present names, hashing the other way.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import PurePath
from typing import Any, get_args

from pydantic.fields import FieldInfo

from relnav_sim.campaign.paths import parse_path
from relnav_sim.campaign.problems import Path, dotted
from relnav_sim.options import AddedLater, OfReports, Options, Origin

_FIRST_SENSORS = ("radar", "gnss", "star_tracker", "accelerometer")
"""Sensors that once were the keys of their section, with nothing as the value of those that were not there."""

Models = Mapping[str, type[Options]]


def present_spelling(model: type[Options], data: Any) -> Any:
    """Return a section with former keys and words as they are called now; what is no section is left as it is."""
    if not isinstance(data, dict):
        return data
    now = {former: key for key, former in model.former_keys.items()}
    renamed = {now[key] if key in now and now[key] not in data else key: value for key, value in data.items()}
    for key, words in model.former_words.items():
        named = {former: word for word, former in words.items()}
        if isinstance(renamed.get(key), str):
            renamed[key] = named.get(renamed[key], renamed[key])
    return renamed


def former_spelling(model: type[Options], data: Mapping[str, Any]) -> dict[str, Any]:
    """Return a validated section as plain data in its first spelling, later keys left out where they hold defaults."""
    first: dict[str, Any] = {}
    for key, value in data.items():
        field = model.model_fields.get(key)
        if field is not None and _outside_hashes(field, value, data):
            continue
        words = model.former_words.get(key, {})
        first[model.former_keys.get(key, key)] = (
            words.get(value, value) if isinstance(value, str) else _inner(value, _models_of(model, key))
        )
    return first


def _outside_hashes(field: FieldInfo, value: Any, data: Mapping[str, Any]) -> bool:
    """Return whether a key says nothing that a hash must hold.

    That is a later one's default, what only reports look at, or where content came from.
    """
    default = list(field.default) if isinstance(field.default, tuple) else field.default
    return any(
        isinstance(mark, OfReports)
        or (isinstance(mark, AddedLater) and value == default)
        or (isinstance(mark, Origin) and data.get(mark.of) is not None)
        for mark in field.metadata
    )


def _inner(value: Any, models: Sequence[type[Options]]) -> Any:
    """Return a value in its first spelling, sections in it by the one of these models that they are of."""
    if isinstance(value, list):
        return [_inner(each, models) for each in value]
    if not isinstance(value, Mapping):
        return value
    fitting = [model for model in models if "kind" not in value or value["kind"] == model.model_fields["kind"].default]
    return former_spelling(fitting[0], value) if len(fitting) == 1 else value


@cache
def _models_of(model: type[Options], key: str) -> list[type[Options]]:
    """Return the options models that the values of a key are made of."""
    field = model.model_fields.get(key)
    return [] if field is None else _models_in(field.annotation)


def _models_in(annotation: Any) -> list[type[Options]]:
    """Return the options models that a type is made of."""
    if isinstance(annotation, type) and issubclass(annotation, Options):
        return [annotation] if annotation is not Options else []
    return [model for part in get_args(annotation) for model in _models_in(part)]


def present_path(path: Path, content: Mapping[str, Any], sensors: Models) -> Path:
    """Return the path of a value in validated content, a sensor's key by its present name."""
    if path[0] != "sensors" or len(path) < 3:
        return path
    entry = content["sensors"].get(path[1]) or {}
    now = {former: key for key, former in sensors.get(str(entry.get("kind")), Options).former_keys.items()}
    return (*path[:2], now.get(str(path[2]), path[2]), *path[3:])


def former_filter(model: type[Options], kinds: Models, dynamics: Models, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return a validated filter as plain data in its first spelling, its dynamics by the model of their kind.

    Args:
        model: What all filters say.
        kinds: The options model of every kind of filter.
        dynamics: That of every kind of dynamics.
        entry: The filter.
    """
    first = former_spelling(model, entry)
    if entry.get("kind") in kinds:
        first = former_spelling(kinds[entry["kind"]], first)
    motion = first.get("dynamics")
    if isinstance(motion, Mapping) and motion.get("kind") in dynamics:
        first["dynamics"] = former_spelling(dynamics[motion["kind"]], motion)
    return first


def former_content(
    content: Mapping[str, Any],
    sections: Models,
    sensors: Models,
    filters: type[Options],
    kinds: Models,
    dynamics: Models,
) -> dict[str, Any]:
    """Return a campaign's content in its first spelling, for hashes.

    Args:
        content: Validated sections as plain data, with ``grid`` and ``zip`` where there are any.
        sections: The models of the sections that are of one model each.
        sensors: The options model of every kind of sensor.
        filters: The model of what all filters say.
        kinds: The options model of every kind of filter.
        dynamics: The options model of every kind of dynamics.
    """
    first = dict(content)
    for name in sections.keys() & first.keys():
        first[name] = former_spelling(sections[name], first[name])
    if "sensors" in first:
        first["sensors"] = _former_sensors(first["sensors"], sensors)
    if "filters" in first:
        first["filters"] = {
            name: former_filter(filters, kinds, dynamics, entry) for name, entry in first["filters"].items()
        }
    for section in ("grid", "zip"):
        if section in first:
            first[section] = former_variables(first[section], content, sections, sensors, filters)
    return first


def former_variables(
    lists: Mapping[str, Any],
    content: Mapping[str, Any],
    sections: Models,
    sensors: Models,
    filters: type[Options],
) -> dict[str, Any]:
    """Return varied paths and their values in their first spelling, see `former_content`."""
    return dict(_former_variable(text, values, content, sections, sensors, filters) for text, values in lists.items())


def _former_value(path: Path, value: Any, model: type[Options]) -> Any:
    """Return the value at a path of a section in its first spelling."""
    if not path:
        return former_spelling(model, value) if isinstance(value, Mapping) else value
    field = model.model_fields.get(str(path[0]))
    if field is None:
        return value
    inner = _models_in(field.annotation)
    # What stands below a name or a position of the file's own choice is of the same models.
    rest = path[1:]
    while rest and len(inner) >= 1 and not any(str(rest[0]) in each.model_fields for each in inner):
        rest = rest[1:]
    if not rest:
        if any(isinstance(mark, Origin) for mark in field.metadata) and isinstance(value, str):
            return PurePath(value).name
        return _inner(value, inner)
    fitting = [each for each in inner if str(rest[0]) in each.model_fields]
    return _former_value(rest, value, fitting[0])


def _former_sensors(section: Mapping[str, Any], models: Models) -> dict[str, Any]:
    named: dict[str, Any] = dict.fromkeys(_FIRST_SENSORS)
    named |= {name: _former_sensor(name, entry, models) for name, entry in section.items()}
    return named


def _former_sensor(name: str, entry: Any, models: Models) -> Any:
    if not isinstance(entry, Mapping):
        return entry
    first = former_spelling(models[entry["kind"]], entry) if entry.get("kind") in models else dict(entry)
    if first.get("kind") == name:
        del first["kind"]
    return first


def _former_variable(
    text: str,
    values: Any,
    content: Mapping[str, Any],
    sections: Models,
    sensors: Models,
    filters: type[Options],
) -> tuple[str, Any]:
    """Return a varied path and its values in their first spelling."""
    path = parse_path(text, content)
    section, name, *rest = (*path, None)
    if section in sections:
        return text, [_former_value(path[1:], value, sections[str(section)]) for value in values]
    if section == "sensors" and name is not None:
        entry = content["sensors"].get(name) or {}
        model = sensors.get(entry.get("kind", name), Options)
        if rest == [None]:
            return text, [_former_sensor(str(name), value, sensors) for value in values]
        if isinstance(rest[0], str):
            path = (section, name, model.former_keys.get(rest[0], rest[0]), *path[3:])
            return dotted(path), values
    if section == "filters" and name is not None:
        if rest == [None]:
            return text, [former_spelling(filters, value) if isinstance(value, Mapping) else value for value in values]
        words = filters.former_words.get(str(rest[0]), {})
        return text, [words.get(value, value) if isinstance(value, str) else value for value in values]
    return text, values
