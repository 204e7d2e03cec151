"""What a user should know of a campaign's geometry before its numbers: one list of plain sentences.

Shown by `validate` and `run`, from the nominal trajectory, and by the report, from the truth that was flown.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from relnav_sim.arrays import Array
from relnav_sim.campaign.afterwards import untested_residuals
from relnav_sim.campaign.editing_checks import editing_warnings
from relnav_sim.campaign.file_model import sensors_from
from relnav_sim.campaign.idle_options import idle_options, late_windows
from relnav_sim.campaign.implausible import implausible_values
from relnav_sim.campaign.load import Campaign
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.campaign.paths import parse_path, replaced
from relnav_sim.recorded import EphemerisError
from relnav_sim.sensors import Sensors, reading_probability, relative_sensors, sight_warnings
from relnav_sim.sensors.due import steps_per_reading
from relnav_sim.streams import RandomSource
from relnav_sim.truth import (
    AnyTruth,
    EphemerisTruthOptions,
    Truth,
    TruthSection,
    eci_from_rtn,
    nominal_truth,
    rough_truth,
    start_warnings,
    truth_trajectory,
)
from relnav_sim.truth.flown_orbits import flown, interpolation_warnings
from relnav_sim.truth.thrust import CRAFT
from relnav_sim.truth.trajectory import force_model

MOST_GEOMETRIES = 12
"""Different trajectories and radars of a campaign that are looked at: each takes a propagation of two craft."""
MOST_EPOCHS = 20_000
"""Epochs of a trajectory that are looked at, spread over the run."""
ROUGH = 1e-9
"""Relative error of such a trajectory: centimetres change nothing in what a sensor sees."""
_LABEL_SHOWN = 120
_SHARED_TRUTHS = 64  # kept at a time
_NOT_LOOKED_AT = (
    "The geometry was not looked at: the result was made by another version of relnav, or a file that it names "
    "is not there or has changed."
)


def campaign_warnings(campaign: Campaign) -> tuple[str, ...]:
    """Return what to know of a campaign before it runs, from the nominal trajectory of each case."""
    found: dict[str, list[str]] = {}
    said: list[tuple[str, list[str]]] = []
    for case in campaign.cases:
        config = case.config
        key = "".join(
            part.model_dump_json() for part in (config.clock, config.truth, *config.sensors.values(), config.start)
        ) + json.dumps(_sensors_of(config))
        if key not in found and len(found) < MOST_GEOMETRIES:
            found[key] = _nominal_warnings(config)
        if key in found:
            untested = untested_residuals(config.filters) if config.statistics.whiteness else []
            known = [*idle_options(config), *editing_warnings(config.filters), *untested]
            said.append((case.label, [*known, *found[key]]))
    unseen = len(campaign.cases) - len(said)
    rest = [f"The geometry of {unseen} more cases was not looked at; the report looks at all."] if unseen else []
    return (*implausible_values(campaign.content), *together(said), *_late_under_stress(campaign), *rest)


def _late_under_stress(campaign: Campaign) -> list[str]:
    """Return the windows after the end of stressed cases that are not among the campaign's cases."""
    known = {sentence for case in campaign.nominal_cases for sentence in late_windows(case.config)}
    return [
        f"In case {case.label}: {sentence}"
        for case in campaign.stressed
        if case not in campaign.cases
        for sentence in late_windows(case.config)
        if sentence not in known
    ]


def flown_warnings(
    content: Mapping[str, Any],
    cases: Iterable[tuple[str, Mapping[str, Any], Array, Array, Mapping[str, Sequence[str]]]],
) -> tuple[str, ...]:
    """Return the same of a campaign that was run, from the truth that was stored.

    Args:
        content: The campaign's content, as `Campaign.content`.
        cases: Of each case label, values of the varied paths, stored epochs (K,) in s, true states of the deputy
            relative to the chief (runs or 1, K, 6), RTN, m and m/s, and the sensors that each filter names; none: it
            goes by all.
    """
    said: list[tuple[str, list[str]]] = []
    if not {"truth", "sensors"} <= content.keys():
        return ()
    adapter: TypeAdapter[AnyTruth] = TypeAdapter(TruthSection)

    # Cases that differ in their sensors alone share their truth, and where the chief flies.
    @functools.lru_cache(maxsize=_SHARED_TRUTHS)
    def truth_of(section: str) -> AnyTruth:
        return adapter.validate_json(section)

    @functools.lru_cache(maxsize=_SHARED_TRUTHS)
    def flight(section: str, epochs: tuple[float, ...], end_s: float) -> Truth:
        nominal = nominal_truth(truth_of(section))
        return truth_trajectory(nominal, end_s, RandomSource(0, (0,))).at(np.array(epochs))

    for label, variables, times_s, relative, filters in cases:
        varied: Any = {key: content[key] for key in ("truth", "sensors")}
        for text, value in variables.items():
            if text.partition(".")[0] in varied:
                varied = replaced(varied, parse_path(text, varied), value)
        try:
            section = json.dumps(varied["truth"])
            truth = truth_of(section)
            sensors = sensors_from(varied["sensors"])
        except ValidationError:
            said.append((label, [_NOT_LOOKED_AT]))
            continue
        every = tuple(relative_sensors(sensors))
        going_by = {name: tuple(each for each in every if each in named) or every for name, named in filters.items()}
        try:
            states = _flown(truth, sensors, times_s, relative, partial(flight, section))
        except EphemerisError as error:
            said.append((label, [f"The geometry was not looked at: {error}."]))
            continue
        said.append((label, sight_warnings(sensors, states, going_by)))
    return together(said)


def _nominal_warnings(config: CaseConfig) -> list[str]:
    clock, relative = config.clock, relative_sensors(config.sensors)
    every = min((steps_per_reading(each.period_s, clock.step_s) for each in relative.values()), default=1)
    every *= -(-clock.epochs // (every * MOST_EPOCHS))
    trajectory = truth_trajectory(rough_truth(config.truth), clock.duration_s, RandomSource(0, (0,)), ROUGH)
    at_start = trajectory.at([0.0])
    truth = trajectory.at(np.arange(0, clock.epochs, every) * clock.step_s)
    ended = [
        f"In the nominal trajectory {reason}; every run ends about then." for reason in trajectory.failures.values()
    ]
    sentences = sight_warnings(config.sensors, truth, _sensors_of(config))
    giving = [name for name, each in relative.items() if each.gives_fix]
    if isinstance(config.start, FirstFixStart) and giving:
        chance = reading_probability(config.sensors, giving[0], at_start, 0, clock.step_s)
        if not chance.all(axis=-1).any():
            sentences.append(
                f"The {giving[0]} gives no position at 0 s, where start.kind first_fix needs one: every run would "
                "fail; take start.kind dispersed or given."
            )
    starts = (
        _orbit_warnings(config) if isinstance(config.truth, EphemerisTruthOptions) else start_warnings(config.truth)
    )
    return [*starts, *ended, *sentences]


def _orbit_warnings(config: CaseConfig) -> list[str]:
    truth = config.truth
    assert isinstance(truth, EphemerisTruthOptions)
    return interpolation_warnings(
        flown(truth.ephemeris, craft, truth.start_epoch, config.clock.duration_s, truth.orientation) for craft in CRAFT
    )


def _sensors_of(config: CaseConfig) -> dict[str, tuple[str, ...]]:
    """Return the sensors that each filter of a case goes by."""
    return {name: tuple(relative_sensors(config.sensors, each.sensors)) for name, each in config.filters.items()}


def _flown(
    options: AnyTruth,
    sensors: Sensors,
    times_s: Array,
    relative: Array,
    flight: Callable[[tuple[float, ...], float], Truth],
) -> Truth:
    """Return the true states of both craft, from the relative ones and the nominal chief.

    A radar on the chief sees the relative position in axes that turn with the chief: where the chief is does not
    matter then, and it may stay where it starts. A radar on the deputy turns with the deputy's own orbit.

    Raises:
        EphemerisError: The file of a recorded orbit can't be read, or is not what it was.
    """
    end_s = float(times_s[-1])
    if isinstance(options, EphemerisTruthOptions):
        return flight(tuple(times_s), end_s)
    alone = all(each.host == "chief" for each in relative_sensors(sensors).values())
    chief = flight(tuple(times_s[:1] if alone else times_s), end_s).chief
    chief = np.broadcast_to(chief, (*relative.shape[:2], 6))
    deputy = eci_from_rtn(chief, relative, force_model(options).normal_acceleration(chief, 0.0, times_s))
    return Truth(times_s, chief, deputy, relative)


def together(said: Sequence[tuple[str, Sequence[str]]]) -> tuple[str, ...]:
    """Return the sentences of all cases, each once, with the cases it holds for where these are not all."""
    holds: dict[str, list[int]] = {}
    for number, (_, sentences) in enumerate(said):
        for sentence in sentences:
            holds.setdefault(sentence, []).append(number)
    return tuple(
        sentence if len(cases) == len(said) else f"{_cases([said[i][0] for i in cases], len(said))}: {sentence}"
        for sentence, cases in holds.items()
    )


def _cases(labels: Sequence[str], total: int) -> str:
    first = labels[0] if len(labels[0]) <= _LABEL_SHOWN else f"{labels[0][:_LABEL_SHOWN]}..."
    which = f"case {first}" if len(labels) == 1 else f"{len(labels)} of {total} cases, as {first}"
    return f"In {which}"
