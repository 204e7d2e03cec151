"""What a user should know of where the craft start."""

from __future__ import annotations

import numpy as np

from relnav_sim.astro.mean_elements import ACCURACY_M
from relnav_sim.truth.options import TruthOptions

OLD_DAYS = 7.0
"""Age of mean elements from which SGP4 has lost kilometres."""

HIGH_KM = 1e5
"""Altitude that is more probably one of 100 km to 1000 km in metres."""
MOON_KM = 384_400.0


def start_warnings(options: TruthOptions) -> list[str]:
    """Return sentences on start states that are too coarse for their use, or hardly meant; none where all is well."""
    return [*_coarse(options), *_old(options), *_far(options)]


def _far(options: TruthOptions) -> list[str]:
    found = []
    for craft, orbit in (("chief", options.chief.orbit), ("deputy", options.deputy.orbit)):
        if orbit is None:
            continue
        if orbit.altitude_km is not None and orbit.altitude_km > HIGH_KM:
            found.append(
                f"The {craft}'s altitude_km of {orbit.altitude_km:.12g} is kilometres, beyond the geostationary "
                f"ring; for {orbit.altitude_km:.12g} m write {orbit.altitude_km / 1e3:.12g}."
            )
        elif orbit.a_km is not None and orbit.a_km > MOON_KM:
            found.append(
                f"The {craft}'s a_km of {orbit.a_km:.12g} is kilometres, beyond the Moon at {MOON_KM:g} km; "
                "check the unit."
            )
    return found


def _coarse(options: TruthOptions) -> list[str]:
    own = options.deputy.own_start
    if own is None or not (options.chief.start.is_mean or own.is_mean):
        return []
    separation = float(np.linalg.norm(own.state(options.start_context)[:3] - options.chief_state[:3]))
    if separation >= ACCURACY_M:
        return []
    return [
        f"The craft start {separation:.0f} m apart by mean elements (TLE or OMM), whose positions are good to about "
        f"{ACCURACY_M / 1e3:g} km: so near to each other they are where SGP4 puts them, not where they were. Start "
        "the deputy by relative, roe or shape."
    ]


def _old(options: TruthOptions) -> list[str]:
    start = options.start_epoch
    found = []
    for craft, each in (("chief", options.chief.start), ("deputy", options.deputy.own_start)):
        if each is not None and each.is_mean and each.own_epoch is not None and start is not None:
            days = abs(start.seconds_since(each.own_epoch)) / 86400
            if days > OLD_DAYS:
                found.append(
                    f"The {craft}'s mean elements are {days:.0f} days away from the start; SGP4 loses about 1 km a day."
                )
    return found
