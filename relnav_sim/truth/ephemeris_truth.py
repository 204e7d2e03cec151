"""The truth of a block of runs from recorded orbits."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.frames import rtn_from_eci
from relnav_sim.astro.orbits import elements_from_state
from relnav_sim.truth.ephemeris_options import EphemerisTruthOptions
from relnav_sim.truth.flown_orbits import flown
from relnav_sim.truth.states import Truth
from relnav_sim.truth.thrust import CRAFT
from relnav_sim.truth.trajectory import chief_orbit


class EphemerisTrajectory:
    """The flown truth of both craft, the same in all runs, evaluated a chunk of epochs at a time.

    Attributes:
        failures: Empty: an orbit that is too short is refused beforehand.

    Raises:
        EphemerisError: A file can't be used, or does not cover the run.
    """

    def __init__(self, options: EphemerisTruthOptions, duration_s: float) -> None:
        self.failures: Mapping[int, str] = {}
        epoch = options.start_epoch
        self._craft = [flown(options.ephemeris, craft, epoch, duration_s, options.orientation) for craft in CRAFT]
        self._begin_s = [epoch.seconds_since(each.epoch) for each in self._craft]
        self._duration_s = duration_s

    def at(self, times_s: ArrayLike) -> Truth:
        """Return the truth at times (K,) in s, from 0 to the duration; its leading axis is 1.

        Raises:
            ValueError: A time is negative or beyond the duration.
        """
        times = np.asarray(times_s, dtype=float)
        if times.size and not (times.min() >= 0 and times.max() <= self._duration_s * (1 + 1e-9)):
            reached = f"{times.min():g} to {times.max():g} s"
            raise ValueError(f"times_s goes from {reached}; the truth from 0 to {self._duration_s:g} s")
        inside = np.minimum(times, self._duration_s)
        chief, deputy = (each.at(begin + inside) for each, begin in zip(self._craft, self._begin_s, strict=True))
        normal = np.cross(chief[:, :3], chief[:, 3:])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        pulled = (self._craft[0].accelerations(self._begin_s[0] + inside) * normal).sum(axis=1)
        return Truth(times, chief[None], deputy[None], rtn_from_eci(chief, deputy, pulled)[None], pulled[None])

    def felt(self, truth: Truth, step_s: float) -> Array:
        """Refuse to say what the craft feel; a campaign that asks for it is refused when it is loaded.

        Raises:
            ValueError: Always.
        """
        raise ValueError("recorded orbits do not tell thrust and drag apart from gravity")


def flown_chief(options: EphemerisTruthOptions) -> ChiefOrbit:
    """Return the orbit that osculates the chief's at the start.

    Raises:
        EphemerisError: A file can't be used.
        ValueError: The chief is on no ellipse.
    """
    epoch = options.start_epoch
    chief = flown(options.ephemeris, "chief", epoch, orientation=options.orientation)
    state = chief.at(epoch.seconds_since(chief.epoch))
    return chief_orbit(elements_from_state(state, options.constants.mu_m3_s2), options.constants)
