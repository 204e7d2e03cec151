"""What really happens: two spacecraft in Earth orbit under zonal gravity and drag."""

from relnav_sim.astro.frames import eci_from_rtn, rtn_from_eci
from relnav_sim.truth.earlier import begun_earlier
from relnav_sim.truth.forces import ExponentialAtmosphere, ForceModel
from relnav_sim.truth.options import TruthOptions
from relnav_sim.truth.propagation import propagate
from relnav_sim.truth.start_warnings import start_warnings
from relnav_sim.truth.trajectory import Truth, TruthTrajectory, nominal_chief, nominal_truth, truth_trajectory

__all__ = [
    "ExponentialAtmosphere",
    "ForceModel",
    "Truth",
    "TruthOptions",
    "TruthTrajectory",
    "begun_earlier",
    "eci_from_rtn",
    "nominal_chief",
    "nominal_truth",
    "propagate",
    "rtn_from_eci",
    "start_warnings",
    "truth_trajectory",
]
