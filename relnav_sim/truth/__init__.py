"""What really happens: two spacecraft in Earth orbit, under forces or as recorded."""

from relnav_sim.astro.frames import eci_from_rtn, rtn_from_eci
from relnav_sim.truth.earlier import begun_earlier
from relnav_sim.truth.either import (
    Trajectory,
    highest_zonal,
    nominal_chief,
    nominal_truth,
    rough_truth,
    truth_trajectory,
)
from relnav_sim.truth.ephemeris_options import AnyTruth, EphemerisTruthOptions, TruthSection
from relnav_sim.truth.forces import ExponentialAtmosphere, ForceModel
from relnav_sim.truth.options import TruthOptions
from relnav_sim.truth.propagation import propagate
from relnav_sim.truth.start_warnings import start_warnings
from relnav_sim.truth.states import Truth
from relnav_sim.truth.trajectory import TruthTrajectory

__all__ = [
    "AnyTruth",
    "EphemerisTruthOptions",
    "ExponentialAtmosphere",
    "ForceModel",
    "Trajectory",
    "Truth",
    "TruthOptions",
    "TruthSection",
    "TruthTrajectory",
    "begun_earlier",
    "eci_from_rtn",
    "highest_zonal",
    "nominal_chief",
    "nominal_truth",
    "propagate",
    "rough_truth",
    "rtn_from_eci",
    "start_warnings",
    "truth_trajectory",
]
