"""The library of campaigns that come with relnav, and the campaigns of a folder.

Read as text: to load the models of a campaign takes seconds, and help and lists come at once.
"""

from __future__ import annotations

import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

FIRST = "demo"
"""Where a reader starts: first in lists, and what `relnav new` writes unless told."""

_PLACEHOLDER = "name: my_campaign"
_MOST_BYTES = 250_000  # the loader takes no larger file
_SECTIONS = ("clock", "truth", "sensors", "filters")


def library_names() -> tuple[str, ...]:
    """Return the names of the library's campaigns, `FIRST` first."""
    names = {each.name.removesuffix(".yaml") for each in _folder().iterdir() if each.name.endswith(".yaml")}
    return tuple(sorted(names, key=lambda name: (name != FIRST, name)))


def library_text(name: str, campaign: str | None = None) -> str:
    """Return a campaign of the library.

    Args:
        name: Which one.
        campaign: The name that it gives itself; default: as it is in the library.
    """
    text = _folder().joinpath(f"{name}.yaml").read_text(encoding="utf-8")
    return text if campaign is None else text.replace(_PLACEHOLDER, f"name: {campaign}", 1)


def library_summaries() -> tuple[tuple[str, str], ...]:
    """Return each campaign of the library with the question that it asks."""
    return tuple((name, first_words(library_text(name))) for name in library_names())


def first_words(text: str) -> str:
    """Return the first comment of a campaign, which says what it is for; "" without one."""
    for line in text.splitlines()[:20]:
        words = line.removeprefix("#").strip()
        if line.startswith("#") and words and not words.startswith("yaml-language-server"):
            return words
    return ""


def campaigns_of(folder: Path) -> tuple[tuple[Path, str], ...]:
    """Return the campaigns in a folder and in its `campaigns/`, each with its first comment.

    What looks like one: a YAML file, not hidden, that has the sections of a campaign, right or wrong.
    """
    found = sorted(
        path
        for pattern in ("*.yaml", "*.yml")
        for path in (*folder.glob(pattern), *folder.glob(f"campaigns/{pattern}"))
    )
    texts = ((path, _text(path)) for path in found if not path.name.startswith("."))
    return tuple((path, first_words(text)) for path, text in texts if _looks_like_a_campaign(text))


def _looks_like_a_campaign(text: str) -> bool:
    """Return whether most of the sections stand there as top-level keys; a mistake may have cost one of them."""
    keys = set(re.findall(r"""^["']?(\w+)["']?\s*:""", text, flags=re.MULTILINE))
    return len(keys.intersection(_SECTIONS)) >= len(_SECTIONS) - 1


def _text(path: Path) -> str:
    """Return what a file says; "" of what is no file, too large for a campaign, or not readable."""
    try:
        if path.is_file() and path.stat().st_size <= _MOST_BYTES:
            return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        pass
    return ""


def _folder() -> Traversable:
    return files("relnav_sim").joinpath("campaign", "templates")
