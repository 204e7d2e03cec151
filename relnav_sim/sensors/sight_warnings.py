"""What the geometry does to a radar's readings, in plain sentences: said before a campaign runs, and in its report."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relnav_sim.sensors.availability import working_probability
from relnav_sim.sensors.noise import noise_parts, probability_below
from relnav_sim.sensors.options import SensorsOptions
from relnav_sim.sensors.radar import CHANNELS, RadarOptions, in_sight, true_reading
from relnav_sim.sensors.suite import TrueStates, carrier_and_other

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

NEAR_AXIS_DEG = 5.0
"""Within this of the azimuth axis the azimuth turns eleven times as quickly as the line of sight, or more."""
NEAR_AXIS_SIGMAS = 10.0
"""And within this many sigmas of the angle noise, where a reading's own error is no longer small beside the distance
from the axis: over it, a linearised azimuth is wrong by a tenth or more."""
MEETING_M = 1.0
"""Separation below which the line of sight has no steady direction."""
RARE = 1e-6
"""Share of readings that is not worth a warning."""
_WINDOWS_NAMED = 3


def sight_warnings(sensors: SensorsOptions, truth: TrueStates) -> list[str]:
    """Return sentences on what the geometry does to the radar's readings at some epochs; none where all is well.

    Args:
        sensors: The sensors of a campaign.
        truth: Epochs (K,), increasing, and true states (runs or 1, K, 6).
    """
    radar = sensors.radar
    if radar is None:
        return []
    distance, azimuth, elevation = true_reading(radar, *carrier_and_other(sensors, truth))
    seen = in_sight(radar, (distance, azimuth, elevation))
    heard = seen & np.isfinite(distance) & (working_probability(sensors, truth.times_s) > 0)
    return [
        *_met(distance, truth.times_s),
        *_out_of_sight(radar, seen, heard, distance),
        *_near_axis(radar, heard, elevation, truth.times_s),
        *_below_zero(radar, heard, distance),
    ]


def _met(distance: Array, times_s: Array) -> list[str]:
    together = distance < MEETING_M
    if not together.any():
        return []
    return [
        f"The craft are within {MEETING_M:g} m of each other {_when(together, times_s)}: the line of sight has no "
        "steady direction there, and the angles say nothing. Filters may fail or diverge for this reason alone."
    ]


def _out_of_sight(radar: RadarOptions, seen: Flags, heard: Flags, distance: Array) -> list[str]:
    flown = np.isfinite(distance).any(axis=1)
    blind = np.asarray(flown & ~heard.any(axis=1))
    if not blind.any():
        return []
    why = "its sensors are never all at work"
    if not seen[blind].any():
        near, far = np.nanmin(distance[blind]), np.nanmax(distance[blind])
        limits = radar.range_limits_m
        outside = limits is not None and (far < limits[0] or near > limits[1])
        where = (
            "range_limits_m" if outside else "field of view" if limits is None else "range_limits_m or field of view"
        )
        why = f"the other craft, {near:.4g} to {far:.4g} m away, is never within its {where}"
    return [f"The radar gives no reading in the whole run{_of_runs(blind)}: {why}. The filters only predict."]


def _near_axis(radar: RadarOptions, heard: Flags, elevation: Array, times_s: Array) -> list[str]:
    near_deg = min(max(NEAR_AXIS_DEG, NEAR_AXIS_SIGMAS * radar.angle_sigma_deg), 90.0)
    from_axis_deg = 90 - np.degrees(np.abs(elevation))
    near = heard & (from_axis_deg < near_deg)
    if not near.any():
        return []
    nearest_deg = round(float(from_axis_deg[near].min()), 2)
    return [
        f"The line of sight is within {near_deg:.3g} deg of the radar's azimuth axis {_when(near, times_s)}, nearest "
        f"{nearest_deg:g} deg: azimuth turns quickly there and does not exist on the axis, so that filters err or "
        "diverge for this reason alone, and a comparison says how they bear it. Turn the radar with "
        "sensors.radar.mounting_deg to compare them elsewhere."
    ]


def _below_zero(radar: RadarOptions, heard: Flags, distance: Array) -> list[str]:
    level = -(distance + radar.range_bias_m) / radar.range_sigma_m
    below = probability_below(noise_parts(radar.noise), CHANNELS, 0, level)
    share = float(below[heard].mean()) if heard.any() else 0.0
    if share <= RARE:
        return []
    return [
        f"About {100 * share:.2g} % of the readings are missing because their range would not be positive: "
        f"range_sigma_m is {radar.range_sigma_m:g} m at separations from {distance[heard].min():.4g} m. The rest is "
        "biased towards long ranges, which no filter is told."
    ]


def _when(flags: Flags, times_s: Array) -> str:
    """Return from when to when any run has the flag, and how many have it where not all do."""
    edges = np.diff(np.concatenate([[0], flags.any(axis=0).astype(int), [0]]))
    windows = [
        f"at {times_s[first]:g} s" if first == last else f"from {times_s[first]:g} to {times_s[last]:g} s"
        for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True)
    ]
    more = len(windows) - _WINDOWS_NAMED
    named = windows[:_WINDOWS_NAMED] if more > 1 else windows
    named += [f"{more} more times"] if more > 1 else []
    listed = f"{', '.join(named[:-1])} and {named[-1]}" if len(named) > 1 else named[0]
    return f"{listed}{_of_runs(np.asarray(flags.any(axis=1)))}"


def _of_runs(which: Flags) -> str:
    return "" if which.all() else f" in {which.sum()} of {len(which)} runs"
