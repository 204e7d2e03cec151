"""Which rows of a result tell what is known afterwards, and not what a filter knows in flight."""

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
