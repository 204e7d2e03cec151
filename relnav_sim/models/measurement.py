"""Former name of `relnav_sim.measurements.interface` and the measurements beside it."""

from relnav_sim.measurements.function import FunctionMeasurement
from relnav_sim.measurements.given_noise import MixtureNoise
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults, Mixture
from relnav_sim.measurements.linear import LinearMeasurement

__all__ = ["FunctionMeasurement", "LinearMeasurement", "Measurement", "MeasurementDefaults", "Mixture", "MixtureNoise"]
