"""Settings of a campaign in a few words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any


def leaves(value: Any) -> str:
    """Return settings in a few words; what is not set, zeros, and lists of zeros are left out.

    Examples:
        >>> leaves({"kind": "outage", "windows_s": [[0.0, 20.0]], "rate_per_hour": None})
        'outage, windows_s [[0, 20]]'
    """
    if isinstance(value, Mapping):
        shown = ((key, part, leaves(part)) for key, part in value.items())
        return ", ".join(
            inner if key == "kind" else key if part is True else f"{key} {inner}" for key, part, inner in shown if inner
        )
    if isinstance(value, Sequence) and not isinstance(value, str):
        parts = [leaves(part) for part in value]
        return "[" + ", ".join(part or "0" for part in parts) + "]" if any(parts) else ""
    if value is None or value is False or value == 0:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
