"""The orbits of the craft that carry relative sensors, carried on where their own GNSS fixes are missing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.frame_error import frame_covariance
from relnav_sim.astro.frames import own_from_inertial
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.nominal_motion import moved_on
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.linalg import cholesky
from relnav_sim.sensors import HostOrbit, Sensors, frame_is_told, orbit_frame_covariance, own_sensor, relative_sensors
from relnav_sim.sensors.interface import Craft
from relnav_sim.sensors.noise import noise_parts, white_variance
from relnav_sim.truth import highest_zonal, nominal_chief
from relnav_sim.truth.thrust import CRAFT

BELIEVED_ZONALS = 2
"""Highest zonal harmonic that a craft's own orbit filter believes in, as `nonlinear_j2` does by default."""


def believed_orbit(config: CaseConfig) -> ChiefOrbit:
    """Return the nominal orbit about the body that the craft believe in: a point mass with J2, where there is one."""
    return nominal_chief(config.truth).up_to(min(BELIEVED_ZONALS, highest_zonal(config.truth)))


def believed_orbit_at(config: CaseConfig, sensor: str, time_s: float) -> ChiefOrbit:
    """Return `believed_orbit` for a sensor's measurements from some time on, where its epoch 0 is that time.

    Only in the deputy's frame does it matter where the chief is.
    """
    orbit = believed_orbit(config)
    return moved_on(orbit, time_s) if relative_sensors(config.sensors)[sensor].host == "deputy" else orbit


def believed_gravity(config: CaseConfig) -> Gravity:
    """Return the gravity that the craft believe in."""
    return Gravity.of(believed_orbit(config))


def fixes_of(hosts: Sequence[Craft], sensors: Sensors, readings: Mapping[str, Array]) -> dict[Craft, Array]:
    """Return the measurements of the receivers that craft carry, by craft, (runs, K, 6)."""
    found = {host: own_sensor(sensors, "orbit", host) for host in hosts}
    return {host: readings[each[0]] for host, each in found.items() if each is not None}


class HostOrbits:
    """What the hosts of relative sensors know of their own orbits, of a block of runs, a chunk of epochs at a time.

    Only where fixes may be missing and a sensor needs its host's orbit: there the craft's own orbit filter, with the
    gravity of the campaign up to J2, carries the orbit on from fix to fix, and before the first fix nothing is known.

    Args:
        config: The case.
        runs: Number of runs.

    Attributes:
        hosts: The craft that need it; most campaigns have none.
    """

    def __init__(self, config: CaseConfig, runs: int) -> None:
        step_s = config.clock.step_s
        self.hosts: tuple[Craft, ...] = tuple(
            sorted(
                {
                    options.host
                    for name, options in relative_sensors(config.sensors).items()
                    if frame_is_told(name, config.sensors, step_s)
                }
            )
        )
        self._orbits = {host: _CarriedOrbit(config, host, runs) for host in self.hosts}

    def advance(self, fixes: Mapping[Craft, Array], forces: Array | None = None) -> dict[Craft, HostOrbit]:
        """Return what the hosts know over the next K epochs.

        Args:
            fixes: Their fixes, (runs, K, 6), ECI, m and m/s; NaN = none.
            forces: Thrust that they know of, as `KnownThrust.take` has it, (runs or 1, K, 2, 2, 3); None: none.
        """
        return {
            host: orbit.advance(fixes[host], None if forces is None else forces[:, :, CRAFT.index(host)])
            for host, orbit in self._orbits.items()
        }


class _CarriedOrbit:
    """One craft's own orbit filter."""

    def __init__(self, config: CaseConfig, host: Craft, runs: int) -> None:
        found = own_sensor(config.sensors, "orbit", host)
        assert found is not None  # or no frame is told
        receiver = found[1]
        sigmas = receiver.sigmas * np.sqrt(white_variance(noise_parts(receiver.noise)) or 1.0)
        body = believed_orbit(config)
        self._filter = OrbitFilter(OrbitFilterOptions(), body, sigmas, config.clock.step_s, runs)
        self._at_fix = orbit_frame_covariance(config.sensors, body, host)
        self._begun = np.zeros(runs, dtype=bool)

    def advance(self, fixes: Array, forces: Array | None) -> HostOrbit:
        """Return the fixes, and between them the filter's estimate, with the covariance of the frame of either."""
        missing: Mask = np.asarray(np.isnan(fixes).any(axis=2))
        states = fixes.copy()
        frame = np.broadcast_to(self._at_fix, (*missing.shape, 6, 6)).copy()
        for k in range(fixes.shape[1]):
            told = None if forces is None else forces[:, k : k + 1]
            estimate = self._filter.advance(fixes[:, k : k + 1], told)[:, 0]
            self._begun |= ~missing[:, k]
            if missing[:, k].any():
                lost = missing[:, k, None]
                known = np.where(self._begun[:, None], estimate, np.nan)
                states[:, k] = np.where(lost, known, fixes[:, k])
                grown = _frame_covariance(estimate, self._filter.covariance)
                # Nothing is read in a frame that is not known, so that its error is of no account.
                grown = np.where(self._begun[:, None, None], grown, 0.0)
                frame[:, k] = np.where(lost[..., None], grown, frame[:, k])
        return HostOrbit(states, frame)


def _frame_covariance(states: Array, covariance: Array) -> Array:
    """Return the covariance of the frames' errors, (runs, 6, 6), RTN, from that of ECI states (runs, 6)."""
    root = cholesky(covariance)
    columns = root.swapaxes(1, 2).reshape(len(root), 6, 2, 3)
    own = own_from_inertial(np.broadcast_to(states[:, None, None], (*columns.shape[:3], 6)), columns)
    r, v = (np.linalg.norm(part, axis=1) for part in (states[:, :3], states[:, 3:]))
    return frame_covariance(own.reshape(len(root), 6, 6).swapaxes(1, 2), r, v)
