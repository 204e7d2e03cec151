"""Text of files and exceptions before it reaches a terminal, a page or a table: nothing in it may do anything."""

from __future__ import annotations

import unicodedata

# Control characters (ESC, C1), format characters (right-to-left marks), surrogates, separators of lines and paragraphs.
_ACTING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_KEPT = "\n\t"


def visible(text: str) -> str:
    r"""Return a text with every control and format character written as Python would, ``\x1b`` say.

    Ends of lines and tabs stay. Letters of any script stay too.
    """
    return "\n".join(line if line.isprintable() else _shown_line(line) for line in text.split("\n"))


def acts(letter: str) -> bool:
    """Return whether a character is no sign but does something: moves the cursor, turns the direction of writing."""
    return letter not in _KEPT and unicodedata.category(letter) in _ACTING


def _shown_line(line: str) -> str:
    end = "\r" if line.endswith("\r") else ""
    return "".join(map(_shown, line.removesuffix("\r"))) + end


def _shown(letter: str) -> str:
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii") if acts(letter) else letter
