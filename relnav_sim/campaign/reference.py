"""Tables of keys, made from the models: for `relnav show` and docs/campaign-file.md.

``python -m relnav_sim.campaign.reference docs/campaign-file.md`` renews the tables of the document.
"""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from relnav_sim.campaign.file_model import file_shape
from relnav_sim.campaign.problems import listed
from relnav_sim.campaign.shape import Shape

_MARKED = re.compile(r"<!-- (?P<what>keys|kinds|sections|names): (?P<place>[^ ]+) -->\n.*?<!-- end -->", re.DOTALL)
LONGEST_DEFAULT = 60


@dataclass(frozen=True)
class Key:
    """One key of a section.

    Attributes:
        name: The key.
        takes: What it takes, in words.
        default: Its default as it would be written; ``required``; or ``optional`` where there is no such value.
        meaning: The model's description.
    """

    name: str
    takes: str
    default: str
    meaning: str


def keys_of(shape: Shape) -> tuple[Key, ...]:
    """Return the keys of a section, `kind` first."""
    rows = [
        Key(name, _takes(key), _default(name, key, name in shape.required), key.description)
        for name, key in shape.keys.items()
    ]
    return tuple(sorted(rows, key=lambda key: key.name != "kind"))


def shape_at(place: str, whole: Shape | None = None) -> Shape:
    """Return the shape of a place of the file.

    Args:
        place: Keys from the top joined by points; ``kind=word`` picks a form, ``with=key`` the form in which a key must
            stand where there are no kinds, ``*`` any name and ``0`` an entry of a list, for example
            ``filters.*.kind=ekf.augment.0``, ``sensors.radar.noise.kind=mixture`` or ``truth.with=ephemeris``.
        whole: The whole file's shape, where it is at hand.

    Raises:
        KeyError: There is no such place.
    """
    shape = whole or file_shape()
    for word in place.split(".") if place != "top" else []:
        if word.startswith("kind="):
            forms = {form.kind: form for form in shape.alternatives}
            shape = forms[word.removeprefix("kind=")]
        elif word.startswith("with="):
            shape = shape.chosen({word.removeprefix("with="): None})
        else:
            found = shape.chosen([] if word == "0" else {}).at((_part(word),), {})
            if found is None:
                raise KeyError(place)
            shape = found
    return shape if place == "top" or shape.kind else shape.chosen({})


def kinds_at(place: str, whole: Shape | None = None) -> dict[str, Shape]:
    """Return the forms that a place can take, by their kind."""
    return {form.kind: form for form in shape_at_any(place, whole).alternatives if form.kind}


def shape_at_any(place: str, whole: Shape | None = None) -> Shape:
    """Return the shape of a place with all its forms."""
    *parents, last = place.split(".")
    shape = shape_at(".".join(parents) or "top", whole)
    found = shape.at((_part(last),), {})
    if found is None:
        raise KeyError(place)
    return found


def _part(word: str) -> str | int:
    return 0 if word == "0" else word


def markdown_table(keys: tuple[Key, ...]) -> str:
    """Return keys as a Markdown table."""
    lines = ["| key | takes | default | meaning |", "|---|---|---|---|"]
    for key in keys:
        default = key.default if key.default in ("required", "optional") else f"`{key.default}`"
        meaning = key.meaning.replace("|", "\\|")
        lines.append(f"| `{key.name}` | {key.takes} | {default} | {meaning} |")
    return "\n".join(lines)


def renewed(text: str) -> str:
    """Return a Markdown document with everything between ``<!-- WHAT: PLACE -->`` and ``<!-- end -->`` made anew.

    WHAT is ``keys`` (the table of one section), ``kinds`` (a table for each kind that a place can take), ``sections``
    (a table for each section below a place) or ``names`` (the kinds with a line each).
    """
    whole = file_shape()

    def made(match: re.Match[str]) -> str:
        what, place = match["what"], match["place"]
        match what:
            case "keys":
                body = markdown_table(keys_of(shape_at(place, whole)))
            case "kinds":
                found = (f"{place}.kind={kind}" for kind in kinds_at(place, whole))
                body = "\n\n".join(_headed(part, whole) for part in found)
            case "sections":
                body = "\n\n".join(_headed(part, whole) for part in places(whole, place))
            case _:
                kinds = kinds_at(place, whole)
                rows = [f"| `{kind}` | {_one_line(form.model_description)} |" for kind, form in kinds.items()]
                body = "\n".join(["| kind | what it is |", "|---|---|", *rows])
        return f"<!-- {what}: {place} -->\n\n{body}\n\n<!-- end -->"

    return _MARKED.sub(made, text)


def _headed(place: str, whole: Shape) -> str:
    """Return a section's heading, what it is, and its table."""
    shape = shape_at(place, whole)
    section = re.sub(r"\.(kind|with)=[^.]+", "", place).replace(".0", "[]")
    heading = f"`{section}`" + (f" of `kind: {shape.kind}`" if shape.kind else "")
    if picked := re.search(r"\.with=([^.]+)$", place):
        heading += f" with `{picked[1]}`"
    return f"### {heading}\n\n{shape.model_description}\n\n{markdown_table(keys_of(shape))}"


def _one_line(text: str) -> str:
    return " ".join(text.partition("\n\n")[0].split()).replace("|", "\\|")


def _takes(shape: Shape) -> str:
    forms = [form for form in shape.alternatives if form.node.get("type") != "null"]
    return listed(list(dict.fromkeys(word for form in forms for word in _form(form))))


def _form(shape: Shape) -> list[str]:
    """Return what one form of a value is, in words; several where it is one of several words."""
    node = shape.node
    if shape.kind:
        return ["section with a `kind`"]
    if "const" in node or "enum" in node:
        return [f"`{_flow(word)}`" for word in node.get("enum", [node.get("const")])]
    match node.get("type"):
        case "number" | "integer" as kind:
            return [("whole number" if kind == "integer" else "number") + _bounds(node)]
        case "string":
            return ["text"]
        case "boolean":
            return ["`true`", "`false`"]
        case "array":
            return [_list_words(shape)]
        case _:
            return ["section"]


def _list_words(shape: Shape) -> str:
    rows = shape.node.get("prefixItems")
    if rows:
        return f"{len(rows)} {_plural(_takes(Shape(rows[0], shape.definitions)))}"
    items = shape.node.get("items")
    return f"list of {_plural(_takes(Shape(items, shape.definitions)))}" if items else "list"


def _plural(words: str) -> str:
    return (
        f"lists of {words}" if words[0].isdigit() else re.sub(r"^(section|number|whole number|list)\b", r"\1s", words)
    )


def _bounds(node: dict[str, Any]) -> str:
    signs = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
    found = [f"{sign} {_flow(node[key])}" for key, sign in signs.items() if key in node and abs(node[key]) < 1e15]
    return f" {', '.join(found)}" if found else ""


def _default(name: str, shape: Shape, required: bool) -> str:
    # A kind tells the forms of a section apart, so it must stand there whatever its model's default.
    if required or ("const" in shape.node and name == "kind"):
        return "required"
    value = shape.node.get("default")
    if value is None:
        return "optional"
    text = _flow(value)
    return text if len(text) <= LONGEST_DEFAULT else "{...}"


def _flow(value: Any) -> str:
    """Return a value as it would stand in a campaign file."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_flow(inner)}" for key, inner in value.items() if inner is not None) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_flow(inner) for inner in value) + "]"
    if isinstance(value, float):
        return f"{value:g}" if float(f"{value:g}") == value else repr(value)
    return value if isinstance(value, str) else json.dumps(value)


def places(whole: Shape, path: str = "top") -> Iterator[str]:
    """Yield every section that has keys of its own, for the test that the document leaves none out."""
    shape = shape_at(path, whole)
    names = list(shape.keys) or (["*"] if shape.at(("*",), {}) else [])
    for name in names:
        place = name if path == "top" else f"{path}.{name}"
        seen = False  # another form without a kind
        for form in shape_at_any(place, whole).alternatives:
            if form.kind:
                yield f"{place}.kind={form.kind}"
                yield from places(whole, f"{place}.kind={form.kind}")
            elif form.keys or form.at(("*",), {}):
                own = f"{place}.with={min(form.required)}" if seen else place
                seen = True
                if form.keys:
                    yield own
                yield from places(whole, own)


if __name__ == "__main__":
    parser = argparse.ArgumentParser("python -m relnav_sim.campaign.reference", description="Renew tables of options.")
    parser.add_argument("document", nargs="+", type=Path, help="a page with places for such tables")
    for document in parser.parse_args().document:
        document.write_text(renewed(document.read_text(encoding="utf-8")), encoding="utf-8")
