"""What the geometry does to measurements, in plain sentences: before a campaign runs, and in its report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.sensors.availability import reading_at_every_epoch, reading_probability, sensed
from relnav_sim.sensors.campaign_sensors import Sensors, relative_sensors
from relnav_sim.sensors.interface import RelativeSensorOptions, Sensed
from relnav_sim.sensors.suite import TrueStates
from relnav_sim.wording import listed

NEAR_AXIS_DEG = 5.0
"""Within this of the azimuth axis the azimuth turns eleven times as quickly as the line of sight, or more."""
NEAR_AXIS_SIGMAS = 10.0
"""And within so many sigmas of the angle noise, where a measurement's own error is no longer small beside the distance
from the axis: over it, a linearised azimuth is wrong by a tenth or more."""
MEETING_M = 1.0
"""Separation below which the line of sight has no steady direction."""
RARE = 1e-6
"""Share of measurements that is not worth a warning."""
_WINDOWS_NAMED = 3


def sight_warnings(
    sensors: Sensors, truth: TrueStates, filters: Mapping[str, Sequence[str]] | None = None
) -> list[str]:
    """Return sentences on what the geometry does to the measurements at some epochs; none where all is well.

    Args:
        sensors: The sensors of a campaign.
        truth: Epochs (K,), increasing, and true states (runs or 1, K, 6).
        filters: The sensors that each filter goes by; those that none goes by do not matter. Default: all matter.
    """
    relative = relative_sensors(sensors)
    going_by = {"": tuple(relative)} if filters is None else filters
    offset = truth.deputy[..., :3] - truth.chief[..., :3]
    distance = np.sqrt(np.square(offset).sum(axis=-1))
    said = _met(distance, truth.times_s) if relative else []
    blind: dict[str, Mask] = {}
    for name, options in relative.items():
        if not any(name in names for names in going_by.values()):
            continue
        met = sensed(truth, options.host, 1.0)
        seen = options.in_reach(met) & np.isfinite(distance)
        # Whether a measurement is due does not matter: the epochs here are those that were looked at, not all there
        # are.
        heard = (reading_probability(reading_at_every_epoch(sensors), name, truth, 0, 1.0) > 0).any(axis=-1) & seen
        blind[name] = np.asarray(np.isfinite(distance).any(axis=1) & ~heard.any(axis=1))
        said += _out_of_sight(name, options, seen, blind[name], distance)
        said += _near_pole(name, options, met, heard, truth.times_s)
        said += _below_zero(name, options, heard, distance)
    return said + _only_predicting(going_by, blind)


def _only_predicting(filters: Mapping[str, Sequence[str]], blind: Mapping[str, Mask]) -> list[str]:
    """Return which filters have no measurement at all in some runs, as no sensor of theirs gives any."""
    lost = {name: np.logical_and.reduce([blind[sensor] for sensor in names]) for name, names in filters.items()}
    which: dict[str, list[str]] = {}
    for name, runs in lost.items():
        if runs.any():
            which.setdefault(_of_runs(runs), []).append(name)
    return [
        f"The filters only predict{runs}."
        if len(names) == len(filters)
        else f"The filter{'s' if len(names) > 1 else ''} {', '.join(names)} only predict{'' if len(names) > 1 else 's'}"
        f"{runs}: none of {'their' if len(names) > 1 else 'its'} sensors gives a measurement."
        for runs, names in which.items()
    ]


def _met(distance: Array, times_s: Array) -> list[str]:
    together = distance < MEETING_M
    if not together.any():
        return []
    return [
        f"The craft are within {MEETING_M:g} m of each other {_when(together, times_s)}: the line of sight has no "
        "steady direction there, and the angles say nothing. Filters may fail or diverge for this reason alone."
    ]


def _out_of_sight(name: str, options: RelativeSensorOptions, seen: Mask, blind: Mask, distance: Array) -> list[str]:
    if not blind.any():
        return []
    why = "it, or what its host needs to know of itself, is never at work"
    if not seen[blind].any():
        near, far = np.nanmin(distance[blind]), np.nanmax(distance[blind])
        limits = options.range_limits_m
        outside = limits is not None and (far < limits[0] or near > limits[1])
        where = (
            "range_limits_m" if outside else "field of view" if limits is None else "range_limits_m or field of view"
        )
        why = f"the other craft, {near:.4g} to {far:.4g} m away, is never within its {where}"
    return [f"The {name} gives no measurement in the whole run{_of_runs(blind)}: {why}."]


def _near_pole(name: str, options: RelativeSensorOptions, truth: Sensed, heard: Mask, times_s: Array) -> list[str]:
    off = options.off_pole(truth)
    if off is None:
        return []
    angle_sigma_deg = np.degrees(max(options.sigmas[[channel.angle for channel in options.channels]]))
    near_deg = min(max(NEAR_AXIS_DEG, NEAR_AXIS_SIGMAS * angle_sigma_deg), 90.0)
    from_axis_deg = np.degrees(off)
    near = heard & (from_axis_deg < near_deg)
    if not near.any():
        return []
    nearest_deg = round(float(from_axis_deg[near].min()), 2)
    tangent = (
        f", or take sensors.{name}.form: tangent, which has no such axis"
        if "form" in type(options).model_fields
        else ""
    )
    return [
        f"The line of sight is within {near_deg:.3g} deg of the {name}'s azimuth axis {_when(near, times_s)}, nearest "
        f"{nearest_deg:g} deg: azimuth turns quickly there and does not exist on the axis, so that filters err or "
        "diverge for this reason alone, and a comparison says how they bear it. Turn it with "
        f"sensors.{name}.mounting_deg to compare them elsewhere{tangent}."
    ]


def _below_zero(name: str, options: RelativeSensorOptions, heard: Mask, distance: Array) -> list[str]:
    below = options.no_echo(distance)
    share = float(below[heard].mean()) if below is not None and heard.any() else 0.0
    if share <= RARE:
        return []
    return [
        f"About {100 * share:.2g} % of the measurements of the {name} are missing because their range would not be "
        f"positive: its noise is of the size of the separation, from {distance[heard].min():.4g} m. The rest is biased "
        "towards long ranges, which no filter is told."
    ]


def _when(flags: Mask, times_s: Array) -> str:
    """Return from when to when any run has the flag, and how many have it where not all do."""
    edges = np.diff(np.concatenate([[0], flags.any(axis=0).astype(int), [0]]))
    windows = [
        f"at {times_s[first]:g} s" if first == last else f"from {times_s[first]:g} to {times_s[last]:g} s"
        for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True)
    ]
    more = len(windows) - _WINDOWS_NAMED
    named = windows[:_WINDOWS_NAMED] if more > 1 else windows
    named += [f"{more} more times"] if more > 1 else []
    return f"{listed(named)}{_of_runs(np.asarray(flags.any(axis=1)))}"


def _of_runs(which: Mask) -> str:
    return "" if which.all() else f" in {which.sum()} of {len(which)} runs"
