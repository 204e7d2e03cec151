"""Text of strangers - exceptions, files - made fit to be shown and stored: nothing in it may do anything."""

from __future__ import annotations

import unicodedata

LONGEST_MESSAGE = 500
"""Characters of a message that are kept."""

# Control characters (ESC, C1), format characters (right-to-left marks), surrogates, separators of lines and paragraphs.
_ACTING = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_KEPT = "\n\t"


def visible(text: str) -> str:
    r"""Return a text with every control and format character written as Python would, ``\x1b`` say.

    Ends of lines and tabs stay. Letters of any script stay too.
    """
    return "\n".join(line if line.isprintable() else _visible_line(line) for line in text.split("\n"))


def acts(letter: str) -> bool:
    """Return whether a character is no sign but does something: moves the cursor, turns the direction of writing."""
    return letter not in _KEPT and unicodedata.category(letter) in _ACTING


def printable(text: str, longest: int = LONGEST_MESSAGE) -> str:
    r"""Return a text as one line without characters that do something: control and format characters, surrogates, NUL.

    What can't be printed is written as Python would write it, ``\x1b`` say; white space of any kind becomes a space.
    A long text keeps its beginning and its end.

    Args:
        text: The text.
        longest: Most characters of the result.
    """
    if len(text) > longest:
        text = _shortened(text, longest)
    words = ("".join(letter if letter.isprintable() else _escaped(letter) for letter in word) for word in text.split())
    return _shortened(" ".join(words), longest)


def message_of(error: BaseException, longest: int = LONGEST_MESSAGE) -> str:
    """Return an exception as one printable line of bounded length: its type and what it says."""
    try:
        text = str(error)
    except Exception:  # of somebody's own exception class
        text = "(its message can't be shown)"
    return printable(f"{type(error).__name__}: {text}".rstrip(": "), longest)


def _visible_line(line: str) -> str:
    end = "\r" if line.endswith("\r") else ""
    return "".join(_escaped(letter) if acts(letter) else letter for letter in line.removesuffix("\r")) + end


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape", "surrogatepass").decode("ascii")


def _shortened(text: str, longest: int) -> str:
    gap = " [...] "
    if len(text) <= longest:
        return text
    tail = (longest - len(gap)) // 4
    return text[: longest - len(gap) - tail] + gap + text[len(text) - tail :]
