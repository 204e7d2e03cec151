"""The rule that ended a campaign early, in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def stopping_in_words(rule: Mapping[str, Any]) -> str:
    """Return what a rule of adaptive stopping asked for and what came of it.

    Args:
        rule: `Results.stopping`, not empty.
    """
    which = f" of {rule['filter']}" if rule["filter"] else " of every filter"
    looks = ", ".join(str(n) for n in rule["at"])
    found = "not known" if rule["widest"] is None else f"{rule['widest']:.3g}"
    return (
        f"{'met' if rule['met'] else 'not met'} at {rule['reached']} runs: half width of the 95 % interval of "
        f"{rule['metric']}{which} {found}, wanted {rule['half_width']:g}; looked at {looks} runs"
    )
