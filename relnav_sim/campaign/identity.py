"""What makes a campaign and a case the same: hashes of their validated content, not of their text."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.former import former_content, former_filter, former_variables
from relnav_sim.campaign.models import Clock, StatisticsOptions
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.options import Options
from relnav_sim.same_object import remembered
from relnav_sim.sensors.registry import sensor_kinds
from relnav_sim.truth import EphemerisTruthOptions, TruthOptions

OUTSIDE_HASH = frozenset(
    {"runs", "block_runs", "stop", "bound", "tune", "requirements", "stress", "title", "author", "revision", "date"}
)
"""Keys that change how much is computed and in which pieces, or what a report says, but no number that is."""


def in_first_spelling(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return a campaign's content as it would have been spelt at first, so that no rename tells two campaigns apart."""
    truth = EphemerisTruthOptions if "ephemeris" in content.get("truth", {}) else TruthOptions
    sections = {"truth": truth, "clock": Clock, "statistics": StatisticsOptions}
    return former_content(content, sections, sensor_kinds(), FilterEntry, _options(), dynamics_kinds())


def campaign_hash(content: Mapping[str, Any]) -> str:
    """Return the hash of a campaign's content, 64 hexadecimal digits."""
    first = in_first_spelling(content)
    return _digest({key: value for key, value in first.items() if key not in OUTSIDE_HASH})


def case_id(content: Mapping[str, Any], variables: Mapping[str, Any]) -> str:
    """Return the id of a case, 12 hexadecimal digits.

    A case is what is simulated and scored; a filter belongs to it only by the values that the grid gives it, single
    ones or all filters at once, so filters can be added to a result.

    Args:
        content: The case's sections as plain data.
        variables: The values of the varied paths.
    """
    varied = {path: [value] for path, value in variables.items() if path.split(".")[0] == "filters"}
    first = former_variables(varied, content, {}, sensor_kinds(), FilterEntry)
    texts = {key: _section_text(value, key) for key, value in content.items() if key not in ("filters", "sensors")}
    texts["filters"] = _text({path: values[0] for path, values in first.items()})
    if "sensors" in content:
        own = {name: _sensor_text(entry, name) for name, entry in content["sensors"].items()}
        absent = dict.fromkeys(in_first_spelling({"sensors": {}})["sensors"], _text(None))
        texts["sensors"] = _joined(absent | own)
    return hashlib.sha256(_joined(texts).encode()).hexdigest()[:12]


@remembered
def _section_text(section: Any, key: str) -> str:
    return _text(in_first_spelling({key: section})[key])


@remembered
def _sensor_text(entry: Any, name: str) -> str:
    return _text(in_first_spelling({"sensors": {name: entry}})["sensors"][name])


def _joined(texts: Mapping[str, str]) -> str:
    """Return the text of a section from those of its parts, the same that `_text` makes of the whole."""
    return "{" + ",".join(f"{json.dumps(key)}:{texts[key]}" for key in sorted(texts)) + "}"


def stressed_id(nominal: str, flown: Mapping[str, Any]) -> str:
    """Return the id of a case under a stress, from the id of the case and what happens there, as plain data."""
    return _digest({"case": nominal, "flown": in_first_spelling(flown)})[:12]


@remembered
def filter_id(entry: FilterEntry) -> str:
    """Return the id of a filter's settings, 12 hexadecimal digits."""
    return _digest(former_filter(FilterEntry, _options(), dynamics_kinds(), entry.model_dump(mode="json")))[:12]


def _options() -> dict[str, type[Options]]:
    return {name: kind.options_model for name, kind in filter_kinds().items()}


def _digest(content: Any) -> str:
    return hashlib.sha256(_text(content).encode()).hexdigest()


def _text(content: Any) -> str:
    return json.dumps(_plain(content), sort_keys=True, separators=(",", ":"), allow_nan=False)


def _plain(value: Any) -> Any:
    """Return the value with numbers that compare equal (2 and 2.0, 0.0 and -0.0) made the same."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    if isinstance(value, int | float) and not isinstance(value, bool) and float(value) == value:
        return float(value) + 0.0
    return value
