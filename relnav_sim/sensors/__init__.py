"""What is measured: one sensor a file, its noise, and the chain from measurements to what filters take."""

from relnav_sim.measurements.channel import Channel
from relnav_sim.sensors.availability import channels_due, reading_at_every_epoch, reading_probability
from relnav_sim.sensors.campaign_sensors import (
    Sensors,
    attitude_covariance,
    frame_is_told,
    hosts_of,
    orbit_frame_covariance,
    own_sensor,
    relative_sensors,
)
from relnav_sim.sensors.front_end import filter_inputs, form_taken, sensor_measurement
from relnav_sim.sensors.host_frame import HostOrbit
from relnav_sim.sensors.interface import (
    ErrorShares,
    MeasurementContext,
    RelativeSensorOptions,
    Sensed,
    SensorOptions,
)
from relnav_sim.sensors.layout import known_orbits, readings_layout
from relnav_sim.sensors.noise import noise_kinds
from relnav_sim.sensors.registry import register_sensor, sensor_kinds
from relnav_sim.sensors.sight_warnings import sight_warnings
from relnav_sim.sensors.suite import SensorSuite, streams_of

__all__ = [
    "Channel",
    "ErrorShares",
    "HostOrbit",
    "MeasurementContext",
    "RelativeSensorOptions",
    "Sensed",
    "SensorOptions",
    "SensorSuite",
    "Sensors",
    "attitude_covariance",
    "channels_due",
    "filter_inputs",
    "form_taken",
    "frame_is_told",
    "hosts_of",
    "known_orbits",
    "noise_kinds",
    "orbit_frame_covariance",
    "own_sensor",
    "reading_at_every_epoch",
    "reading_probability",
    "readings_layout",
    "register_sensor",
    "relative_sensors",
    "sensor_kinds",
    "sensor_measurement",
    "sight_warnings",
    "streams_of",
]
