"""Products of parameters of which the quick tests take a part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest


def taking_turns(first: Sequence[tuple[Any, ...]], second: Sequence[Any]) -> list[Any]:
    """Return every pair as parameters (*one, other): each `one` has a quick test, whose `other` it takes in turn.

    All others are for the long check. Each of `second` is then met by its share of `first`.
    """
    return [
        pytest.param(*one, other, marks=() if (i - j) % len(second) == 0 else pytest.mark.slow)
        for i, one in enumerate(first)
        for j, other in enumerate(second)
    ]
