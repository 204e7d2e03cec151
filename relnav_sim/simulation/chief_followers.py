"""The chief's orbit for the filters of a block that estimate it from its GNSS fixes."""

from __future__ import annotations

import numpy as np

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.chief_segments import ChiefFollower
from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Dynamics, NonlinearJ2Options
from relnav_sim.sensors.noise import noise_parts, white_variance
from relnav_sim.simulation.thrust_inputs import known_thrust
from relnav_sim.truth import nominal_chief


class ChiefFollowers:
    """One estimate of the chief's orbit for all filters of a block that believe the same and are told the same thrust.

    Args:
        config: The case.
        runs: Number of runs in the block.
    """

    def __init__(self, config: CaseConfig, runs: int) -> None:
        self._config, self._runs = config, runs
        self._followers: dict[tuple[str, str], ChiefFollower] = {}

    def of(self, dynamics: Dynamics, entry: FilterEntry) -> ChiefFollower | None:
        """Return what supplies a filter's dynamics with the chief's orbit from its GNSS fixes, where they go by it.

        With the receiver on the deputy, or none, they go by the nominal orbit.
        """
        gnss, radar = self._config.sensors.gnss, self._config.sensors.radar
        options = entry.dynamics
        if not isinstance(options, NonlinearJ2Options) or not isinstance(dynamics, NonlinearJ2Dynamics):
            return None
        if gnss is None or (radar is not None and radar.carrier == "deputy"):
            return None
        key = options.model_dump_json(), known_thrust(entry, self._config)
        if key not in self._followers:
            sigmas = gnss.sigmas * np.sqrt(white_variance(noise_parts(gnss.noise)) or 1.0)
            orbit, step_s = nominal_chief(self._config.truth), self._config.clock.step_s
            self._followers[key] = options.follower(orbit, sigmas, step_s, self._runs)
        self._followers[key].supply(dynamics)
        return self._followers[key]
