"""What the numbers and settings of a file must be, whoever wrote it: else a figure would come out that is none.

Each function returns what is wrong in words, empty where nothing is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from relnav_sim.conventions import RESERVED_NAMES
from relnav_sim.results.block import AnyArray
from relnav_sim.results.campaign_header import CaseHeader, ResultHeader
from relnav_sim.results.layout import Dataset, Dimension

MOST_RUNS = 1_000_000
MOST_CASES = 10_000
"""What a campaign may ask for at most."""
MOST_FILTERS = 1000
DEEPEST = 32
"""Most settings inside each other."""

_SECTIONS = ("clock", "filters", "grid", "zip", "requirements", "stress", "truth", "sensors", "start", "statistics")
_NUMBERS = (
    *(f"clock.{name}" for name in ("duration_s", "step_s", "store_every_s")),
    *(f"statistics.{name}" for name in ("settle_s", "convergence_m", "convergence_hold_s")),
)
_LEAST = {"failed": 0, "failed_epoch": -1, "epochs": 0, "updates": 0, "epoch": -1, "run": 0} | dict.fromkeys(
    ("sensor_dof_sum", "sensor_updates", "sensor_dof", "sensor_readings"), 0
)


def odd_coordinate(spec: Dimension, values: AnyArray) -> str:
    """Return what is wrong with the entries of a dimension."""
    if spec.values is not None:
        return "" if list(values) == list(spec.values) else f"is not {', '.join(map(str, spec.values))}"
    if spec.dtype == "str":
        return "" if len(set(values)) == len(values) else "names something twice"
    if spec.name == "trajectory" and values.tolist() == [-1]:
        return ""
    if not np.isfinite(values).all():
        return "is not finite"
    if (values < 0).any():
        return "has negative entries"
    return "" if (np.diff(values) > 0).all() else "does not ascend"


def odd_values(spec: Dataset, values: AnyArray) -> str:
    """Return what is wrong with counts and flags; other figures may be anything."""
    least = _LEAST.get(spec.name)
    if least is not None and (values < least).any():
        return f"has entries below {least}"
    return "has entries other than 0 and 1" if spec.name == "failed" and (values > 1).any() else ""


def odd_header(header: ResultHeader) -> str:
    """Return what is wrong with what a file says of its campaign."""
    if not _is_whole(header.seed) or not _is_whole(header.runs) or not 1 <= header.runs <= MOST_RUNS:
        return f"its number of runs is {header.runs!r}; it must be from 1 to {MOST_RUNS}"
    if header.only is not None and (not _is_whole(header.only) or not 0 <= header.only < header.runs):
        return f"its only run is {header.only!r}, of {header.runs}"
    if header.replay is not None and header.replay.runs[-1] >= header.runs:
        return f"its last recorded run is {header.replay.runs[-1]}, of {header.runs}"
    if not _are_texts(header.campaign_name, header.text, header.hash):
        return "its name, text or hash is no text"
    if odd := odd_content(header.content):
        return odd
    if not 1 <= len(header.cases) <= MOST_CASES:
        return f"it has {len(header.cases)} cases; there must be from 1 to {MOST_CASES}"
    for case in header.cases:
        if odd := _odd_case(case):
            return f"its case {case.label!r:.80} {odd}"
    if len({case.id for case in header.cases}) < len(header.cases):
        return "two of its cases have the same id"
    nominal = {case.id for case in header.cases if not case.stress}
    if header.only is None and any(case.nominal not in nominal for case in header.cases if case.stress):
        return "one of its stressed cases is of no case in it"
    if not all(isinstance(value, str | int | float) for value in header.constants.values()):
        return "its constants are damaged"
    return "its stopping rule is damaged" if header.stopping and not _is_stopping(header.stopping) else ""


def odd_content(content: Mapping[str, Any]) -> str:
    """Return what is wrong with a campaign's content, as far as figures are made with it."""
    if too_deep(content):
        return "its campaign_content is nested too deeply"
    if odd := [key for key in _SECTIONS if not isinstance(content.get(key, {}), dict)]:
        return f"{odd[0]!r} of its campaign_content is damaged"
    if odd := [name for name, entry in content.get("filters", {}).items() if not isinstance(entry, dict)]:
        return f"the filter {odd[0]!r:.80} of its campaign_content is damaged"
    odd = [path for path in _NUMBERS if not _is_number(content.get(path.split(".")[0], {}).get(path.split(".")[1]))]
    return f"{odd[0]!r} of its campaign_content is no number" if odd else ""


def too_deep(value: Any) -> bool:
    """Return whether plain data has more inside each other than any campaign."""
    level = [value]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inside(outer)]
        if not level:
            return False
    return True


def _inside(value: Any) -> Iterator[Any]:
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    return (one for one in inner if isinstance(one, Mapping | list))


def _odd_case(case: CaseHeader) -> str:
    if not _are_texts(
        case.id, case.label, case.stress, case.nominal, *case.filters, *case.filter_ids, *case.filter_ids.values()
    ):
        return "has an id, a label or filters that are no text"
    if not 1 <= len(case.filters) <= MOST_FILTERS or set(case.filters) - set(case.filter_ids):
        return f"has {len(case.filters)} filters"
    if bad := [name for name in case.filters if name in RESERVED_NAMES or "/" in name or name in (".", "")]:
        return f"has a filter named {bad[0]!r:.80}"
    if not isinstance(case.variables, dict) or too_deep(case.variables):
        return "has damaged variables"
    varied = {path: value for path, value in case.variables.items() if path in _NUMBERS}
    for section in ("clock", "statistics"):
        if isinstance(whole := case.variables.get(section, {}), dict):
            varied |= {f"{section}.{key}": value for key, value in whole.items() if f"{section}.{key}" in _NUMBERS}
    odd = [path for path, value in varied.items() if not _is_number(value)]
    return f"has {odd[0]!r} that is no number" if odd else ""


def _is_stopping(rule: Mapping[str, Any]) -> bool:
    at = rule.get("at")
    return (
        isinstance(rule.get("metric"), str)
        and (rule.get("filter", 0) is None or isinstance(rule.get("filter"), str))
        and isinstance(rule.get("met"), bool)
        and _is_whole(rule.get("reached"))
        and isinstance(at, list)
        and all(map(_is_whole, at))
        and rule.get("half_width") is not None
        and all(key in rule and _is_number(rule[key]) for key in ("half_width", "widest"))
    )


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    """Return whether a setting is a finite number, or not set."""
    return value is None or (isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value))


def _are_texts(*values: Any) -> bool:
    return all(isinstance(value, str) for value in values)
