"""What is simulated beside what each filter is told of it; sensors say themselves what their effects are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from relnav_sim.options import Effect
from relnav_sim.report.settings_in_words import leaves
from relnav_sim.report.tables import Column, Row, Table, Words
from relnav_sim.results.settings import case_setting, filter_settings
from relnav_sim.sensors.interface import RelativeSensorOptions, SensorOptions
from relnav_sim.sensors.noise import noise_parts, white_law
from relnav_sim.sensors.registry import sensor_kinds
from relnav_sim.truth.manoeuvres import ExecutionErrors
from relnav_sim.wording import listed

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

NOT_TOLD = "not told"
NOT_USED = "does not use it"
MISSING = "told: no measurement then"
_MIXTURE = {
    "nominal": "its sigmas, no outliers",
    "total": "one Gaussian with the total covariance",
    "mixture": "told: the components",
}
_THRUST = {"none": NOT_TOLD, "planned": "the plan", "measured": "measured by accelerometers, else the plan"}
_EXECUTION = {"none": NOT_TOLD, "planned": "as process noise", "measured": "measured by accelerometers"}
_ARRIVAL = {"drop": "late measurements left out", "buffer": "goes back to their epoch"}

Entry = Mapping[str, Any]
"""The settings of a filter."""


def told_table(results: Results, index: int) -> Table:
    """Return a row for each effect that is simulated, with what every filter of a case is told of it."""
    names = results.headers[index].filters
    entries = {name: _filter(results, index, name) for name in names}
    rows = [_row("relative motion", _forces(results, index), entries, _dynamics)]
    rows.append(_row("residual dynamics", "what the filter's dynamics leave out", entries, _process_noise))
    rows += _manoeuvres(results, index, entries)
    rows += _sensor_rows(results, index, entries)
    rows += [
        Row(f"stress {name}", (Words(leaves(change)), *(Words(NOT_TOLD) for _ in names)))
        for name, change in _mapping(results.campaign_content.get("stress")).items()
    ]
    return Table(
        name="told",
        title="Simulated and told",
        caption="Each effect that is simulated, and what the filters are told or assume of it. Not told: the effect "
        "enters the filter's errors and no part of its model. In R: in the covariance of the measurement noise."
        f"{_which_case(results, index)}",
        corner="effect",
        columns=(Column("simulated", numeric=False), *(Column(name, numeric=False) for name in names)),
        rows=tuple(rows),
        stacks=True,
    )


def _which_case(results: Results, index: int) -> str:
    return f" Values of case {index}." if len(results.nominal) > 1 else ""


def _row(label: str, simulated: str, entries: Mapping[str, Entry], of: Callable[[Entry], str]) -> Row:
    return Row(label, (Words(simulated), *(Words(of(entry)) for entry in entries.values())))


def _forces(results: Results, index: int) -> str:
    forces = _mapping(case_setting(results, index, "truth.forces", {}))
    if not forces:
        return "from ephemerides"
    gravity = forces.get("gravity")
    parts = [f"gravity {leaves(gravity)}" if gravity else _zonals(forces.get("zonals"))]
    parts += [f"drag ({forces['drag']})"] if forces.get("drag") not in (None, "none") else []
    parts += ["solar radiation pressure"] if forces.get("radiation_pressure") else []
    parts += [f"third bodies ({listed(forces['third_bodies'])})"] if forces.get("third_bodies") else []
    return ", ".join(parts)


def _zonals(degree: Any) -> str:
    return "point mass" if not degree or int(degree) < 2 else "J2" if int(degree) == 2 else f"J2 to J{int(degree)}"


def _dynamics(entry: Entry) -> str:
    motion = _mapping(entry.get("dynamics"))
    more = {key: value for key, value in motion.items() if key in ("zonals", "model", "degree", "order", "drag")}
    return " ".join([str(motion.get("kind", "")), *([f"({leaves(more)})"] if leaves(more) else [])])


def _process_noise(entry: Entry) -> str:
    return f"as process noise: {leaves(entry.get('process_noise')) or 'none'}"


def _manoeuvres(results: Results, index: int, entries: Mapping[str, Entry]) -> Iterator[Row]:
    burns = _mapping(case_setting(results, index, "truth.manoeuvres", {}))
    if not burns:
        return
    usual = "measured" if any(each and each.role == "force" for _, _, each in _sensors(results, index)) else "planned"

    def row(label: str, simulated: str, answers: Mapping[str, str]) -> Row:
        return _row(label, simulated, entries, lambda entry: answers[entry.get("known_thrust") or usual])

    said = [f"{name} at {_mapping(burn).get('time_s', 0):g} s" for name, burn in burns.items()]
    yield row("manoeuvres", ", ".join(said), _THRUST)
    errors = {name: leaves(each) for name, each in execution_errors(results, index).items()}
    if any(errors.values()):
        each_its_own = "; ".join(f"{name}: {errors_of or 'none'}" for name, errors_of in errors.items())
        of_all = next(iter(errors.values())) if len(set(errors.values())) == 1 else each_its_own
        yield row("manoeuvres: execution errors", of_all, _EXECUTION)


def execution_errors(results: Results, index: int) -> dict[str, dict[str, float]]:
    """Return the execution errors of each manoeuvre of a case: its own, else those that hold for all."""
    found = {}
    for name in _mapping(case_setting(results, index, "truth.manoeuvres", {})):
        own = f"truth.manoeuvres.{name}.errors"
        path = "truth.execution_errors" if case_setting(results, index, own, None) is None else own
        found[name] = {
            key: float(case_setting(results, index, f"{path}.{key}", 0.0)) for key in ExecutionErrors.model_fields
        }
    return found


def _sensors(results: Results, index: int) -> Iterator[tuple[str, Mapping[str, Any], SensorOptions | None]]:
    """Yield name, settings and options of each sensor of a case; without options where they can't be read here.

    Relative sensors that no filter takes measurements of are left out.
    """
    channels = results.headers[index].channels
    for name in _mapping(results.campaign_content.get("sensors")):
        found = _mapping(case_setting(results, index, f"sensors.{name}", {}))
        settings = {key: case_setting(results, index, f"sensors.{name}.{key}", value) for key, value in found.items()}
        kind = sensor_kinds().get(str(settings.get("kind", name)))
        try:
            options = None if kind is None else kind.model_validate(settings, strict=False)
        except ValidationError:  # another version of the package that has it
            options = None
        if not channels or name in channels or (options is not None and options.role != "other"):
            yield name, settings, options


def _sensor_rows(results: Results, index: int, entries: Mapping[str, Entry]) -> Iterator[Row]:
    """Yield a row for each effect of each sensor that is switched on."""
    found = list(_sensors(results, index))
    sensors = {name: options for name, _, options in found if options is not None}
    for name, settings, options in found:
        if options is None:
            yield _row(name, leaves(settings), entries, lambda entry: "not known: this sensor is not installed")
            continue
        for effect, simulated in _effects(options):
            asked = _Asked(name, sensors, effect)
            yield _row(f"{name}: {effect.name}", simulated, entries, asked.answer)


def _effects(options: SensorOptions) -> Iterator[tuple[Effect, str]]:
    """Yield the effects of a sensor that are switched on, with what is simulated, in words; its noise first."""
    white, others = [], []
    for part in noise_parts(options.noise):
        own = {key: value for key, value in part.model_dump().items() if key != "kind" and (key, value) != ("scale", 1)}
        if part.effect.told == "noise":
            white.append(leaves({"kind": part.kind, **own}))
        else:
            others.append((part.effect, leaves(own) or part.kind))
    marked: dict[Effect, dict[str, Any]] = {}
    sigmas = {}
    for key, field in type(options).model_fields.items():
        effects = [mark for mark in field.metadata if isinstance(mark, Effect)]
        for effect in effects:
            marked.setdefault(effect, {})[key] = getattr(options, key)
        if not effects and "sigma" in key:
            sigmas[key] = getattr(options, key)
    sigmas |= next((values for effect, values in marked.items() if effect.told == "noise"), {})
    yield Effect("noise", "noise"), "; ".join(part for part in (leaves(sigmas), ", ".join(white)) if part)
    yield from others
    for effect, values in marked.items():
        if effect.told != "noise" and leaves(next(iter(values.values()))):
            yield effect, leaves(values)


@dataclass(frozen=True)
class _Asked:
    """What is asked of each filter: what it is told of an effect of a sensor, by name, among all of the case."""

    name: str
    sensors: Mapping[str, SensorOptions]
    effect: Effect

    @property
    def options(self) -> SensorOptions:
        return self.sensors[self.name]

    def answer(self, entry: Entry) -> str:
        """Return what a filter is told."""
        return _ANSWERS[self.effect.told](self, entry) if self.used(self.name, entry) else NOT_USED

    def used(self, name: str, entry: Entry) -> bool:
        """Return whether a filter goes by a sensor, or by one whose host needs it."""
        options, chosen = self.sensors[name], entry.get("sensors")
        if isinstance(options, RelativeSensorOptions):
            return chosen is None or name in chosen
        if options.role == "force":
            return (entry.get("known_thrust") or "measured") == "measured"  # the default where there is one
        return any(
            options.role in each.direction_from and any(each.needs_direction()) and self.used(other, entry)
            for other, each in self.sensors.items()
            if isinstance(each, RelativeSensorOptions)
        )


def _noise(asked: _Asked, entry: Entry) -> str:
    if asked.options.role == "force":
        return "as noise of the known control input"
    if asked.options.role != "other":
        return "told: in R of directions"
    mixture = len(white_law(noise_parts(asked.options.noise), 1).weights) > 1
    told = _MIXTURE.get(str(entry.get("assumed_noise")), "") if mixture else "told"
    scale = entry.get("r_scale", 1.0)
    return told if scale in (None, 1.0) else f"{told}, times {scale:g}"


def _states(asked: _Asked, entry: Entry) -> str:
    wanted = asked.effect.states or asked.options.error_states
    of = (None, asked.name)
    mine = [
        str(state["kind"])
        for state in map(_mapping, entry.get("augment") or ())
        if state.get("kind") in wanted and (asked.options.role != "other" or state.get("sensor") in of)
    ]
    return f"augmented states ({listed(mine)})" if mine else NOT_TOLD


_ANSWERS: Mapping[str, Callable[[_Asked, Entry], str]] = {
    "noise": _noise,
    "states": _states,
    "absence": lambda asked, entry: MISSING,
    "never": lambda asked, entry: NOT_TOLD,
    "latency": lambda asked, entry: "told" if entry.get("assumed_latency") == "known" else NOT_TOLD,
    "arrival": lambda asked, entry: _ARRIVAL[entry.get("out_of_sequence") or "drop"],
}


def _filter(results: Results, index: int, name: str) -> Entry:
    """Return the settings of a filter of a case, single values that the campaign varies filled in."""
    found = dict(filter_settings(results, index, name))
    start = f"filters.{name}."
    for path, value in results.headers[index].variables.items():
        if path.startswith(start) and "." not in (key := path.removeprefix(start)):
            found[key] = value
    return found


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
