"""Recorded states from the frame of their file to ECI."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.earth_orientation import eci_from_itrf, eme2000_from_gcrf, itrf_from_eci
from relnav_sim.astro.epoch import Epoch
from relnav_sim.recorded.segment import is_celestial, is_inertial


def in_eci(
    states: Array, times_s: Array, epoch: Epoch, frame: str, ut1_utc_s: float, polar_motion_rad: tuple[float, float]
) -> Array:
    """Return states (T, 6) in ECI (EME2000) from those in a frame that `load_ephemeris` reads."""
    if is_celestial(frame):
        return eme2000_from_gcrf(states)
    if is_inertial(frame):
        return states
    return eci_from_itrf(states, times_s, epoch, ut1_utc_s=ut1_utc_s, polar_motion_rad=polar_motion_rad)


def seen_from_earth(states: Array, times_s: Array, epoch: Epoch) -> Array:
    """Return ITRF states (T, 6) with velocities relative to the Earth, from such seen from inertial space."""
    at_rest = states * np.repeat([1.0, 0.0], 3)
    along_eci = eci_from_itrf(states, times_s, epoch)
    along_eci[:, 3:] -= eci_from_itrf(at_rest, times_s, epoch)[:, 3:]
    return np.concatenate([states[:, :3], itrf_from_eci(along_eci, times_s, epoch)[:, 3:]], axis=1)
