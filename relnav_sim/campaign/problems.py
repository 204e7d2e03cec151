"""What is wrong with a campaign file, as sentences that say where."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from relnav_sim.near_names import nearest
from relnav_sim.wording import first_of

Path = tuple[str | int, ...]
"""Where a value stands in the file: keys and list positions from the top."""

SHOWN = 100
"""Problems listed at most: nobody reads on, and a hostile file must stay cheap."""
MOST_NAMED = 24
"""Known names listed at most where none is near."""


@dataclass(frozen=True)
class Problem:
    """One thing wrong with a campaign.

    Attributes:
        path: Keys and list positions from the top of the file; empty for the file as a whole.
        sentence: What is wrong and what to do about it, without the place.
        line: Line number from 1, or None to take the line of the path.
    """

    path: Path
    sentence: str
    line: int | None = None


class CampaignError(ValueError):
    """A campaign file or an override that cannot be used.

    Attributes:
        problems: Every problem found, each as ``file:line: path: sentence``.

    Examples:
        >>> from relnav_sim import CampaignError, load_campaign
        >>> try:
        ...     load_campaign("campaigns/demo.yaml", ["runs=none"])
        ... except CampaignError as error:
        ...     print(error.problems[0])
        --set runs=none: runs: must be a whole number, not the text 'none'
    """

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__("\n".join(problems))
        self.problems = list(problems)

    def __reduce__(self) -> tuple[type[CampaignError], tuple[list[str]]]:
        """Rebuild from the problems, so that the error survives a trip between processes."""
        return type(self), (self.problems,)


def dotted(path: Path) -> str:
    """Return a path as people write it: ``sensors.radar.noise[0].kind``."""
    text = ""
    for part in path:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return ``; did you mean 'x'?`` for the nearest known word, or nothing."""
    near = nearest(word, known)
    return f"; did you mean {quoted(near)}?" if near else ""


def no_such(what: str, word: str, known: Iterable[str]) -> str:
    """Return the sentence that nothing of a kind has this name, with the nearest name or all of them."""
    known = list(known)
    hint = did_you_mean(word, known) or f"; there are {first_of(known, MOST_NAMED)}"
    return f"no {what} is named {quoted(word)}{hint}"


def quoted(word: object) -> str:
    """Return a word in quotes, shortened where it is long, safe to print."""
    text = str(word)
    text = text if len(text) <= 60 else text[:57] + "..."
    return "'" + "".join(letter if letter.isprintable() else "?" for letter in text) + "'"


def listed(words: Sequence[str], joint: str = "or") -> str:
    """Return ``a, b or c``."""
    return f" {joint} ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
