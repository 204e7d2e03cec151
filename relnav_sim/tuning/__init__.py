"""Tuning: free scalars of filters, found by common random numbers on seeds that the campaign never uses."""

from relnav_sim.tuning.result import FilterTuning, Tuning
from relnav_sim.tuning.scalars import Scalar, TuningError
from relnav_sim.tuning.tune import tune_campaign

__all__ = ["FilterTuning", "Scalar", "Tuning", "TuningError", "tune_campaign"]
