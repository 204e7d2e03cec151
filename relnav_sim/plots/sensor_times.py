"""When sensors are to give measurements, as the campaign has them: their periods, and fixed outages of own sensors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.results.settings import case_setting
from relnav_sim.sensors.registry import sensor_kinds

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

Windows = tuple[tuple[float, float], ...]


def stored_epochs_between(results: Results, index: int, sensors: Iterable[str], times_s: Array) -> dict[str, int]:
    """Return how many stored epochs the period of each sensor spans, rounded up; 1 where the campaign has none.

    Args:
        results: An opened result.
        index: The case's number from 0.
        sensors: Their names.
        times_s: The stored epochs, s.
    """
    apart_s = float(times_s[1] - times_s[0]) if len(times_s) > 1 else np.inf
    found = {name: case_setting(results, index, f"sensors.{name}.period_s", None) for name in sensors}
    return {
        name: max(1, int(np.ceil(period_s / apart_s - 1e-9))) if isinstance(period_s, int | float) else 1
        for name, period_s in found.items()
    }


def usual_gap(read: Mask, at_least: int = 1) -> float:
    """Return how many stored epochs usually lie from one with a measurement to the next.

    That is the median, but no less than the sensor's period spans: a period of 60 s stored every 25 s makes gaps of
    2, 2 and 3 epochs in turn, none of which is an outage.

    Args:
        read: Whether there is a measurement since the stored epoch before, (runs, K).
        at_least: How many the period spans.
    """
    gaps = np.concatenate([np.diff(np.flatnonzero(row)) for row in read]) if len(read) else np.empty(0)
    return max(float(np.median(gaps)), at_least) if gaps.size else at_least


def own_outages(results: Results, index: int) -> dict[str, Windows]:
    """Return the fixed outages of sensors of their host's own orbit, attitude or thrust, [from, to) in s, by name.

    Results hold no measurements of these sensors, but a filter feels their absence.
    """
    found: dict[str, Windows] = {}
    for name, settings in _mapping(results.campaign_content.get("sensors")).items():
        kind = sensor_kinds().get(str(_mapping(settings).get("kind", name)))
        if kind is not None and kind.role != "other":
            noise = case_setting(results, index, f"sensors.{name}.noise", ())
            windows = tuple(_windows([noise] if isinstance(noise, Mapping) else noise))
            found |= {name: windows} if windows else {}
    return found


def _windows(parts: Sequence[Any]) -> Iterable[tuple[float, float]]:
    for part in map(_mapping, parts):
        if part.get("kind") == "outage":
            for start, end in part.get("windows_s") or ():
                yield float(start), float(end)


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
