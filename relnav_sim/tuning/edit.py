"""A campaign's text with some numbers changed or added, and everything else, comments included, as it was."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import takewhile
from pathlib import Path as FilePath

import yaml

from relnav_sim.campaign.load import parse_campaign
from relnav_sim.campaign.loader import load_document
from relnav_sim.campaign.paths import replaced
from relnav_sim.campaign.problems import Path


def edited(text: str, changes: Mapping[Path, float], file: FilePath | None = None) -> str:
    """Return the text with the numbers in place.

    Args:
        text: A valid campaign file.
        changes: Numbers by their paths; keys and sections that are missing on the way are added.
        file: Where the text is from; files that it names are looked for from there.

    Raises:
        ValueError: The text cannot be edited so that these values differ and nothing else; a bug.
    """
    before = wanted = load_document(text).data
    for path, value in changes.items():
        text = _with_number(text, path, number_text(value))
        wanted = replaced(wanted, path, value)
    if load_document(text).data != wanted or before is None:
        raise ValueError("the edited campaign does not say what it should")
    parse_campaign(text, path=file)
    return text


def with_header(text: str, lines: list[str]) -> str:
    """Return the text with a comment behind the comment lines that it begins with."""
    newline = "\r\n" if "\r\n" in text else "\n"
    rows = text.splitlines(keepends=True)
    first = len(list(takewhile(lambda row: row.startswith("#"), rows)))
    comment = [f"# {line}".rstrip() + newline for line in lines]
    return "".join([*rows[:first], *(["#" + newline] if first else []), *comment, *rows[first:]])


def number_text(value: float) -> str:
    """Return a number that YAML 1.1 and 1.2 both read as a number: with a point, and a sign in the exponent."""
    mantissa, e, exponent = f"{value:.12g}".partition("e")
    if not e:
        return mantissa
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}e{exponent[0]}{int(exponent[1:])}"


def _with_number(text: str, path: Path, number: str) -> str:
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    assert node is not None  # the text is a valid campaign
    for depth, part in enumerate(path):
        inner = _child(node, part)
        if inner is None:
            return _with_key(text, node, path[depth:], number)
        node = inner
    return text[: node.start_mark.index] + number + text[node.end_mark.index :]


def _child(node: yaml.Node, part: str | int) -> yaml.Node | None:
    if isinstance(part, int):
        return node.value[part] if isinstance(node, yaml.SequenceNode) else None
    return next((value for key, value in _pairs(node) if key.value == part), None)


def _pairs(node: yaml.Node) -> list[tuple[yaml.ScalarNode, yaml.Node]]:
    if not isinstance(node, yaml.MappingNode):
        raise ValueError("a number can only be added to a section")
    return node.value


def _with_key(text: str, section: yaml.Node, path: Path, number: str) -> str:
    """Return the text with a key, and sections inside it, added to a section."""
    added = number
    for part in reversed(path[1:]):
        added = f"{{{part}: {added}}}"
    added = f"{path[0]}: {added}"
    pairs = _pairs(section)
    if _is_flow(section):
        end = pairs[-1][1].end_mark.index if pairs else section.end_mark.index - 1
        return f"{text[:end]}{', ' if pairs else ''}{added}{text[end:]}"
    newline = "\r\n" if "\r\n" in text else "\n"
    indent = " " * pairs[0][0].start_mark.column
    # Behind a value on one line nothing follows but a comment; a section in block style ends who knows where.
    flat = [value for _, value in pairs if _on_one_line(value)]
    if not flat:
        start = pairs[0][0].start_mark.index
        return f"{text[:start]}{added}{newline}{indent}{text[start:]}"
    end_of_line = re.compile(r"\r?\n|\Z").search(text, flat[-1].end_mark.index)
    end = end_of_line.start() if end_of_line else len(text)
    return f"{text[:end]}{newline}{indent}{added}{text[end:]}"


def _on_one_line(node: yaml.Node) -> bool:
    if isinstance(node, yaml.ScalarNode):
        return node.style not in ("|", ">")
    return _is_flow(node)


def _is_flow(node: yaml.Node) -> bool:
    return isinstance(node, yaml.CollectionNode) and bool(node.flow_style)
