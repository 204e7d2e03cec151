"""The sources of error of a campaign: what sensors, start and models bring in, and what no budget covers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import exp

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.budget.injection import Asked, Injection
from relnav_sim.budget.linearised import LinearFilter, in_single
from relnav_sim.budget.recursion import FixedSourceOfError, RandomSourceOfError
from relnav_sim.budget.truth_errors import TruthNumber
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, DispersedStart, FirstFixStart
from relnav_sim.sensors import frame_is_told, own_sensor, relative_sensors
from relnav_sim.sensors.campaign_sensors import reading_names
from relnav_sim.sensors.interface import Craft, SensorOptions
from relnav_sim.sensors.noise import (
    BiasNoise,
    FaultOptions,
    GaussianNoise,
    GaussMarkovNoise,
    OutageNoise,
    noise_parts,
    white_variance,
)
from relnav_sim.simulation.thrust_inputs import known_thrust

DYNAMICS = "unmodelled acceleration"
INTERACTION = "interaction of fixed sources"


def injections_of(config: CaseConfig, entry: FilterEntry, asked: Asked) -> list[Injection]:
    """Return the errors of a case that may reach a filter through its measurements, one for each number drawn.

    Args:
        config: The case.
        entry: The filter.
        asked: What its sensors draw beside the noise of their channels.
    """
    carried = reading_names(config.sensors).values()
    readers = [(name, host) for name, host in carried if _counts(config, entry, name, host)]
    found = [
        Injection(name, host, "noise", "", place)
        for name, host in readers
        for place in range(len(config.sensors[name].channels))
    ]
    return found + [one for one in asked.normal if (one.sensor, one.host) in readers]


def _counts(config: CaseConfig, entry: FilterEntry, name: str, host: Craft) -> bool:
    options = config.sensors[name]
    if options.role == "other":
        return entry.sensors is None or name in entry.sensors
    if options.role == "force":
        return known_thrust(entry, config) == "measured"
    return options.role == "attitude" or (options.role == "orbit" and not _carried(config, entry, host))


def _follows(config: CaseConfig, entry: FilterEntry, filter: LinearFilter) -> bool:
    """Return whether the errors of the chief's fixes reach the filter's own estimate of its orbit in the budget."""
    return filter.follows_chief and not _carried(config, entry, "chief")


def _carried(config: CaseConfig, entry: FilterEntry, host: Craft) -> bool:
    """Return whether an orbit filter of the host's own stands between its fixes and a filter's measurements."""
    return any(
        options.host == host and frame_is_told(name, config.sensors, config.clock.step_s)
        for name, options in relative_sensors(config.sensors, entry.sensors).items()
    )


def random_sources(
    config: CaseConfig, injections: Sequence[Injection], numbers: Sequence[TruthNumber], filter: LinearFilter
) -> list[RandomSourceOfError]:
    """Return the sources that each run draws anew and that reach the filter.

    Args:
        config: The case.
        injections: What the first columns of the filter's response are.
        numbers: What the columns behind them are.
        filter: The filter.
    """
    found = list(_drawn_start(config, filter))
    for column, one in enumerate(injections):
        if not filter.response[:, :, column].any():
            continue
        if one.draw != "noise":
            found.append(RandomSourceOfError(_named(config, one, ""), column, float(one.draw == "constant"), 1.0))
            continue
        parts = noise_parts(config.sensors[one.sensor].noise)
        if white := white_variance(parts):
            sigma = float(np.sqrt(white))
            name = _named(config, one, "noise")
            found.append(RandomSourceOfError(name, column, 0.0, sigma, None, *_size(config, one, sigma)))
        for part in parts:
            if isinstance(part, GaussMarkovNoise):
                phi = exp(-config.clock.step_s / part.tau_s)
                words = f"correlated error, {part.tau_s:g} s"
                name, size = _named(config, one, words), _size(config, one, part.scale)
                found.append(RandomSourceOfError(name, column, phi, part.scale, None, *size))
    for column, number in enumerate(numbers, start=len(injections)):
        if filter.response[:, :, column].any():
            found.append(RandomSourceOfError(number.name, column, 1.0, 1.0))
    return _apart(found)


def _drawn_start(config: CaseConfig, filter: LinearFilter) -> list[RandomSourceOfError]:
    start, n = config.start, len(filter.offset)
    if not isinstance(start, DispersedStart):
        return []
    sigmas = {"position": start.position_sigma_m, "velocity": start.velocity_sigma_m_s}
    found = []
    for place, (word, sigma) in enumerate(sigmas.items()):
        P = np.zeros((n, n))
        P[np.arange(3) + 3 * place, np.arange(3) + 3 * place] = np.square(sigma)
        if P.any():
            found.append(RandomSourceOfError(f"start {word}", None, 0.0, 0.0, P))
    return found


def fixed_sources(
    config: CaseConfig, injections: Sequence[Injection], filter: LinearFilter
) -> list[FixedSourceOfError]:
    """Return the sources that are the same in every run."""
    found = []
    biases = {name: _constants(options) for name, options in config.sensors.items()}
    for column, one in enumerate(injections):
        if one.draw == "noise" and filter.response[:, :, column].any() and (bias := biases[one.sensor][one.place]):
            name, size = _named(config, one, "bias"), _size(config, one, abs(float(bias)))
            found.append(FixedSourceOfError(name, column, float(bias), size=size[0], unit=size[1]))
    # A first fix errs in position by what its sensor's errors make of it, which are sources themselves.
    parts = {"velocity": slice(3, 6)}
    if not isinstance(config.start, FirstFixStart):
        parts = {"position": slice(0, 3), **parts}
    for word, part in parts.items():
        own = np.zeros_like(filter.offset)
        own[part] = filter.offset[part]
        if own.any():
            found.append(FixedSourceOfError(f"start {word}, the same in every run", start=own))
    found.append(FixedSourceOfError(DYNAMICS, left_out=True))
    return found


def _constants(options: SensorOptions) -> Array:
    """Return the constant errors (m,) of a sensor's channels, in its sigmas."""
    own = np.zeros(len(options.channels))
    if options.role != "force":  # accelerometers have none but those of their noise
        own = options.model_copy(update={"noise": GaussianNoise()}).constant_errors() / options.sigmas
    for part in noise_parts(options.noise):
        if isinstance(part, BiasNoise):
            own = own + np.broadcast_to(part.value, own.shape)
    return np.asarray(own)


def _size(config: CaseConfig, one: Injection, sigmas: float) -> tuple[float, str]:
    """Return the size of an error of a channel in a unit that people use, from that in sigmas of the channel."""
    options = config.sensors[one.sensor]
    if options.role == "force":  # accelerometers state their noise by the root of time
        return 1.0, "sigma"
    size, unit = sigmas * float(options.sigmas[one.place]), options.channels[one.place].unit
    return (float(np.degrees(size)), "deg") if unit == "rad" else (size, unit)


def _named(config: CaseConfig, one: Injection, words: str) -> str:
    options = config.sensors[one.sensor]
    sensor = f"{one.host} {one.sensor}" if options.per_craft else one.sensor
    if one.draw == "noise":
        return f"{sensor} {options.channels[one.place].name} {words}"
    alone = f"{sensor} {one.word}"
    return f"{alone} {one.place + 1}" if one.place else alone


def _apart(sources: list[RandomSourceOfError]) -> list[RandomSourceOfError]:
    """Return the sources with names that differ: two correlated parts may have one time constant."""
    seen: dict[str, int] = {}
    found = []
    for one in sources:
        seen[one.name] = seen.get(one.name, 0) + 1
        found.append(one if seen[one.name] == 1 else replace(one, name=f"{one.name} ({seen[one.name]})"))
    return found


def not_covered(
    config: CaseConfig, entry: FilterEntry, filter: LinearFilter, chances: Sequence[tuple[str, str]]
) -> list[str]:
    """Return in words which sources of a case are in no budget of a filter.

    Args:
        config: The case.
        entry: The filter.
        filter: The same to first order.
        chances: What sensors draw beside normal numbers: the sensor's name and the word.
    """
    found = []
    sensors = {name: each for name, each in config.sensors.items() if each.role != "other"}
    sensors |= relative_sensors(config.sensors, entry.sensors)
    for name, options in sensors.items():
        if any(isinstance(part, OutageNoise) and part.rate_per_hour for part in noise_parts(options.noise)):
            found.append(f"random outages of {name}: its measurements count as there")
        faults = [part.stream for part in noise_parts(options.noise) if isinstance(part, FaultOptions)]
        if faults:
            found.append(f"faults of {name}: {', '.join(faults)}")
        found += [f"{word} of {name}, which comes and goes by chance" for one, word in chances if one == name]
        if getattr(options, "latency_s", 0) and entry.assumed_latency == "none":
            found.append(f"the latency of {name}, of which the filter is not told")
        if getattr(options, "drawn_latency_s", None) is not None:
            found.append(f"the drawn latency of {name}: its measurements count as there at once")
    for host in sorted({each.host for each in relative_sensors(config.sensors, entry.sensors).values()}):
        fixes = own_sensor(config.sensors, "orbit", host)
        if fixes is not None and _carried(config, entry, host):
            found.append(f"errors of {fixes[0]} on the {host}, which its own orbit filter carries over missing fixes")
    chief = own_sensor(config.sensors, "orbit", "chief")
    if chief is not None and "chief_fixes" in entry.dynamics.needs and not _follows(config, entry, filter):
        found.append(f"errors of {chief[0]} in the orbit about which the filter predicts")
    if entry.editing is not None or getattr(entry, "gate_probability", None) is not None:
        found.append("measurements that the gate rejects")
    if in_single(entry):
        found.append("rounding in float32: the filter counts as one in float64")
    return found
