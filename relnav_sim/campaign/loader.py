"""Strict YAML: text to plain data, with the line of every value and every problem at once.

Built on PyYAML's events rather than its constructor, which would read YAML 1.1 numbers, keep the last of
two equal keys, follow aliases and recurse without bound.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import yaml
from yaml import events

from relnav_sim.campaign.problems import Path, Problem, quoted
from relnav_sim.campaign.scalars import RefusedScalarError, resolve
from relnav_sim.printable import acts

MOST_BYTES = 250_000
MOST_VALUES = 10_000
DEEPEST = 24
"""A campaign written by hand stays far below these; together they answer any input in about a second."""


@dataclass(frozen=True)
class Document:
    """A file's data and where it stands.

    Attributes:
        data: Mappings, lists, text, numbers, booleans and None; None where the text is no YAML at all.
        lines: The line, from 1, of each value's key or list position, by path.
        problems: What the strict rules refuse; the data then holds None in the refused places.
    """

    data: Any
    lines: dict[Path, int] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()

    def line(self, path: Path) -> int:
        """Return the line of the longest known beginning of a path."""
        for end in range(len(path), -1, -1):
            if path[:end] in self.lines:
                return self.lines[path[:end]]
        return 1


class _UnreadableError(Exception):
    """Nothing after this place can be read."""

    def __init__(self, sentence: str, line: int) -> None:
        super().__init__(sentence)
        self.problem = Problem((), sentence, line)


def read_text(content: bytes) -> str:
    """Return a file's text.

    Args:
        content: The file's bytes: UTF-8, with or without a byte-order mark, any line ends.

    Raises:
        ValueError: Too large, another encoding or no text at all; the message is a sentence.
    """
    if content.startswith(b"\x89HDF\r\n"):
        raise ValueError("this is a results file, no campaign; `relnav inspect FILE --campaign` prints the one in it")
    if len(content) > MOST_BYTES:
        raise ValueError(f"the file is larger than the {MOST_BYTES // 1000} kB that a campaign file may have")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")) or (b"\0" in content[:4] and content[:4].count(0) in (2, 3)):
        raise ValueError("the file is in UTF-16 or UTF-32; save it as UTF-8")
    if b"\0" in content:
        raise ValueError("the file is binary, not text")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"byte 0x{content[error.start]:02x} in line {line} is not UTF-8; save the file as UTF-8"
        ) from None


def load_document(text: str) -> Document:
    """Return the data of a YAML text read strictly.

    Args:
        text: One YAML document. Never raises for what stands in it: problems are in the result.
    """
    if _FAST is not None and not any(letter in text for letter in "\t\ufeff"):  # which libyaml takes for space
        document = _document(_undoubted(_events(text, _FAST)))
        if not document.problems:
            return document
    return _document(_events(text, yaml.SafeLoader))


_FAST: Any = getattr(yaml, "CSafeLoader", None)
"""libyaml's parser, many times as fast, where PyYAML was built with it. A text that it finds fault with is read again
by Python's, of whose words the sentences are made: the same texts are refused in the same words, with and without."""


def _undoubted(stream: Iterator[events.Event]) -> Iterator[events.Event]:
    """Yield libyaml's events as far as Python's parser would surely give the same."""
    for event in stream:
        match event:
            case events.DocumentStartEvent(explicit=True):  # an empty document is on another line
                raise _UnreadableError("a document starts with '---'", _line(event))
            case events.ScalarEvent(style="|" | ">"):  # libyaml takes '|#' for '| #'
                raise _UnreadableError("a block of text", _line(event))
            case events.ScalarEvent(value=text, style=style) if not style and "?" in text:  # libyaml reads '[a?]'
                raise _UnreadableError("a '?' in plain text", _line(event))
        yield event


def _document(stream: Iterator[events.Event]) -> Document:
    builder = _Builder()
    try:
        data = builder.document(stream)
    except _UnreadableError as stop:
        return Document(None, builder.lines, (*builder.problems, stop.problem))
    return Document(data, builder.lines, tuple(builder.problems))


def _events(text: str, loader: Any) -> Iterator[events.Event]:
    """Yield PyYAML's events; every way in which its parser fails becomes one sentence."""
    parsed = yaml.parse(text, Loader=loader)
    line = 1
    for _ in range(2 * MOST_VALUES):
        try:
            event = next(parsed, None)
        except yaml.reader.ReaderError as error:
            before = text[: error.position] if isinstance(error.position, int) else ""
            raise _UnreadableError(
                f"the character {_code_point(error.character)} is not allowed in a YAML file", before.count("\n") + 1
            ) from None
        except yaml.MarkedYAMLError as error:
            raise _UnreadableError(*_syntax_problem(error)) from None
        except (yaml.YAMLError, ValueError, OverflowError) as error:
            # PyYAML lets chr() and int() fail on escapes and directives such as "\UFFFFFFFF".
            raise _UnreadableError(f"this is not valid YAML: {error}", line) from None
        if event is None:
            return
        line = _line(event)
        yield event
    raise _UnreadableError(f"the file has more than {MOST_VALUES} values; a campaign file has far fewer", line)


def _line(event: events.Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 1


# PyYAML's words -> a sentence for people, and whether to point at where the construct began.
_SYNTAX = {
    "mapping values are not allowed here": (
        "a ':' stands where no key can be; check the indentation, or put the text in quotes",
        False,
    ),
    "could not find expected ':'": ("this is no 'key: value'; a ':' is missing, or the space after it", True),
    "found character '\\t' that cannot start any token": ("a tab is used for indentation; use spaces", False),
    "found character '@' that cannot start any token": ("text that starts with '@' needs quotes", False),
    "found character '`' that cannot start any token": ("text that starts with '`' needs quotes", False),
    "found character '%' that cannot start any token": ("text that starts with '%' needs quotes", False),
    "found unexpected end of stream": ("the quote that opens here is never closed", True),
    "expected <block end>, but found '<block mapping start>'": (
        "this key is indented differently from the keys beside it",
        False,
    ),
    "expected <block end>, but found '-'": ("a list position stands where a key is expected", False),
    "sequence entries are not allowed here": (
        "a list position ('- ') cannot start here; put the list on the next line",
        False,
    ),
}


def _syntax_problem(error: yaml.MarkedYAMLError) -> tuple[str, int]:
    """Return a parser error as a sentence and the line where a person would look."""
    problem = str(error.problem)
    noticed = error.problem_mark or error.context_mark
    began = error.context_mark or error.problem_mark
    noticed_line, began_line = (noticed.line + 1, began.line + 1) if noticed and began else (1, 1)
    if problem in _SYNTAX:
        sentence, from_beginning = _SYNTAX[problem]
        return sentence, began_line if from_beginning else noticed_line
    if "expected ',' or" in problem or "the node content, but found '<stream end>'" in problem:
        return f"the bracket opened in line {began_line} is not closed, or a comma is missing", noticed_line
    return f"this is not valid YAML: {problem}", noticed_line


def _code_point(character: object) -> str:
    return f"U+{ord(character) if isinstance(character, str) else character:04X}"


@dataclass
class _Level:
    """An open mapping or list."""

    path: Path
    value: dict[str, Any] | list[Any]
    key: str | None = None
    """The key whose value comes next; None where a key is expected."""
    skipped: bool = False
    """The next value belongs to a refused key and is dropped."""


class _Builder:
    """Puts events together with an explicit stack, so that depth costs no recursion."""

    def __init__(self) -> None:
        self.lines: dict[Path, int] = {}
        self.problems: list[Problem] = []
        self.levels: list[_Level] = []
        self.root: Any = None

    def document(self, stream: Iterator[events.Event]) -> Any:
        documents = 0
        for event in stream:
            line = _line(event)
            match event:
                case events.DocumentStartEvent():
                    documents += 1
                    self.directives(event, line)
                    if documents > 1:
                        raise _UnreadableError("a second document starts here ('---'); a campaign file holds one", line)
                case events.AliasEvent():
                    self.refuse(f"aliases (*{event.anchor}) are not used in campaign files; write the value out", line)
                    self.place(None, line)
                case events.ScalarEvent():
                    self.check_node(event, line)
                    self.scalar(event, line)
                case events.MappingStartEvent() | events.SequenceStartEvent():
                    self.check_node(event, line)
                    self.open({} if isinstance(event, events.MappingStartEvent) else [], line)
                case events.MappingEndEvent() | events.SequenceEndEvent():
                    self.levels.pop()
        return self.root

    def directives(self, event: events.DocumentStartEvent, line: int) -> None:
        if event.tags:
            self.problems.append(Problem((), "%TAG lines are not used in campaign files", line))
        if event.version not in (None, (1, 2)):
            self.problems.append(Problem((), "campaign files follow YAML 1.2; remove the %YAML line", line))

    def check_node(self, event: events.NodeEvent, line: int) -> None:
        if event.anchor:
            self.refuse(f"anchors (&{event.anchor}) are not used in campaign files; write the value out", line)
        tag = getattr(event, "tag", None)
        if tag:
            self.refuse(f"tags ({quoted(tag)[1:-1]}) are not used in campaign files; remove it", line)

    def refuse(self, sentence: str, line: int) -> None:
        self.problems.append(Problem(self.next_path(), sentence, line))

    def next_path(self) -> Path:
        """Return the path of the value that comes next (of its mapping, where a key comes next)."""
        if not self.levels:
            return ()
        level = self.levels[-1]
        if isinstance(level.value, list):
            return (*level.path, len(level.value))
        return level.path if level.key is None else (*level.path, level.key)

    def scalar(self, event: events.ScalarEvent, line: int) -> None:
        text = event.value
        if not text.isprintable() and any(map(acts, text)):
            self.refuse("the text holds control characters, marks of direction or half a surrogate pair", line)
            text = ""
        plain = not event.style
        if self.expects_key():
            self.key(text, plain, line)
            return
        value: Any = text
        if plain:
            try:
                value = resolve(text)
            except RefusedScalarError as refusal:
                self.refuse(str(refusal), line)
                value = None
        self.place(value, line)

    def expects_key(self) -> bool:
        return bool(self.levels) and isinstance(self.levels[-1].value, dict) and self.levels[-1].key is None

    def key(self, text: str, plain: bool, line: int) -> None:
        level = self.levels[-1]
        assert isinstance(level.value, dict)
        level.key, level.skipped = text, False
        if plain:
            try:
                is_text = isinstance(resolve(text), str)
            except RefusedScalarError:
                is_text = False
            if not is_text:
                level.skipped = True
                what = f"the key {text} is not text; put it in quotes" if text else "a key is missing before ':'"
                self.problems.append(Problem((*level.path, text) if text else level.path, what, line))
                return
        if text in level.value:
            level.skipped = True
            first = self.lines[(*level.path, text)]
            self.refuse(f"this key is given twice, first in line {first}; keep one", line)
        else:
            self.lines.setdefault((*level.path, text), line)

    def place(self, value: Any, line: int) -> None:
        """Put a value where the open mapping or list expects one."""
        if not self.levels:
            self.root = value
            self.lines[()] = line
            return
        level = self.levels[-1]
        if isinstance(level.value, list):
            self.lines.setdefault((*level.path, len(level.value)), line)
            level.value.append(value)
        elif level.key is None:
            self.problems.append(
                Problem(level.path, "a key must be plain text, not a list, a mapping or an alias", line)
            )
            level.key, level.skipped = "", True
        else:
            if not level.skipped:
                level.value[level.key] = value
            level.key = None

    def open(self, value: dict[str, Any] | list[Any], line: int) -> None:
        if len(self.levels) >= DEEPEST:
            raise _UnreadableError(f"brackets or indentation nest more than {DEEPEST} levels deep", line)
        path = self.next_path()
        self.place(value, line)
        self.levels.append(_Level(path, value))
