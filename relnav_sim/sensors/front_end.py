"""From raw measurements to what a filter takes, and the sensor as that filter is told of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.nominal_motion import moved_on
from relnav_sim.measurements.delayed import Delayed
from relnav_sim.measurements.frame_error import FrameError
from relnav_sim.measurements.interface import Measurement
from relnav_sim.sensors.campaign_sensors import (
    Sensors,
    attitude_covariance,
    body_covariance,
    frame_is_told,
    orbit_frame_covariance,
    own_sensor,
    relative_sensors,
)
from relnav_sim.sensors.host_frame import HostFrame, HostOrbit
from relnav_sim.sensors.interface import (
    AssumedNoise,
    Craft,
    Form,
    MeasurementContext,
    RelativeSensorOptions,
)
from relnav_sim.sensors.suite import TrueStates

Frame = Literal["of_a_fix", "told", "perfect"]


def filter_inputs(
    sensors: Sensors,
    readings: Mapping[str, Array],
    truth: TrueStates | None = None,
    gravity: Gravity | None = None,
    orbits: Mapping[Craft, HostOrbit] | None = None,
    late: Mapping[str, Array] | None = None,
) -> dict[str, dict[Form, Array]]:
    """Return what the filters take, made from the sensors' own measured values, by sensor and form, (runs, K, m).

    Args:
        sensors: The sensors of the campaign.
        readings: What `SensorSuite.measure` returned.
        truth: True states of the same epochs; needed with one of GNSS and star tracker alone, whose other link of the
            chain is then perfect.
        gravity: What the craft know of gravity; None: a point mass.
        orbits: What hosts know of their orbits between their fixes; a host that is not there knows it at them only.
        late: By sensor, how long before its epoch each measurement was taken, (runs, K), s, on top of the sensor's
            latency.

    Raises:
        ValueError: The truth is needed and missing.
    """
    frames: dict[Craft, HostFrame] = {}
    inputs = {}
    known = {host: orbit.states for host, orbit in (orbits or {}).items()}
    for name, options in relative_sensors(sensors).items():
        if options.host not in frames:
            frames[options.host] = _frame(sensors, readings, truth, options.host, gravity, known)
        frame = frames[options.host]
        if late and name in late:
            frame = replace(frame, late_s=late[name])
        inputs[name] = options.inputs(readings[name], frame)
    return inputs


def _frame(
    sensors: Sensors,
    readings: Mapping[str, Array],
    truth: TrueStates | None,
    host: Craft,
    gravity: Gravity | None,
    known: Mapping[Craft, Array],
) -> HostFrame:
    orbit, attitude = own_sensor(sensors, "orbit", host), own_sensor(sensors, "attitude", host)
    return HostFrame(
        None if truth is None else truth.chief if host == "chief" else truth.deputy,
        None if orbit is None else known.get(host, readings[orbit[0]]),
        None if attitude is None else readings[attitude[0]],
        gravity,
    )


def form_taken(options: RelativeSensorOptions, wanted: Form) -> Form:
    """Return the form in which a filter takes a sensor's measurements: the one that it wants, or the usual one."""
    return wanted if wanted in options.forms else options.forms[0]


def sensor_measurement(
    name: str,
    sensors: Sensors,
    orbit: ChiefOrbit,
    step_s: float,
    form: Form = "spherical",
    assumed_noise: AssumedNoise = "total",
    assumed_latency: Literal["known", "none"] = "known",
    frame: Frame = "of_a_fix",
    own_latencies: bool = False,
) -> Measurement:
    """Return a sensor as a filter is told of it, for the inputs of the same form that `filter_inputs` makes.

    With a latency that the filter knows, it is the sensor at the state that long ago.

    Args:
        name: The sensor's name.
        sensors: All sensors of the campaign.
        orbit: The chief's nominal orbit, with the harmonics that count.
        step_s: Time between epochs, s.
        form: The form of the measurements; the sensor's usual one where it has no such form.
        assumed_noise: ``nominal``: the noise without its outliers; ``total``: its covariance, the default of campaigns;
            ``mixture``: the components too. A drawn fraction counts as 1/2. Biases, correlated parts and outages are
            never told.
        assumed_latency: ``known`` or ``none``.
        frame: How the host's orbit frame errs, where `frame_is_told`: as ``of_a_fix``; as ``told`` with each
            measurement, whose covariance is behind it by `with_frame`; or as a ``perfect`` one. Elsewhere always as of
            a fix.
        own_latencies: Whether each measurement comes with a latency of its own behind it by `with_latency`, which the
            filter knows in any case.

    Raises:
        ValueError: The sensor has no such form.
    """
    options = relative_sensors(sensors)[name]
    if frame == "of_a_fix" or not frame_is_told(name, sensors, step_s):
        frame = "of_a_fix"
        errors = attitude_covariance(sensors, orbit, options.host), orbit_frame_covariance(sensors, orbit, options.host)
    else:
        errors = body_covariance(sensors, options.host), np.zeros((6, 6))
    latency_s = 0.0 if assumed_latency == "none" else options.latency_s
    # Only in the deputy's frame does it matter where the chief was when the measurement was taken.
    taken_at = moved_on(orbit, -latency_s) if options.host == "deputy" else orbit
    context = MeasurementContext(taken_at, errors[0], assumed_noise, form_taken(options, form), step_s, errors[1])
    model = options.measurement(context)
    if frame == "told":
        model = FrameError(model)
    return Delayed(model, latency_s, told=own_latencies) if latency_s or own_latencies else model
