"""When the rows of a result are known: in flight or afterwards, and from which time on."""

from __future__ import annotations

from typing import TYPE_CHECKING

from relnav_sim.filters.registry import filter_kinds
from relnav_sim.results.settings import filter_settings

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

AFTER_THE_RUN = "after the run"


def known_when(results: Results, index: int, name: str) -> str:
    """Return when the estimates of a filter's row are known, in words; empty where each is known at its own epoch."""
    entry, varied = filter_settings(results, index, name), results.headers[index].variables
    smoother = varied.get(f"filters.{name}.smoother", entry.get("smoother"))
    lag_s = varied.get(f"filters.{name}.smoother.fixed_lag.lag_s")
    if isinstance(smoother, dict) and lag_s is None:
        lag_s = smoother.get("fixed_lag", {}).get("lag_s")
    if lag_s is not None:
        return f"{lag_s:g} s later"
    kind = filter_kinds().get(str(varied.get(f"filters.{name}.kind", entry.get("kind"))))
    return AFTER_THE_RUN if smoother is not None or (kind is not None and kind.repeats) else ""


def reads_from_s(results: Results, index: int, name: str) -> float:
    """Return the time from which a row has the measurements, s: a start that is fitted to them waits for the last."""
    entry, varied = filter_settings(results, index, name), results.headers[index].variables
    start = varied.get(f"filters.{name}.batch_start", entry.get("batch_start"))
    duration_s = varied.get(f"filters.{name}.batch_start.duration_s")
    if isinstance(start, dict) and duration_s is None:
        duration_s = start.get("duration_s")
    return float(duration_s or 0.0)
