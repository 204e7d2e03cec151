"""Shi et al. (2025) as a paper whose numbers can be made anew in any setting."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.alpha_kf_flight import QUICK, flights
from replication.inverse.alpha_kf_numbers import NUMBERS, numbers
from replication.inverse.alpha_kf_truth import motion
from replication.inverse.alpha_kf_unknowns import UNKNOWNS
from replication.inverse.prior import Unknown, values
from replication.inverse.table import Number


class AlphaKf:
    """Tables 2, 3 and 4, flown together."""

    name = "alpha_kf"
    unknowns: Sequence[Unknown] = UNKNOWNS
    numbers: Sequence[Number] = NUMBERS

    def flown(self, u: Array, seeds: Sequence[Sequence[int]], runs: int) -> Array:
        """Return the numbers of single runs, (n, runs, numbers); arguments as for `bank.Paper`."""
        setting = values(UNKNOWNS, u)
        moved = motion(setting)
        out = np.empty((len(u), runs, len(NUMBERS)))
        for row, seed in enumerate(seeds):
            own = {name: float(value[row]) for name, value in setting.items()}
            generator = np.random.default_rng(list(seed))
            flown = flights(
                own, moved.mean_motion_rad_s[row], moved.nodes[row], moved.left_out[row], generator, runs, QUICK
            )
            out[row] = numbers(own, flown, QUICK)
        return out
