"""From raw readings to what a filter takes: the chain radar frame -> body -> inertial -> orbit frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from relnav_sim.astro.attitude import body_to_inertial, from_axes, in_axes, nadir_axes
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, Vector, half_open, polar, rotate, rows, sight_vector
from relnav_sim.measurements.converted_radar import ConvertedRadar, conversion
from relnav_sim.measurements.delayed import Delayed
from relnav_sim.measurements.spherical_radar import Assumed, PolarRadar, RadarNoise
from relnav_sim.sensors.noise import noise_parts, white_law, white_variance
from relnav_sim.sensors.options import SensorsOptions
from relnav_sim.sensors.radar import CHANNELS
from relnav_sim.sensors.suite import TrueStates, carrier_and_other

Array = NDArray[np.float64]
_RTN_FROM_NADIR = rows(NADIR_FROM_RTN.T)


def filter_inputs(
    sensors: SensorsOptions, readings: Mapping[str, Array], truth: TrueStates | None = None
) -> dict[str, Array]:
    """Return what the filters take, made from the sensors' own measured values.

    The line of sight goes from the radar frame to the body by the mounting, to ECI by the measured attitude, and to
    the orbit frame that the measured orbit gives. With neither GNSS nor star tracker the attitude is perfect and the
    chain is left out; with one of them the other link is perfect and comes from the truth.

    Args:
        sensors: The sensors; their noise decides the shrinkage that the Cartesian conversion corrects.
        readings: What `SensorSuite.measure` returned.
        truth: True states of the same epochs; needed with one of GNSS and star tracker alone.

    Returns:
        ``polar``: range (m), azimuth and elevation (rad, in (-pi, pi]) in the radar frame as mounted in the estimated
        orbit frame, (runs, K, 3). ``cartesian``, with the radar on the chief: the deputy's position relative to it,
        RTN (m), (runs, K, 3), unbiased. NaN where a reading on the way is missing. Empty without a radar.

    Raises:
        ValueError: The truth is needed and missing.
    """
    radar = sensors.radar
    if radar is None:
        return {}
    body_to_orbit = _body_to_orbit(sensors, readings, truth)
    radar_from_body, body_from_radar = rows(radar.mounting), rows(radar.mounting.T)
    z = readings["radar"]
    distance = z[..., 0]
    sight = sight_vector(distance, z[..., 1], z[..., 2])
    inputs = {"polar": z}
    if body_to_orbit is not None:
        seen = rotate(radar_from_body, body_to_orbit(rotate(body_from_radar, sight)))
        _, azimuth, elevation = polar(seen)
        known = np.where(np.isnan(azimuth), np.nan, distance)  # no direction, no measurement: the whole row is NaN
        inputs["polar"] = np.stack([known, half_open(azimuth), elevation], axis=-1)
    if radar.carrier == "chief":
        law = white_law(noise_parts(radar.noise), CHANNELS)
        shrinkage = conversion(law.weights, law.scales * radar.sigmas)
        unbiased = (sight[0] / shrinkage.level, sight[1] / shrinkage.level, sight[2] / shrinkage.height)
        body = rotate(body_from_radar, unbiased)
        nadir = body if body_to_orbit is None else body_to_orbit(body)
        inputs["cartesian"] = np.stack(rotate(_RTN_FROM_NADIR, nadir), axis=-1)
    return inputs


def _body_to_orbit(
    sensors: SensorsOptions, readings: Mapping[str, Array], truth: TrueStates | None
) -> Callable[[Vector], Vector] | None:
    """Return the way from body to estimated nadir frame, or None where both are the same."""
    if sensors.gnss is None and sensors.star_tracker is None:
        return None
    if sensors.gnss is not None and sensors.star_tracker is not None:
        orbit_axes = body_axes = nadir_axes(readings["gnss"])
    elif truth is None:
        raise ValueError("with GNSS or star tracker alone the other link of the chain needs the truth")
    else:
        body_axes = nadir_axes(carrier_and_other(sensors, truth)[0])
        orbit_axes = body_axes if sensors.gnss is None else nadir_axes(readings["gnss"])
    if sensors.star_tracker is None:
        return lambda body: in_axes(orbit_axes, from_axes(body_axes, body))
    x, y, z, w = np.moveaxis(readings["star_tracker"], -1, 0)
    return lambda body: in_axes(orbit_axes, body_to_inertial((x, y, z, w), body))


def attitude_covariance(sensors: SensorsOptions, chief_orbit: ChiefOrbit) -> Array:
    """Return the covariance (3, 3) of the white error in the attitude between body and orbit frame, rad^2.

    About the nadir frame's axes. The star tracker turns the body. The GNSS tilts the computed frame: for a position
    error dr and a velocity error dv it turns by (dr_y / r, -dr_x / r, dv_y / v), on a near-circular orbit. Correlated
    parts are not in it: no covariance of a white noise describes them.
    """
    P = np.zeros((3, 3))
    tracker, gnss = sensors.star_tracker, sensors.gnss
    if tracker is not None:
        P += (tracker.axes * np.square(tracker.sigmas)) @ tracker.axes.T * white_variance(noise_parts(tracker.noise))
    if gnss is not None:
        radius = chief_orbit.semi_major_axis_m
        tilt, yaw = gnss.position_sigma_m / radius, gnss.velocity_sigma_m_s / (chief_orbit.mean_motion_rad_s * radius)
        P += np.diag(np.square([tilt, tilt, yaw])) * white_variance(noise_parts(gnss.noise))
    return P


def measurement_model(
    kind: Literal["polar", "cartesian"],
    assumed: Assumed,
    sensors: SensorsOptions,
    chief_orbit: ChiefOrbit,
    assumed_latency: Literal["known", "none"] = "known",
) -> PolarRadar | ConvertedRadar | Delayed:
    """Return the radar as a filter is told of it, for the inputs of the same name that `filter_inputs` makes.

    With a latency that the filter knows, it is the radar at the state that long ago.
    """
    model = radar_model(kind, assumed, sensors, chief_orbit)
    latency_s = 0.0 if sensors.radar is None or assumed_latency == "none" else sensors.radar.latency_s
    return Delayed(model, latency_s) if latency_s else model


def radar_model(
    kind: Literal["polar", "cartesian"], assumed: Assumed, sensors: SensorsOptions, chief_orbit: ChiefOrbit
) -> PolarRadar | ConvertedRadar:
    """Return the radar as a filter is told of it, but for its latency.

    Args:
        kind: ``polar`` or ``cartesian``.
        assumed: ``nominal``: the radar's noise without its outliers; ``total``: its covariance, the default of
            campaigns; ``mixture``: the components too. A drawn fraction counts as 1/2. Biases, correlated parts and
            outages are never told.
        sensors: The sensors.
        chief_orbit: The chief's nominal orbit.

    Raises:
        ValueError: There is no radar, or it is on the deputy and the Cartesian form is wanted.
    """
    radar = sensors.radar
    if radar is None:
        raise ValueError("the filters have nothing to go by: give the radar")
    law = white_law(noise_parts(radar.noise), CHANNELS)
    mounting = radar.mounting
    noise = RadarNoise(
        weights=law.weights,
        deviations=law.scales * radar.sigmas,
        nominal=law.nominal * radar.sigmas,
        attitude=mounting @ attitude_covariance(sensors, chief_orbit) @ mounting.T,
        assumed=assumed,
    )
    if kind == "polar":
        return PolarRadar(mounting, noise, radar.carrier, chief_orbit)
    if radar.carrier == "deputy":
        raise ValueError(
            "a radar on the deputy gives no Cartesian measurement: its orbit frame turns with the state; take polar"
        )
    return ConvertedRadar(mounting, noise)
