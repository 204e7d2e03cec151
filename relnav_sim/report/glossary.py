"""The terms of a report, each defined once, and how a page shows the definition: on hover and on keyboard focus."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from markupsafe import Markup

TERMS: Mapping[str, str] = {
    "formal sigma": "The standard deviation that a filter states of its own error: the root of its covariance's "
    "diagonal.",
    "conservative": "Pessimistic: the formal sigma is larger than the actual error (ANEES below 1).",
    "overconfident": "Optimistic: the formal sigma is smaller than the actual error (ANEES above 1).",
    "steady state": "The time from settle_s of the campaign on; the main metrics are taken over it.",
    "no significant difference": "The runs cannot tell the two apart from filters with equal errors, at 95 % for all "
    "pairs of a case together. More runs might.",
    "no difference that matters": "The interval of the difference lies wholly inside the equivalence margin, "
    "statistics.matters_percent: it is surely too small to matter.",
    "Cramér-Rao bound": "Posterior Cramér-Rao bound (PCRB): no filter has a smaller RMS error. Of a perfect model: for "
    "the truth and the sensors as simulated; of the filter's own model: for its own dynamics and process noise.",
    "ANEES": "Average normalised estimation error squared: squared error in units of the formal covariance, per "
    "dimension; 1 for a consistent filter.",
    "NIS": "Normalised innovation squared: squared innovation in units of its formal covariance.",
    "regret": "By how much a filter's RMS exceeds the smallest of any filter under the same truth.",
    "minimax filter": "The filter with the smallest worst regret over the nominal case and all stresses.",
}

_FIND = re.compile("|".join(rf"\b{re.escape(term)}\b" for term in TERMS), re.IGNORECASE)
_BY_LOWER = {term.lower(): term for term in TERMS}


class Definitions:
    """Marks the first use of each term in a page; every later use stays plain."""

    def __init__(self) -> None:
        self._said: set[str] = set()

    def __call__(self, text: str) -> Markup:
        """Return a text as HTML, terms that are used for the first time with their definition."""
        from markupsafe import Markup, escape

        parts, done = [], 0
        for found in _FIND.finditer(text):
            term = _BY_LOWER[found.group().lower()]
            if term in self._said:
                continue
            self._said.add(term)
            parts += [
                escape(text[done : found.start()]),
                Markup('<dfn tabindex="0" title="{}">{}</dfn>').format(TERMS[term], found.group()),
            ]
            done = found.end()
        return Markup("").join([*parts, escape(text[done:])])
