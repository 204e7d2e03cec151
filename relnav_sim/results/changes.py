"""What differs between two versions of a campaign that would change numbers which are already computed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from relnav_sim.campaign.identity import in_first_spelling

EXTENSIONS = ("runs", "block_runs", "stop", "bound", "tune", "requirements", "grid", "zip", "stress")
"""Top-level keys that add to a result, runs or cases, or change none. A case is known by its own id, so the grid may
grow."""


def changed_keys(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """Return the dotted paths whose values differ, in order.

    Left out is what may change: the number of runs, filters that are added or removed, the values of the grid, and
    former spellings of the same.

    Args:
        old: Content of the campaign that the results were computed from.
        new: Content of the campaign now.
    """
    old, new = in_first_spelling(old), in_first_spelling(new)
    varied = tuple(path for content in (old, new) for section in ("grid", "zip") for path in content.get(section, ()))
    before, after = dict(_leaves(old)), dict(_leaves(new))
    only_in_one = set(old.get("filters", {})) ^ set(new.get("filters", {}))

    def matters(path: str) -> bool:
        if path.split(".")[0] in EXTENSIONS or any(path == v or path.startswith(f"{v}.") for v in varied):
            return False
        return not any(path == f"filters.{name}" or path.startswith(f"filters.{name}.") for name in only_in_one)

    paths = [*before, *(path for path in after if path not in before)]
    absent = object()
    return [p for p in paths if matters(p) and before.get(p, absent) != after.get(p, absent)]


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and value:
        for key, inner in value.items():
            yield from _leaves(inner, f"{path}.{key}" if path else str(key))
    else:
        yield path, value
