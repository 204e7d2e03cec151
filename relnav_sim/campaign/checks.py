"""What must fit together across the sections of a case, beyond what each section checks by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import Clock, FirstFixStart, StatisticsOptions, exact
from relnav_sim.campaign.problems import Path, Problem
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.options import Options
from relnav_sim.sensors import SensorsOptions
from relnav_sim.truth import TruthOptions

MOST_EPOCHS = 10_000_000
LINEAR_ONLY = frozenset({"kf"})
"""Filters whose measurement must be linear in the state."""
RESERVED_NAMES = frozenset({"trajectory", "time", "component", "quantity", "truth", "bound", "failures"})
"""Names that stand beside the filters' in a results file."""


@dataclass(frozen=True)
class Parts:
    """The parts of a case that are valid by themselves."""

    clock: Clock | None = None
    truth: TruthOptions | None = None
    sensors: SensorsOptions | None = None
    start: Options | None = None
    statistics: StatisticsOptions | None = None
    filters: Mapping[str, FilterEntry] = field(default_factory=dict)


def check_together(parts: Parts) -> Iterator[Problem]:
    """Yield what does not fit together; a part that is missing or wrong is left out of the checks."""
    if parts.clock is not None:
        yield from _check_clock(parts.clock)
        if parts.sensors is not None:
            yield from _check_periods(parts.sensors, parts.clock, ("sensors",))
        if parts.statistics is not None and parts.statistics.settle_s >= parts.clock.duration_s:
            yield Problem(
                ("statistics", "settle_s"),
                f"{parts.statistics.settle_s:g} s leaves nothing of a run of {parts.clock.duration_s:g} s",
            )
        if parts.truth is not None:
            yield from _check_manoeuvres(parts.truth, parts.clock)
    radar = parts.sensors.radar if parts.sensors is not None else None
    if parts.sensors is not None and radar is None:
        yield Problem(("sensors", "radar"), "the filters have nothing to go by: give the radar")
    if radar is not None and radar.latency_s and isinstance(parts.start, FirstFixStart):
        yield Problem(
            ("sensors", "radar", "latency_s"),
            f"the first reading comes {radar.latency_s:g} s after the start, so there is no fix to start from; "
            "take start.kind dispersed or given",
        )
    for name, entry in parts.filters.items():
        if entry.known_thrust == "measured" and parts.sensors is not None and parts.sensors.accelerometer is None:
            yield Problem(
                ("filters", name, "known_thrust"), "nothing measures the thrust: give sensors.accelerometer, or planned"
            )
        if name in RESERVED_NAMES:
            yield Problem(("filters", name), f"{name!r} has a meaning of its own in results files; take another name")
        yield from _check_considered(name, entry)
        if parts.sensors is not None:
            yield from _check_accelerometer_bias(name, entry, parts.sensors)
        if filter_kinds()[entry.kind].learned_dynamics and "training_track" not in entry.dynamics.needs:
            learned = [kind for kind, options in dynamics_kinds().items() if "training_track" in options.needs]
            yield Problem(
                ("filters", name, "dynamics"),
                f"the {entry.kind} filter needs learned dynamics: {' or '.join(learned)} (or leave this key out)",
            )
        if entry.kind in LINEAR_ONLY and entry.measurement != "cartesian":
            yield Problem(
                ("filters", name, "measurement"),
                f"the {entry.kind} filter needs a linear measurement: cartesian (or leave this key out)",
            )
        elif entry.measurement == "cartesian" and radar is not None and radar.carrier == "deputy":
            yield Problem(
                ("filters", name, "measurement"),
                "cartesian needs the radar on the chief: a deputy's orbit frame turns with the state",
            )


def _check_considered(name: str, entry: FilterEntry) -> Iterator[Problem]:
    """Yield the extra states that the filter is to account for without estimating them, where it can't."""
    if filter_kinds()[entry.kind].considers:
        return
    for place, option in enumerate(entry.augment):
        if option.mode == "consider":
            yield Problem(
                ("filters", name, "augment", place, "mode"),
                f"the {entry.kind} filter can't account for a state without estimating it, which takes a gain whose "
                "rows can be left out; take estimate",
            )


def _check_manoeuvres(truth: TruthOptions, clock: Clock) -> Iterator[Problem]:
    for name, manoeuvre in truth.manoeuvres.items():
        if manoeuvre.time_s >= clock.duration_s:
            begins = "happens" if manoeuvre.duration_s is None else "begins"
            yield Problem(
                ("truth", "manoeuvres", name, "time_s"),
                f"{begins} at {manoeuvre.time_s:g} s; the run ends at {clock.duration_s:g} s",
            )
        elif manoeuvre.end_s > clock.duration_s:
            yield Problem(
                ("truth", "manoeuvres", name, "duration_s"),
                f"the burn ends at {manoeuvre.end_s:g} s, the run at {clock.duration_s:g} s",
            )


def _check_accelerometer_bias(name: str, entry: FilterEntry, sensors: SensorsOptions) -> Iterator[Problem]:
    """Yield where the filter is to carry a bias that nothing it is told of has, or that comes and goes by halves."""
    options = sensors.accelerometer
    for place, extra in enumerate(entry.augment):
        if extra.kind != "accelerometer_bias":
            continue
        path: Path = ("filters", name, "augment", place)
        if options is None or entry.known_thrust in ("none", "planned"):
            yield Problem(path, "the filter is told of no measured thrust: give sensors.accelerometer and measured")
        elif options.deadband_m_s2 > 0 and options.carrier == "both":
            yield Problem(
                path,
                "with a deadband the biases of two accelerometers come and go by themselves; set the deadband to 0",
            )


def _check_clock(clock: Clock) -> Iterator[Problem]:
    yield from _check_multiple(clock.duration_s, clock.step_s, ("clock", "duration_s"))
    yield from _check_multiple(clock.store_every_s, clock.step_s, ("clock", "store_every_s"))
    if clock.epochs > MOST_EPOCHS:
        yield Problem(("clock", "step_s"), f"makes {clock.epochs - 1} steps a run; at most {MOST_EPOCHS} are computed")
    if clock.store_every_s > clock.duration_s:
        yield Problem(
            ("clock", "store_every_s"),
            f"{clock.store_every_s:g} s is longer than the run of {clock.duration_s:g} s",
        )


def _check_periods(options: Options, clock: Clock, path: Path) -> Iterator[Problem]:
    """Yield the sampling periods that are no whole number of steps."""
    for key in type(options).model_fields:
        value = getattr(options, key)
        if isinstance(value, Options):
            yield from _check_periods(value, clock, (*path, key))
        elif key == "period_s" and isinstance(value, float):
            yield from _check_multiple(value, clock.step_s, (*path, key))


def _check_multiple(value: float, step_s: float, path: Path) -> Iterator[Problem]:
    steps = exact(value) / exact(step_s)
    if steps.denominator == 1:
        return
    near = [float(exact(step_s) * count) for count in (steps.__floor__(), steps.__ceil__()) if count > 0]
    yield Problem(
        path,
        f"{value:g} s is no whole number of steps of {step_s:g} s; take {' or '.join(f'{x:.12g}' for x in near)}",
    )
