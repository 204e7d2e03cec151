"""States of other inertial axes in those of all truth: the mean equator and equinox of J2000 (EME2000).

GCRF differs from EME2000 by the constant frame bias, 23 mas or 0.8 m in low orbit. TEME, in which SGP4 tells orbits,
has the true equator of date and a mean equinox (Vallado, Fundamentals of Astrodynamics and Applications, 4th ed.,
section 3.7): the equation of the equinoxes leads to the true equinox, nutation and precession of IAU 1976/1980, which
two-line elements are made with, from there to J2000.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.epoch import Epoch


def eme2000_from_gcrf(states: Array) -> Array:
    """Return states (..., 6) in m and m/s, given in GCRF axes, in EME2000 axes."""
    import erfa

    bias, _, _ = erfa.bp00(*_J2000)
    return _turned(states, bias)


def eme2000_from_teme(states: Array, epoch: Epoch) -> Array:
    """Return states (..., 6) in m and m/s, given in TEME axes of an epoch, in EME2000 axes."""
    import erfa

    day, fraction = epoch.tt
    true_equinox = erfa.rz(-erfa.eqeq94(day, fraction), np.eye(3))
    return _turned(states, erfa.pnm80(day, fraction).T @ true_equinox)


def _turned(states: Array, rotation: Array) -> Array:
    return np.concatenate([states[..., :3] @ rotation.T, states[..., 3:] @ rotation.T], axis=-1)


_J2000 = (2451545.0, 0.0)
