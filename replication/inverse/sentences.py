"""Sentences of a paper that only some settings agree with, or none."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array, Mask

IMPOSSIBLE = 0.01


@dataclass(frozen=True)
class Sentence:
    """A sentence that restricts the settings, and what it then implies.

    Attributes:
        text: The sentence, with the printed numbers that it has to go with.
        agrees: Which settings agree with it, from their values by name.
        size: How large the effect is in papers (n, numbers); None where the paper's own numbers contradict it.
        printed: How large it is in print.
    """

    text: str
    agrees: Callable[[Mapping[str, Array]], Mask]
    size: Callable[[Array], Array] | None
    printed: float


def tested(sentence: Sentence, setting: Mapping[str, Array], found: Array) -> dict[str, Any]:
    """Return the sentence's verdict: the share of agreeing settings in which the effect is as large as in print."""
    if sentence.size is None:
        return {"text": sentence.text, "verdict": "contradicted by the paper's own table", "p_value": 0.0}
    agreeing = sentence.agrees(setting)
    sizes = sentence.size(found[agreeing])
    p = (1 + int(np.sum(sizes >= sentence.printed))) / (1 + len(sizes))
    verdict = "no setting agrees with it" if p < IMPOSSIBLE else "settings agree with it"
    return {"text": sentence.text, "verdict": verdict, "p_value": p, "settings": len(sizes)}
