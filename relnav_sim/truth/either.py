"""What a campaign flies, whichever way its truth is told: propagated, or from recorded orbits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.streams import RandomSource
from relnav_sim.truth import trajectory
from relnav_sim.truth.ephemeris_options import AnyTruth, EphemerisTruthOptions
from relnav_sim.truth.ephemeris_truth import EphemerisTrajectory, flown_chief
from relnav_sim.truth.force_options import HIGHEST_ZONAL
from relnav_sim.truth.propagation import RTOL
from relnav_sim.truth.states import Truth


class Trajectory(Protocol):
    """The truth of a block of runs, evaluated a chunk of epochs at a time."""

    @property
    def failures(self) -> Mapping[int, str]:
        """Why the truth of a run of the block (its index, from 0) ends before the run does."""

    def at(self, times_s: ArrayLike) -> Truth:
        """Return the truth at times (K,) in s, increasing, from 0 to the duration."""

    def felt(self, truth: Truth, step_s: float) -> Array:
        """Return the specific force that each craft feels, as `TruthTrajectory.felt` does."""


def truth_trajectory(options: AnyTruth, duration_s: float, source: RandomSource, rtol: float = RTOL) -> Trajectory:
    """Return the truth of the runs of `source`; where nothing is dispersed, one that all share.

    Args:
        options: The `truth:` section of a campaign.
        duration_s: Length of a run, s.
        source: Seed and run numbers; a run's truth does not depend on the other runs.
        rtol: Error of an integration per radian of an orbit, as a share of its radius.

    Raises:
        EphemerisError: A recorded orbit can't be used.
    """
    if isinstance(options, EphemerisTruthOptions):
        return EphemerisTrajectory(options, duration_s)
    return trajectory.truth_trajectory(options, duration_s, source, rtol)


def nominal_chief(options: AnyTruth) -> ChiefOrbit:
    """Return what a filter is told of the chief's orbit, the same in all runs.

    It is the nominal one; of a recorded orbit the one that osculates at the start.
    """
    return flown_chief(options) if isinstance(options, EphemerisTruthOptions) else trajectory.nominal_chief(options)


def nominal_truth(options: AnyTruth) -> AnyTruth:
    """Return the truth in which nothing is dispersed and every manoeuvre is carried out as planned."""
    return options if isinstance(options, EphemerisTruthOptions) else trajectory.nominal_truth(options)


def rough_truth(options: AnyTruth) -> AnyTruth:
    """Return the nominal truth under zonal harmonics and drag alone, for a quick look at geometry."""
    return options if isinstance(options, EphemerisTruthOptions) else trajectory.rough_truth(options)


def highest_zonal(options: AnyTruth) -> int:
    """Return the highest zonal harmonic of the Earth that filters can be told of."""
    return HIGHEST_ZONAL if isinstance(options, EphemerisTruthOptions) else options.forces.highest_zonal
