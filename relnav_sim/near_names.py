"""Which known name a mistyped one probably means."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LONGEST = 60
_FEWEST_LETTERS = 3
_CUTOFF = 0.65  # keys share their units' endings; a lower one would offer i_deg for raan_deg


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known name that is nearest to a word, or None.

    Capitals, and a hyphen or a space for an underscore, make no difference. A name that the word begins comes first.
    """
    names: dict[str, str] = {}
    for name in known:
        names.setdefault(_plain(name), name)
    plain = _plain(word[:_LONGEST])
    begun = [name for name in names if len(plain) >= _FEWEST_LETTERS and name.startswith(plain)]
    near = [plain] if plain in names else begun or difflib.get_close_matches(plain, names, n=1, cutoff=_CUTOFF)
    return names[near[0]] if near else None


def _plain(name: str) -> str:
    return name.casefold().replace("-", "_").replace(" ", "_")
