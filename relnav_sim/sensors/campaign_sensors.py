"""The sensors of a campaign by name: which craft carries each, and what a host knows of itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN
from relnav_sim.sensors.due import steps_per_reading
from relnav_sim.sensors.interface import Craft, RelativeSensorOptions, Role, SensorOptions
from relnav_sim.sensors.noise import has_outages, noise_parts

Sensors = Mapping[str, SensorOptions]


def relative_sensors(sensors: Sensors, names: Sequence[str] | None = None) -> dict[str, RelativeSensorOptions]:
    """Return the sensors that measure the other craft, which filters go by, by name.

    Args:
        sensors: Those of a campaign.
        names: Of which ones, in this order; None: of all.
    """
    chosen: Any = {name: each for name, each in sensors.items() if each.role == "other"}
    return chosen if names is None else {name: chosen[name] for name in names}


def hosts_of(sensors: Sensors, options: SensorOptions) -> tuple[Craft, ...]:
    """Return the craft that carry a sensor; one that does not say is with the first relative sensor."""
    if options.host == "both":
        return ("chief", "deputy")
    if options.host is not None:
        return (options.host,)
    return (next((each.host for each in relative_sensors(sensors).values()), "chief"),)


def reading_names(sensors: Sensors) -> dict[str, tuple[str, Craft]]:
    """Return the names of all measurements of a campaign: of each the sensor's own name and the craft that carries it.

    A sensor that both craft may carry reads as ``chief_NAME`` and ``deputy_NAME``.
    """
    return {
        f"{host}_{name}" if options.per_craft else name: (name, host)
        for name, options in sensors.items()
        for host in hosts_of(sensors, options)
    }


def own_sensor(sensors: Sensors, role: Role, host: Craft | None = None) -> tuple[str, Any] | None:
    """Return the name and options of the sensor by which a craft knows its own orbit, attitude or force.

    None where there is none, and that is known perfectly.

    Args:
        sensors: Those of a campaign.
        role: ``orbit``, ``attitude`` or ``force``.
        host: The craft; None: any.
    """
    for name, each in sensors.items():
        if each.role == role and (host is None or host in hosts_of(sensors, each)):
            return name, each
    return None


def attitude_covariance(sensors: Sensors, chief_orbit: ChiefOrbit, host: Craft) -> Array:
    """Return the covariance (3, 3) of the white error in the attitude between a craft's body and orbit frame, rad^2.

    About the LVLH frame's axes. The star tracker turns the body, the GNSS the computed frame. Correlated parts are not
    in it: no covariance of a white noise describes them.
    """
    frame = orbit_frame_covariance(sensors, chief_orbit, host)[:3, :3]
    return body_covariance(sensors, host) + NADIR_FROM_RTN @ frame @ NADIR_FROM_RTN.T


def body_covariance(sensors: Sensors, host: Craft) -> Array:
    """Return the covariance (3, 3) of the white error of a craft's measured attitude, about the LVLH axes, rad^2."""
    attitude = own_sensor(sensors, "attitude", host)
    return np.zeros((3, 3)) if attitude is None else np.asarray(attitude[1].body_covariance())


def orbit_frame_covariance(sensors: Sensors, chief_orbit: ChiefOrbit, host: Craft) -> Array:
    """Return the covariance (6, 6) of the white error of the orbit frame that a craft computes from its own fix, RTN.

    Turn, rad, and rate error, rad/s, as `astro.frame_error` has them; zero without a receiver.
    """
    orbit = own_sensor(sensors, "orbit", host)
    if orbit is None:
        return np.zeros((6, 6))
    radius = chief_orbit.semi_major_axis_m
    covariance: Array = orbit[1].frame_covariance(radius, chief_orbit.mean_motion_rad_s * radius)
    return covariance


def frame_is_told(name: str, sensors: Sensors, step_s: float) -> bool:
    """Return whether the covariance of its host's orbit frame comes with each measurement of a sensor.

    So it is where a direction is read and the host's fixes may be missing: the frame is then the better known the
    shorter ago a fix was. Else that covariance is constant.
    """
    options = relative_sensors(sensors)[name]
    orbit = own_sensor(sensors, "orbit", options.host)
    if orbit is None or "orbit" not in options.direction_from or not any(options.needs_direction()):
        return False
    receiver: SensorOptions = orbit[1]
    every_step = steps_per_reading(receiver.period_s, step_s) == 1 and not receiver.offset_s
    return not every_step or has_outages(noise_parts(receiver.noise))
