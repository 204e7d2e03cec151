"""What is measured: radar, GNSS, star tracker and accelerometers with their noise, and the chain to the filters."""

from relnav_sim.sensors.accelerometer import AccelerometerOptions
from relnav_sim.sensors.availability import reading_probability
from relnav_sim.sensors.front_end import attitude_covariance, filter_inputs, measurement_model, radar_model
from relnav_sim.sensors.gnss import GnssOptions
from relnav_sim.sensors.noise import noise_kinds
from relnav_sim.sensors.options import SensorsOptions, sensor_kinds
from relnav_sim.sensors.radar import RadarOptions
from relnav_sim.sensors.sight_warnings import sight_warnings
from relnav_sim.sensors.star_tracker import StarTrackerOptions
from relnav_sim.sensors.suite import SensorSuite

__all__ = [
    "AccelerometerOptions",
    "GnssOptions",
    "RadarOptions",
    "SensorSuite",
    "SensorsOptions",
    "StarTrackerOptions",
    "attitude_covariance",
    "filter_inputs",
    "measurement_model",
    "noise_kinds",
    "radar_model",
    "reading_probability",
    "sensor_kinds",
    "sight_warnings",
]
