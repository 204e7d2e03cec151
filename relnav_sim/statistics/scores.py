"""A filter's errors against a truth, over some runs, in a few numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.results import layout
from relnav_sim.results.block import FilterResult


@dataclass(frozen=True)
class Scores:
    """Errors of one filter over some runs; every pair is the whole run and what is left of it after `settle_s`.

    Attributes:
        position_rms_m: Root mean square of the position error over all runs, m; NaN where every run failed.
        velocity_rms_m_s: The same of the velocity, m/s.
        anees: Mean of the NEES of position and velocity over its dimension.
        final_position_m: Root mean square over the runs of the position error at the last stored epoch, m.
        final_velocity_m_s: The same of the velocity, m/s.
        failed: Number of runs that failed.
    """

    position_rms_m: tuple[float, float]
    velocity_rms_m_s: tuple[float, float]
    anees: tuple[float, float]
    final_position_m: float
    final_velocity_m_s: float
    failed: int


def scores(results: Sequence[FilterResult]) -> Scores:
    """Return the scores of a filter from its results of some runs each. Runs that failed are left out."""
    summary = {name: np.concatenate([result.summary[name] for result in results]) for name in results[0].summary}
    failed = summary["failed"] != 0
    last = np.concatenate([result.error[:, -1] for result in results])[~failed]

    def rms(quantity: str) -> tuple[float, float]:
        own = summary["rms"][~failed][:, :, layout.QUANTITIES.index(quantity)]
        return _pair(np.sqrt(np.square(own).mean(axis=0)) if len(own) else None)

    def final(part: slice) -> float:
        return float(np.sqrt(np.square(last[:, part]).sum(axis=1).mean())) if len(last) else float("nan")

    anees = summary["anees"][~failed][:, :, layout.BLOCKS.index("full")]
    return Scores(
        rms("r"),
        rms("v"),
        _pair(anees.mean(axis=0) if len(anees) else None),
        final(slice(0, 3)),
        final(slice(3, 6)),
        int(failed.sum()),
    )


def _pair(values: Array | None) -> tuple[float, float]:
    return (float("nan"), float("nan")) if values is None else (float(values[0]), float(values[1]))
