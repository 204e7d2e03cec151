"""What a campaign file may hold at a place, read from the models' JSON schema: for messages and documents."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from relnav_sim.campaign.paths import inside
from relnav_sim.campaign.problems import Path


@dataclass(frozen=True)
class Shape:
    """One place of the file: a node of the JSON schema and the definitions it refers to."""

    node: dict[str, Any]
    definitions: dict[str, Any]

    @classmethod
    def of(cls, schema: dict[str, Any]) -> Shape:
        """Return the shape of the whole file."""
        return cls(schema, schema.get("$defs", {}))

    @property
    def description(self) -> str:
        """What the key means; a key's own words win over its model's."""
        return str(self.node.get("description", ""))

    @property
    def model_description(self) -> str:
        """What the section is: its model's docstring."""
        return str(self._target().node.get("description", ""))

    @property
    def keys(self) -> dict[str, Shape]:
        """The keys that may stand here, by name; none where anything else is expected."""
        return {key: Shape(node, self.definitions) for key, node in self._target().node.get("properties", {}).items()}

    @property
    def required(self) -> frozenset[str]:
        """The keys that must stand here."""
        return frozenset(self._target().node.get("required", ()))

    @property
    def alternatives(self) -> tuple[Shape, ...]:
        """The forms that a value here can take; one where there is no choice."""
        node = self._target().node
        choices = node.get("oneOf") or node.get("anyOf")
        if not choices:
            return (self._target(),)
        return tuple(inner for choice in choices for inner in Shape(choice, self.definitions).alternatives)

    @property
    def kind(self) -> str | None:
        """The value of `kind` that selects this form, if one does."""
        kind: dict[str, str] = self._target().node.get("properties", {}).get("kind", {})
        return kind.get("const")

    @cached_property
    def homes(self) -> Mapping[str, Sequence[Path]]:
        """Every key below this place, with the sections that it is known in."""
        found: dict[str, list[Path]] = {}
        for key, path in _keys_below(self):
            found.setdefault(key, []).append(path)
        return found

    def at(self, path: Path, data: Any) -> Shape | None:
        """Return the shape of a place in the data, following each `kind` that stands there; None if unknown."""
        shape: Shape | None = self
        for part in path:
            if shape is None:
                return None
            shape = shape.chosen(data)._child(part)
            data = inside(data, part)
        return shape

    def chosen(self, data: Any) -> Shape:
        """Return the form that fits the data: its kind, or else the form of a mapping or a list."""
        forms = self.alternatives
        kind = data.get("kind") if isinstance(data, dict) else None
        by_kind = [form for form in forms if kind is not None and form.kind == kind]
        wanted = "object" if isinstance(data, dict) else "array" if isinstance(data, list) else None
        fitting = [form for form in forms if form.node.get("type") == wanted]
        if wanted == "object":  # where no kind tells, the keys do that must stand there
            fitting.sort(key=lambda form: not form.required <= data.keys())
        return next(iter(by_kind + fitting), forms[0])

    def _target(self) -> Shape:
        node = self.node
        while "$ref" in node:
            node = self.definitions[node["$ref"].rpartition("/")[2]]
        return Shape(node, self.definitions)

    def _child(self, part: str | int) -> Shape | None:
        node = self._target().node
        if isinstance(part, int):
            rows = node.get("prefixItems", [])
            found = rows[part] if part < len(rows) else node.get("items")
        else:
            any_name = [*node.get("patternProperties", {}).values(), node.get("additionalProperties")]
            found = node.get("properties", {}).get(part, any_name[0])
        return Shape(found, self.definitions) if isinstance(found, dict) else None


def _keys_below(shape: Shape, path: Path = (), depth: int = 4) -> Iterator[tuple[str, Path]]:
    """Yield every key below a place, with the section that it is known in."""
    for form in shape.alternatives:
        for name, child in form.keys.items():
            yield name, path
            if depth and name not in ("grid", "zip"):
                yield from _keys_below(child, (*path, name), depth - 1)
