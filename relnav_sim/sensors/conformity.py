"""Whether a sensor keeps to its protocol: shapes of what it returns, tried on a chunk of three epochs and two runs."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.containment import Containment
from relnav_sim.printable import message_of
from relnav_sim.sensors.campaign_sensors import Sensors, hosts_of
from relnav_sim.sensors.host_frame import HostFrame
from relnav_sim.sensors.interface import Craft, MeasurementContext, RelativeSensorOptions, Sensed, SensorOptions
from relnav_sim.sensors.suite import streams_of
from relnav_sim.streams import RandomSource

_RUNS, _EPOCHS = 2, 3
_ORBIT = ChiefOrbit(7.0e6, 0.0, 0.0, 0.0, 0.0, 0.0, 3.986004418e14, 6378137.0, 0.0)


class TriedSensors:
    """Tries the sensors of many cases: each once, and of those that differ in their numbers alone the first few."""

    MOST_ALIKE = 50

    def __init__(self) -> None:
        self._found: dict[tuple[str, int, Craft, float], tuple[SensorOptions, list[str]]] = {}
        self._alike: Counter[str] = Counter()

    def complaints(self, name: str, sensors: Sensors, step_s: float) -> list[str]:
        """Return what a sensor does not keep to, see `complaints`; nothing where enough like it have been tried."""
        options = sensors[name]
        key = (name, id(options), hosts_of(sensors, options)[0], step_s)
        if key not in self._found:
            shape = json.dumps([name, key[2], _without_numbers(options.model_dump(mode="json"))])
            self._alike[shape] += 1
            found = list(complaints(name, sensors, step_s)) if self._alike[shape] <= self.MOST_ALIKE else []
            self._found[key] = options, found  # the options too, so that their id stays their own
        return self._found[key][1]


def _without_numbers(data: Any) -> Any:
    """Return plain data in which a number is only zero or not."""
    if isinstance(data, dict):
        return {key: _without_numbers(value) for key, value in data.items()}
    if isinstance(data, list):
        return [_without_numbers(value) for value in data]
    return data != 0 if isinstance(data, int | float) and not isinstance(data, bool) else data


def complaints(name: str, sensors: Sensors, step_s: float) -> Iterator[str]:
    """Yield in a sentence each what a sensor does not keep to, with what is expected and what was found.

    Args:
        name: The sensor's name in the campaign.
        sensors: All sensors of the campaign.
        step_s: Time between epochs, s.
    """
    options = sensors[name]
    found: list[str] = []
    with Containment() as contained:  # it may be another package's
        found += _readings(name, options, hosts_of(sensors, options)[0], step_s)
    yield from found
    if contained.error is not None:
        yield f"the {options.kind} sensor raises {message_of(contained.error)}"


def _readings(name: str, options: SensorOptions, host: Craft, step_s: float) -> Iterator[str]:
    m = len(options.reading)
    streams = streams_of(name, options, host, RandomSource(0, tuple(range(_RUNS))), step_s)
    sensed = _sensed(host, step_s)
    z = np.asarray(options.sample(sensed, streams))
    if z.shape != (_RUNS, _EPOCHS, m):
        yield _shape(options, "sample", z, f"(runs, K, {m}), here {(_RUNS, _EPOCHS, m)}, for its channels")
    elif isinstance(options, RelativeSensorOptions):
        yield from _reached(options, sensed)
        yield from _told(options, z, HostFrame(sensed.host), step_s)


def _reached(options: RelativeSensorOptions, sensed: Sensed) -> Iterator[str]:
    """Yield what is wrong with where the other craft can be measured, and with which channels need a direction."""
    m, run_wide = len(options.channels), ((_RUNS, _EPOCHS), (1, _EPOCHS))
    distance = np.full((_RUNS, _EPOCHS), _AWAY_M)
    checks = (
        ("needs_direction", options.needs_direction(), ((m,),)),
        ("in_reach", options.in_reach(sensed), run_wide),
        ("off_pole", options.off_pole(sensed), run_wide),
        ("no_echo", options.no_echo(distance), ((_RUNS, _EPOCHS),)),
    )
    for what, found, shapes in checks:
        if found is not None and np.shape(found) not in shapes:
            yield _shape(options, what, np.asarray(found), " or ".join(map(str, shapes)))


def _told(options: RelativeSensorOptions, z: Array, frame: HostFrame, step_s: float) -> Iterator[str]:
    """Yield what is wrong with what filters are told."""
    inputs = options.inputs(z, frame)
    states = np.zeros((_RUNS, 6))
    states[:, 1] = _AWAY_M
    if options.forms[0] not in inputs:
        yield f"inputs of the {options.kind} sensor returned no {options.forms[0]!r}, the usual form"
    for form in options.forms:
        if form not in inputs:
            continue
        model = options.measurement(MeasurementContext(_ORBIT, np.zeros((3, 3)), "total", form, step_s))
        m = model.dimension
        if np.shape(inputs[form]) != (_RUNS, _EPOCHS, m):
            expected = f"(runs, K, {m}), here {(_RUNS, _EPOCHS, m)}, for its measurement"
            yield _shape(options, f"inputs[{form!r}]", inputs[form], expected)
        checks = (
            ("predict", np.asarray(model.predict(states, 0)), ((_RUNS, m),)),
            ("jacobian", np.asarray(model.jacobian(states, 0)), ((_RUNS, m, 6), (m, 6))),
            ("noise", np.asarray(model.noise(states, 0)), ((_RUNS, m, m), (m, m))),
        )
        for what, found, shapes in checks:
            if found.shape not in shapes:
                yield _shape(options, f"measurement().{what}", found, " or ".join(map(str, shapes)))
    if options.gives_fix and options.forms[0] in inputs:
        context = MeasurementContext(_ORBIT, np.zeros((3, 3)), "nominal", options.forms[0], step_s)
        yield from _fix(options, options.first_fix(options.measurement(context), inputs[options.forms[0]][:, 0]))


def _fix(options: RelativeSensorOptions, fix: object) -> Iterator[str]:
    """Yield what is wrong with a first fix of a sensor that says that it gives one."""
    if not isinstance(fix, tuple) or len(fix) != 2:
        yield f"first_fix of the {options.kind} sensor returned no pair of position and covariance"
        return
    for what, found, shape in zip(("position", "covariance"), fix, ((_RUNS, 3), (_RUNS, 3, 3)), strict=True):
        if np.shape(found) != shape:
            yield _shape(options, f"first_fix's {what}", found, str(shape))


_AWAY_M = 100.0


def _shape(options: SensorOptions, what: str, found: Array, expected: str) -> str:
    return f"{what} of the {options.kind} sensor returned shape {np.shape(found)}; expected {expected}"


def _sensed(host: Craft, step_s: float) -> Sensed:
    """Return two craft on a circular orbit, the deputy ahead."""
    times_s = np.arange(_EPOCHS, dtype=float) * step_s
    speed, radius = _ORBIT.mean_motion_rad_s * _ORBIT.semi_major_axis_m, _ORBIT.semi_major_axis_m
    angle = _ORBIT.mean_motion_rad_s * times_s
    craft = []
    for ahead in (0.0, _AWAY_M / radius):
        c, s, zero = np.cos(angle + ahead), np.sin(angle + ahead), np.zeros(_EPOCHS)
        craft.append(np.stack([radius * c, radius * s, zero, -speed * s, speed * c, zero], axis=-1)[None])
    chief, deputy = craft
    states = (chief, deputy) if host == "chief" else (deputy, chief)
    return Sensed(times_s, *states, np.zeros((1, _EPOCHS, 2, 3)), step_s)
