"""Settings of a result's cases, as the campaign gave them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


def case_setting(results: Results, index: int, path: str, default: Any) -> Any:
    """Return a setting of a case as it was flown: as its stress has it, or varied, or else the campaign's own.

    What a stress multiplies or shifts is as without it.
    """
    keys = path.split(".")
    header = results.headers[index]
    stress = results.campaign_content.get("stress", {}).get(header.stress, {}) if header.stress else {}
    replaced = {path: value for path, value in stress.items() if not _is_relative(value)}
    varied = {**header.variables, **replaced}
    for length in range(len(keys), 0, -1):
        start = ".".join(keys[:length])
        if start in varied:
            return _inside(varied[start], keys[length:], default)
    return _inside(results.campaign_content, keys, default)


def filter_settings(results: Results, index: int, name: str) -> Mapping[str, Any]:
    """Return the settings of a filter of a case; single ones that the campaign varies are not filled in."""
    # A filter's name may hold dots, which no path can.
    entry = results.headers[index].variables.get(f"filters.{name}")
    entry = entry or case_setting(results, index, "filters", {}).get(name)
    return entry if isinstance(entry, Mapping) else {}


def _is_relative(value: Any) -> bool:
    return isinstance(value, Mapping) and set(value) == {"times"}


def _inside(value: Any, keys: list[str], default: Any) -> Any:
    for key in keys:
        if not isinstance(value, Mapping) or value.get(key) is None:
            return default
        value = value[key]
    return value
