"""How well hosts know their orbit frames between their GNSS fixes: what that costs the measurements' information."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.measurements.frame_error import frame_noise
from relnav_sim.sensors import frame_is_told, own_sensor, relative_sensors
from relnav_sim.sensors.availability import fails_at_random, reads_for_certain
from relnav_sim.sensors.interface import Craft
from relnav_sim.simulation.host_orbits import HostOrbits


class HostFrames:
    """The covariance of the frames of sensors' hosts along the mean orbit, a chunk of epochs at a time.

    Fixes are there when they are due and no fixed outage is on. The frame of a receiver with random outages counts as
    perfect, so that no bound is too high: at a fix the frame is worse than early in an outage, better than late in one.

    Args:
        config: The case.

    Attributes:
        sensors: The sensors whose host's fixes may be missing, with their host.
    """

    def __init__(self, config: CaseConfig) -> None:
        self._config = config
        self._orbits = HostOrbits(config, 1)
        self.sensors: dict[str, Craft] = {
            name: options.host
            for name, options in relative_sensors(config.sensors).items()
            if frame_is_told(name, config.sensors, config.clock.step_s)
        }
        receivers = {host: own_sensor(config.sensors, "orbit", host) for host in self._orbits.hosts}
        self._at_random = {host for host, each in receivers.items() if each is not None and fails_at_random(each[1])}

    def advance(self, epochs: Integers, chief: Array, deputy: Array) -> dict[str, Array]:
        """Return the covariances (K, 6, 6), as `astro.frame_error` has them, by sensor, at the next epochs (K,).

        Args:
            epochs: The epochs.
            chief: Mean states of the chief, (K, 6), ECI.
            deputy: The deputy's.
        """
        step_s = self._config.clock.step_s
        fixes = {}
        for host in self._orbits.hosts:
            found = own_sensor(self._config.sensors, "orbit", host)
            assert found is not None  # or the frame is known
            times_s: Array = np.asarray(epochs * step_s, dtype=np.float64)
            read = reads_for_certain(found[1], epochs, times_s, step_s)
            fixes[host] = np.where(read[:, None], chief if host == "chief" else deputy, np.nan)[None]
        known = self._orbits.advance(fixes)
        return {name: known[host].frame[0] * (host not in self._at_random) for name, host in self.sensors.items()}


def in_frame(information: Array, H: Array, states: Array, covariance: Array) -> Array:
    """Return what is left of the information (N, m, m) of noise about a measurement where its frame errs too.

    The inverse is (information^-1 + G P G^T): exact for Gaussian noise, and for a mixture never less than the
    information of the sum (the matrix form of Stam's inequality, Zamir, IEEE Trans. Information Theory 44(3), 1998).

    Args:
        information: Of the noise without the frame's error.
        H: Jacobian of the measurement by the relative state, (N, m, n).
        states: Relative states (N, 6).
        covariance: P, (N, 6, 6).
    """
    return np.asarray(np.linalg.inv(np.linalg.inv(information) + frame_noise(H, states, covariance)))
