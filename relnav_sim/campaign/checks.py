"""What must fit together across the sections of a case, beyond what each section checks by itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import ceil

from relnav_sim.campaign.afterwards import check_afterwards, check_late, check_whole_steps
from relnav_sim.campaign.editing_checks import check_editing
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import Clock, FirstFixStart, StatisticsOptions
from relnav_sim.campaign.problems import Path, Problem, listed, no_such
from relnav_sim.containment import Containment
from relnav_sim.conventions import RESERVED_NAMES
from relnav_sim.dynamics.augmentation.extension import extension, sensor_of
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.options import Options
from relnav_sim.sensors import ErrorShares, Sensors, form_taken, hosts_of, own_sensor, relative_sensors, sensor_kinds
from relnav_sim.sensors.conformity import TriedSensors
from relnav_sim.truth import AnyTruth, EphemerisTruthOptions, TruthOptions, nominal_chief
from relnav_sim.truth.flown_orbits import flown
from relnav_sim.truth.thrust import CRAFT

MOST_EPOCHS = 10_000_000


@dataclass(frozen=True)
class Parts:
    """The parts of a case that are valid by themselves."""

    clock: Clock | None = None
    truth: AnyTruth | None = None
    sensors: Sensors | None = None
    start: Options | None = None
    statistics: StatisticsOptions | None = None
    filters: Mapping[str, FilterEntry] = field(default_factory=dict)


def check_together(parts: Parts, tried: TriedSensors) -> Iterator[Problem]:
    """Yield what does not fit together; a part that is missing or wrong is left out of the checks.

    Args:
        parts: The parts of a case.
        tried: Tries its sensors.
    """
    if parts.clock is not None:
        yield from _check_clock(parts.clock)
        if parts.sensors is not None:
            yield from _check_periods(parts.sensors, parts.clock)
        if parts.statistics is not None and parts.statistics.settle_s >= parts.clock.duration_s:
            which = "" if "settle_s" in parts.statistics.model_fields_set else ", the default,"
            yield Problem(
                ("statistics", "settle_s"),
                f"{parts.statistics.settle_s:g} s{which} leaves nothing of a run of {parts.clock.duration_s:g} s; "
                "write a smaller one under statistics, or a longer clock.duration_s",
            )
        if parts.truth is not None:
            yield from _check_manoeuvres(parts.truth, parts.clock)
    truth = parts.truth
    if isinstance(truth, EphemerisTruthOptions):
        yield from _check_recorded(truth, parts)
        truth = None  # nothing is learned from before its start, and its files may be unusable
    if parts.sensors is not None:
        yield from _check_sensors(parts.sensors, parts.start)
        if parts.clock is not None:
            for name in parts.sensors:
                yield from (
                    Problem(("sensors", name), said)
                    for said in tried.complaints(name, parts.sensors, parts.clock.step_s)
                )
    for name, entry in parts.filters.items():
        if name in RESERVED_NAMES:
            yield Problem(("filters", name), f"{name!r} has a meaning of its own in results files; take another name")
        yield from _check_considered(name, entry)
        yield from _check_process_noise(name, entry)
        yield from check_afterwards(name, entry, parts.clock)
        if parts.sensors is not None and parts.clock is not None:
            yield from check_late(name, entry, parts.sensors, parts.clock)
        yield from check_editing(name, entry, parts.sensors)
        if parts.sensors is not None:
            yield from _check_sensors_of(name, entry, parts.sensors)
            yield from _check_accelerometer_bias(name, entry, parts.sensors)
            yield from _check_sensor_errors(name, entry, parts.sensors)
            yield from _check_distortions(name, entry, parts.sensors)
            if truth is not None:
                yield from _check_epoch(name, entry, truth)
                yield from _check_training(name, entry, parts.sensors, truth)
        if filter_kinds()[entry.kind].learned_dynamics and "training_track" not in entry.dynamics.needs:
            learned = [kind for kind, options in dynamics_kinds().items() if "training_track" in options.needs]
            yield Problem(
                ("filters", name, "dynamics"),
                f"the {entry.kind} filter needs learned dynamics: {' or '.join(learned)} (or leave this key out)",
            )


def _check_recorded(truth: EphemerisTruthOptions, parts: Parts) -> Iterator[Problem]:
    """Yield what can't be flown of recorded orbits, and what they can't tell."""
    try:
        epoch = truth.start_epoch
        for craft in CRAFT:
            duration_s = 0.0 if parts.clock is None else parts.clock.duration_s
            flown(truth.ephemeris, craft, epoch, duration_s, truth.orientation)
        nominal_chief(truth)
    except ValueError as error:
        yield Problem(("truth", "ephemeris"), str(error))
    for name, sensor in (parts.sensors or {}).items():
        if sensor.role == "force":
            yield Problem(("sensors", name), "recorded orbits do not tell thrust and drag from gravity; leave this out")
    for name, entry in parts.filters.items():
        if "training_track" in entry.dynamics.needs:
            yield Problem(
                ("filters", name, "dynamics"),
                "learned dynamics are trained on what was before the start, which recorded orbits do not tell; take "
                "dynamics that are not learned",
            )


def _check_sensors(sensors: Sensors, start: Options | None) -> Iterator[Problem]:
    """Yield what the sensors lack for any filter, or for the start."""
    relative = relative_sensors(sensors)
    if not relative:
        kinds = [kind for kind, model in sensor_kinds().items() if model.role == "other"]
        yield Problem(("sensors",), f"the filters have nothing to go by: give a sensor of the kind {listed(kinds)}")
        return
    if len({each.host for each in relative.values()}) > 1:
        for name, each in sensors.items():
            if each.host is None:
                yield Problem(
                    ("sensors", name, "host"),
                    "the relative sensors are on both craft, so say which of them carries this one: chief or deputy",
                )
    for role in ("orbit", "attitude", "force"):
        for host in ("chief", "deputy"):
            both = [name for name, each in sensors.items() if each.role == role and host in hosts_of(sensors, each)]
            if len(both) > 1:
                yield Problem(
                    ("sensors", both[1]), f"{both[0]} tells the {host} the same; a craft goes by one sensor of a kind"
                )
    for name, each in relative.items():
        if each.drawn_latency_s is not None and each.latency_s:
            yield Problem(
                ("sensors", name, "drawn_latency_s"),
                "measurements that count at a later epoch (latency_s) and measurements that arrive late exclude each "
                "other; give one of them",
            )
    if not isinstance(start, FirstFixStart):
        return
    giving = next((name for name, each in relative.items() if each.gives_fix), None)
    if giving is None:
        yield Problem(
            ("start", "kind"),
            f"no sensor here gives a position by itself ({listed(list(relative), 'and')}), so there is no first fix; "
            "take dispersed or given",
        )
    elif relative[giving].latency_s or relative[giving].offset_s:
        late_s = relative[giving].latency_s or relative[giving].offset_s
        key = "latency_s" if relative[giving].latency_s else "offset_s"
        yield Problem(
            ("sensors", giving, key),
            f"the first measurement comes {late_s:g} s after the start, so there is no fix to start from; "
            "take start.kind dispersed or given",
        )
    elif relative[giving].drawn_latency_s is not None:
        yield Problem(
            ("sensors", giving, "drawn_latency_s"),
            "the first measurement may arrive after the start, so there is no fix to start from; take start.kind "
            "dispersed or given",
        )


def _check_epoch(name: str, entry: FilterEntry, truth: AnyTruth) -> Iterator[Problem]:
    """Yield a problem where dynamics depend on the calendar and the campaign says no date."""
    if "epoch" in entry.dynamics.needs and truth.start_epoch is None:
        yield Problem(
            ("filters", name, "dynamics"),
            f"{entry.dynamics.kind} needs to know how the Earth is turned: give truth.epoch (2025-03-20T12:00:00 UTC)",
        )


def _check_training(name: str, entry: FilterEntry, sensors: Sensors, truth: TruthOptions) -> Iterator[Problem]:
    """Yield a problem where dynamics are to be learned from a smoothed track that no sensor gives a start for."""
    if "training_track" not in entry.dynamics.needs or any(
        each.gives_fix for each in relative_sensors(sensors).values()
    ):
        return
    orbit = nominal_chief(truth)
    with Containment() as contained:  # it may be another package's, which fails in the results of this filter
        source = entry.dynamics.training_request(orbit).source
    if contained.error is None and source == "smoothed_radar":
        yield Problem(
            ("filters", name, "dynamics"),
            "there is no track to learn from, as no sensor here gives a position by itself; learn from the truth or "
            "take dynamics that are not learned",
        )


def _check_sensors_of(name: str, entry: FilterEntry, sensors: Sensors) -> Iterator[Problem]:
    """Yield what a filter wants of the sensors and can't have."""
    if entry.known_thrust == "measured" and own_sensor(sensors, "force") is None:
        yield Problem(
            ("filters", name, "known_thrust"), "nothing measures the thrust: give sensors.accelerometer, or planned"
        )
    relative = relative_sensors(sensors)
    unknown = [each for each in entry.sensors or () if each not in relative]
    for each in unknown:
        place = ("filters", name, "sensors", (entry.sensors or ()).index(each))
        own = f"{each} measures its own craft, not the other one; " if each in sensors else ""
        yield Problem(place, own + no_such("sensor", each, list(relative)))
    if unknown:
        return
    linear = filter_kinds()[entry.kind].linear_only
    for each, options in relative_sensors(sensors, entry.sensors).items():
        form = form_taken(options, entry.measurement)
        if linear and form not in options.linear_forms:
            remedy = (
                f"take {options.linear_forms[0]} (or leave this key out)"
                if options.linear_forms
                else f"leave {each} out of its sensors, or take ekf"
            )
            yield Problem(
                ("filters", name, "measurement"),
                f"the {entry.kind} filter needs a linear measurement, and {each} gives none as {form}: {remedy}",
            )
        elif form == "cartesian" and options.host == "deputy":
            yield Problem(
                ("filters", name, "measurement"),
                f"cartesian needs the sensor {each} on the chief: a deputy's orbit frame turns with the state",
            )


def _check_considered(name: str, entry: FilterEntry) -> Iterator[Problem]:
    """Yield the augmented states that the filter is to account for without estimating them, where it can't."""
    if filter_kinds()[entry.kind].considers:
        return
    for place, option in enumerate(entry.augment):
        if option.mode == "consider":
            yield Problem(
                ("filters", name, "augment", place, "mode"),
                f"the {entry.kind} filter can't account for a state without estimating it, which takes a gain whose "
                "rows can be left out; take estimate",
            )


def _check_process_noise(name: str, entry: FilterEntry) -> Iterator[Problem]:
    """Yield a process noise that the dynamics, which are learned with one or take none, or the filter can't have."""
    form = next((form for form in ("dmc", "adaptive") if getattr(entry.process_noise, form) is not None), None)
    if form is None:
        return
    path: Path = ("filters", name, "process_noise", form)
    if "training_track" in entry.dynamics.needs or not entry.dynamics.uses_process_noise:
        yield Problem(
            path,
            f"{entry.dynamics.kind} dynamics have learned a process noise of their own; take acceleration_psd_m2_s3 or "
            "snc_rtn, or dynamics that are not learned",
        )
    elif form == "adaptive" and not filter_kinds()[entry.kind].matches_covariance:
        yield Problem(
            path,
            f"the {entry.kind} filter is not a single Gaussian of position and velocity, whose corrections tell the "
            "process noise; take acceleration_psd_m2_s3 or snc_rtn, or a filter such as ekf or ukf",
        )


def _check_manoeuvres(truth: AnyTruth, clock: Clock) -> Iterator[Problem]:
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


def _check_accelerometer_bias(name: str, entry: FilterEntry, sensors: Sensors) -> Iterator[Problem]:
    """Yield where the filter is to carry a bias that nothing it is told of has, or that comes and goes by halves."""
    found = own_sensor(sensors, "force")
    options = None if found is None else found[1]
    for place, extra in enumerate(entry.augment):
        if extra.kind != "accelerometer_bias":
            continue
        path: Path = ("filters", name, "augment", place)
        if options is None or entry.known_thrust in ("none", "planned"):
            yield Problem(path, "the filter is told of no measured thrust: give sensors.accelerometer and measured")
        elif options.deadband_m_s2 > 0 and options.host == "both":
            yield Problem(
                path,
                "with a deadband the biases of two accelerometers come and go by themselves; set the deadband to 0",
            )


def _check_sensor_errors(name: str, entry: FilterEntry, sensors: Sensors) -> Iterator[Problem]:
    """Yield the augmented states that are errors of no sensor here, or that add to a channel that another adds to."""
    if not set(entry.sensors or ()) <= set(relative_sensors(sensors)):
        return  # said already
    known = relative_sensors(sensors, entry.sensors)
    taken: dict[tuple[str | None, str], str] = {}  # by sensor and channel
    for place, option in enumerate(entry.augment):
        path: Path = ("filters", name, "augment", place)
        try:
            sensor = sensor_of(option, known)
        except ValueError as error:
            yield Problem(path, str(error))
            continue
        for channel in option.channels:
            if (sensor, channel) in taken:
                other = taken[sensor, channel]
                yield Problem(
                    path, f"{other} is an error of {sensor}'s {channel} too; no measurement can separate them"
                )
            taken[sensor, channel] = option.kind


def _check_distortions(name: str, entry: FilterEntry, sensors: Sensors) -> Iterator[Problem]:
    """Yield the errors of sensors that can't be carried in the form in which the filter takes their measurements."""
    if not entry.augmented_states or not set(entry.sensors or ()) <= set(relative_sensors(sensors)):
        return  # a sensor that is not there is said already
    known = relative_sensors(sensors, entry.sensors)
    try:
        extra = extension(entry.augmented_states, known, step_s=1.0)
    except ValueError:
        return  # an error of no sensor here is said already
    for each, options in known.items():
        try:
            options.distortion(
                ErrorShares(extra.channels[each], extra.turns[each]), form_taken(options, entry.measurement)
            )
        except ValueError as error:
            yield Problem(("filters", name, "augment"), str(error))


def _check_clock(clock: Clock) -> Iterator[Problem]:
    yield from check_whole_steps(clock.duration_s, clock.step_s, ("clock", "duration_s"))
    yield from check_whole_steps(clock.store_every_s, clock.step_s, ("clock", "store_every_s"))
    if clock.epochs > MOST_EPOCHS:
        yield Problem(("clock", "step_s"), f"makes {clock.epochs - 1} steps a run; at most {MOST_EPOCHS} are computed")
    if clock.store_every_s > clock.duration_s:
        yield Problem(
            ("clock", "store_every_s"),
            f"{clock.store_every_s:g} s is longer than the run of {clock.duration_s:g} s",
        )


def _check_periods(sensors: Sensors, clock: Clock) -> Iterator[Problem]:
    """Yield the periods and offsets of sensors that are no whole number of steps."""
    for name, each in sensors.items():
        if each.period_s is not None:
            yield from check_whole_steps(each.period_s, clock.step_s, ("sensors", name, "period_s"))
        yield from check_whole_steps(each.offset_s, clock.step_s, ("sensors", name, "offset_s"))
        if each.offset_s > clock.duration_s:
            yield Problem(
                ("sensors", name, "offset_s"),
                f"the first measurement comes after {each.offset_s:g} s; the run ends at {clock.duration_s:g} s",
            )
    for name, relative in relative_sensors(sensors).items():
        period_s = relative.period_s or clock.step_s
        # Filters take no measurement at the start itself, and what would have been taken before it is none.
        earliest_s = max(clock.step_s, relative.latency_s)
        count = max(ceil((earliest_s - relative.offset_s) / period_s - 1e-9), 0)
        first_s = relative.offset_s + count * period_s
        if relative.offset_s <= clock.duration_s < first_s * (1 - 1e-9):
            key = "latency_s" if relative.latency_s > clock.step_s else "period_s"
            yield Problem(
                ("sensors", name, key),
                f"filters get their first measurement at {first_s:g} s; the run ends at {clock.duration_s:g} s",
            )
