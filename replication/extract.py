"""A campaign's results made small: the figures per run and the curves that the pages need, as a dictionary for JSON.

Six digits of every figure, so that an extract can be committed and compared; its digest is that of its content.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.read import Results, open_results
from replication.curves import curves_of
from replication.derived import derived
from replication.kept import COLUMNS, CURVES

_DIGITS = 6


@dataclass(frozen=True)
class Extract:
    """What is kept of a campaign's results.

    Attributes:
        campaign: Name of the campaign.
        campaign_hash: Hash of its settings.
        content: Everything else, as in the file.
    """

    campaign: str
    campaign_hash: str
    content: Mapping[str, Any]

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the runs, ascending."""
        return tuple(self.content["runs"])

    @property
    def cases(self) -> Sequence[Mapping[str, Any]]:
        """The cases, each with label, variables, columns and curves."""
        cases: Sequence[Mapping[str, Any]] = self.content["cases"]
        return cases


def extracted(path: Path) -> Extract:
    """Return what is kept of a results file.

    Raises:
        ResultsError: The file can't be read.
    """
    with open_results(path) as results:
        name = results.campaign_name
        summary = results.summary()
        settle_s = float(results.campaign_content["statistics"]["settle_s"])
        cases = []
        for index, label in enumerate(results.cases):
            kept = {filter: _columns(results, index, filter, settle_s, summary) for filter in results.filters}
            failed = {run for filter in kept for run in _failed(summary, index, filter)}
            cases.append(
                {
                    "label": label,
                    "variables": results.variables(index),
                    "failed_runs": len(failed),
                    "end_s": float(results.time_s(index)[-1]),
                    "bound": _bound(results, index, settle_s),
                    "columns": kept,
                    "curves": [curves_of(results, wanted) for wanted in CURVES.get(name, ()) if wanted.case == index],
                }
            )
        cpu = np.nansum(summary["cpu_us_per_step"] * summary["epochs"]) / 3.6e9
        content = {
            "runs": [int(run) for run in results.runs],
            "settle_s": settle_s,
            "cpu_hours": round(float(cpu), 3),
            "filters": list(results.filters),
            "cases": cases,
        }
        return Extract(name, results.campaign_hash, _plain(content))


def _rows(summary: Mapping[str, NDArray[Any]], case: int, filter: str) -> NDArray[np.intp]:
    rows = np.flatnonzero((summary["case"] == case) & (summary["filter"] == filter))
    return rows[np.argsort(summary["run"][rows])]


def _failed(summary: Mapping[str, NDArray[Any]], case: int, filter: str) -> list[int]:
    rows = _rows(summary, case, filter)
    return [int(run) for run in summary["run"][rows][summary["failed"][rows]]]


def _columns(
    results: Results, case: int, filter: str, settle_s: float, summary: Mapping[str, NDArray[Any]]
) -> dict[str, Array]:
    """Return the kept columns of a filter, a figure for each run in order; NaN where the filter failed."""
    groups = COLUMNS[results.campaign_name]
    names = [name for group in groups if not group.filters or filter in group.filters for name in group.names]
    rows = _rows(summary, case, filter)
    failed = summary["failed"][rows]
    kept = {}
    made = None
    for name in names:
        if name in summary:
            values = summary[name][rows].astype(np.float64)
        else:
            if made is None:
                made = derived(results.time_s(case), results.error(case, filter), results.sigma(case, filter), settle_s)
            values = made[name]()
        kept[name] = np.where(failed, np.nan, values)
    return kept


def _bound(results: Results, case: int, settle_s: float) -> list[float] | None:
    """Return the bound's RMS over the steady state, position and velocity, or None where the results hold none."""
    bound = results.bound(case)
    if bound is None:
        return None
    settled = results.time_s(case) >= settle_s
    return [math.sqrt(float(np.mean(bound[settled, column] ** 2))) for column in (6, 7)]


def rounded(value: float) -> float | None:
    """Return a figure with six digits; None for NaN, which JSON does not have."""
    if math.isnan(value):
        return None
    return float(f"{value:.{_DIGITS}g}")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return rounded(value)
    return value


def digest(extract: Extract) -> str:
    """Return the SHA-256 of an extract's content, 64 hexadecimal digits."""
    text = json.dumps([extract.campaign, extract.campaign_hash, extract.content], sort_keys=True, ensure_ascii=True)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def write_extract(extract: Extract, path: Path) -> None:
    """Write an extract with its digest."""
    whole = {
        "campaign": extract.campaign,
        "campaign_hash": extract.campaign_hash,
        "sha256": digest(extract),
        **extract.content,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with written_whole(path) as temporary:
        text = json.dumps(whole, ensure_ascii=True, separators=(",", ":"))
        temporary.write_text(text.replace('"columns":', '\n"columns":') + "\n", encoding="utf-8", newline="\n")


def read_extract(path: Path) -> Extract:
    """Return the extract in a file.

    Raises:
        OSError: The file can't be read.
        ValueError: It is no extract, or its digest is not that of its content.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        campaign, campaign_hash, sha256 = (content.pop(key) for key in ("campaign", "campaign_hash", "sha256"))
    except (KeyError, TypeError, AttributeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} is no summary of a campaign") from error
    extract = Extract(campaign, campaign_hash, content)
    if digest(extract) != sha256:
        raise ValueError(f"{path}: its digest is not that of its content; write it anew with make reproduce-full")
    return extract
