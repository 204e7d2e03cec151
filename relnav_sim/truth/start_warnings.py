"""What a user should know of where the craft start."""

from __future__ import annotations

import numpy as np

from relnav_sim.astro.mean_elements import ACCURACY_M
from relnav_sim.truth.options import TruthOptions

OLD_DAYS = 7.0
"""Age of mean elements from which SGP4 has lost kilometres."""


def start_warnings(options: TruthOptions) -> list[str]:
    """Return sentences on start states that are coarser than what is made of them; none where all is well."""
    return [*_coarse(options), *_old(options)]


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
