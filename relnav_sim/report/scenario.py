"""What is simulated beside what each filter is told of it, and what the campaign leaves out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim import plots
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.scenario import scenario_words
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw
from relnav_sim.report.tables import Column, Row, Table, Words
from relnav_sim.results.settings import case_setting, filter_settings
from relnav_sim.wording import listed

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

NOT_TOLD = "not told"
_NOISE = {
    "nominal": "its sigmas, no outliers",
    "total": "one Gaussian with the total covariance",
    "mixture": "told: the components",
}
_THRUST = {"none": NOT_TOLD, "planned": "the plan", "measured": "measured by accelerometers, else the plan"}
_RANDOM_LATENCY = {"drop": "late measurements left out", "buffer": "goes back to their epoch"}


def scenario_picture(results: Results, case: CaseFacts, folder: FigureFolder) -> Picture | None:
    """Return the figure of the scenario of a case."""

    def drawing() -> Drawing | None:
        if not case.filters:
            return None
        ranges = np.linalg.norm(results.truth(case.index)[0, :, :3], axis=-1)
        words = scenario_words(case, ranges)
        return Drawing(plots.scenario(results, case, case.axes), words.caption, words.alt)

    return draw(folder, f"case_{case.index:03d}_scenario", drawing)


def told_table(results: Results, index: int) -> Table:
    """Return a row for each effect that is simulated, with what every filter of a case is told of it."""
    names = results.headers[index].filters
    entries = {name: _filter(results, index, name) for name in names}
    rows = [_row("relative motion", _forces(results, index), entries, _dynamics)]
    rows.append(_row("residual dynamics", "what the filter's dynamics leave out", entries, _process_noise))
    rows += _manoeuvres(results, index, entries)
    for sensor, settings in _sensors(results, index).items():
        rows += _sensor_rows(sensor, settings, entries)
    rows += [
        Row(f"stress {name}", (Words(_leaves(change)), *(Words(NOT_TOLD) for _ in names)))
        for name, change in _mapping(results.campaign_content.get("stress")).items()
    ]
    return Table(
        name="told",
        title="Simulated and told",
        caption="Each effect that is simulated, and what the filters are told or assume of it. Not told: the effect "
        f"enters the filter's errors and no part of its model.{_which_case(results, index)}",
        corner="effect",
        columns=(Column("simulated", numeric=False), *(Column(name, numeric=False) for name in names)),
        rows=tuple(rows),
    )


def limitations(results: Results) -> tuple[str, ...]:
    """Return what the campaign assumes and leaves out, a sentence each."""
    return tuple(_limitations(results))


def _limitations(results: Results) -> Iterator[str]:
    if results.replay is not None:
        yield "Recorded measurements: what acted on them is not known beyond what the files say."
        return
    content = results.campaign_content
    truth = _mapping(content.get("truth"))
    forces = _mapping(truth.get("forces"))
    absent = [
        words
        for words, there in (
            ("third bodies", forces.get("third_bodies")),
            ("solar radiation pressure", forces.get("radiation_pressure")),
            ("drag", forces.get("drag") not in (None, "none")),
        )
        if forces and not there
    ]
    if absent:
        yield f"The truth has no {listed(absent).replace(' and ', ' and no ')}."
    dispersions = _mapping(truth.get("dispersions"))
    if dispersions and not any(value is not None for value in dispersions.values()):
        yield "Every run flies the same true trajectory: runs differ in measurement noise and start only."
    errors = _mapping(truth.get("execution_errors"))
    if _mapping(truth.get("manoeuvres")) and errors and not any(errors.values()):
        yield "Manoeuvres are executed without error."
    yield "No attitude dynamics are simulated: only errors of the measured attitude enter."
    if not _mapping(content.get("stress")):
        yield "No stress: filters are told the right sensor models, but for what the table shows as not told."


def _which_case(results: Results, index: int) -> str:
    return f" Values of case {index}." if len(results.nominal) > 1 else ""


def _row(label: str, simulated: str, entries: Mapping[str, Any], of: Any) -> Row:
    return Row(label, (Words(simulated), *(Words(of(entry)) for entry in entries.values())))


def _forces(results: Results, index: int) -> str:
    forces = _mapping(case_setting(results, index, "truth.forces", {}))
    if not forces:
        return "from ephemerides"
    gravity = forces.get("gravity")
    parts = [f"gravity {_leaves(gravity)}" if gravity else _zonals(forces.get("zonals"))]
    parts += [f"drag ({forces['drag']})"] if forces.get("drag") not in (None, "none") else []
    parts += ["solar radiation pressure"] if forces.get("radiation_pressure") else []
    parts += [f"third bodies ({listed(forces['third_bodies'])})"] if forces.get("third_bodies") else []
    return ", ".join(parts)


def _zonals(degree: Any) -> str:
    return "point mass" if not degree or int(degree) < 2 else "J2" if int(degree) == 2 else f"J2 to J{int(degree)}"


def _dynamics(entry: Mapping[str, Any]) -> str:
    motion = _mapping(entry.get("dynamics"))
    more = {key: value for key, value in motion.items() if key in ("zonals", "model", "degree", "order", "drag")}
    return " ".join([str(motion.get("kind", "")), *([f"({_leaves(more)})"] if _leaves(more) else [])])


def _process_noise(entry: Mapping[str, Any]) -> str:
    return f"as process noise: {_leaves(entry.get('process_noise')) or 'none'}"


def _manoeuvres(results: Results, index: int, entries: Mapping[str, Any]) -> Iterator[Row]:
    burns = _mapping(case_setting(results, index, "truth.manoeuvres", {}))
    if burns:
        said = [f"{name} at {_mapping(burn).get('time_s', 0):g} s" for name, burn in burns.items()]
        yield _row(
            "manoeuvres", ", ".join(said), entries, lambda entry: _THRUST.get(entry.get("known_thrust"), "default")
        )


def _sensors(results: Results, index: int) -> dict[str, Mapping[str, Any]]:
    """Return the settings of the sensors that some filter takes measurements of."""
    header = results.headers[index]
    known = _mapping(results.campaign_content.get("sensors"))
    names = [name for name in known if name in header.channels] or list(known)
    return {name: _setting(results, index, name) for name in names}


def _setting(results: Results, index: int, sensor: str) -> Mapping[str, Any]:
    found = _mapping(case_setting(results, index, f"sensors.{sensor}", {}))
    return {key: case_setting(results, index, f"sensors.{sensor}.{key}", value) for key, value in found.items()}


def _sensor_rows(sensor: str, settings: Mapping[str, Any], entries: Mapping[str, Any]) -> Iterator[Row]:
    sigmas = {key: value for key, value in settings.items() if "sigma" in key and "time_tag" not in key and value}
    noise = _leaves(settings.get("noise"))
    plain = _mapping(settings.get("noise")).get("kind") == "gaussian"
    of_noise = partial(_noise, "told") if plain else partial(_noise, "")
    yield _row(f"{sensor}: noise", f"{_leaves(sigmas)}; {noise}", entries, partial(_of_sensor, sensor, of_noise))
    biases = {key: value for key, value in settings.items() if "bias" in key and value}
    if biases:
        yield _row(f"{sensor}: bias", _leaves(biases), entries, partial(_of_sensor, sensor, _bias))
    if settings.get("latency_s"):
        seconds = f"{settings['latency_s']:g} s"
        yield _row(f"{sensor}: latency", seconds, entries, partial(_of_sensor, sensor, _latency))
    if settings.get("drawn_latency_s"):
        drawn = _leaves(settings["drawn_latency_s"])
        yield _row(f"{sensor}: random latency", drawn, entries, partial(_of_sensor, sensor, _random_latency))
    tags = {key: value for key, value in settings.items() if key.startswith("time_tag") and value}
    if tags:
        yield _row(f"{sensor}: time tags", _leaves(tags), entries, partial(_of_sensor, sensor, lambda *_: NOT_TOLD))


def _of_sensor(sensor: str, of: Any, entry: Mapping[str, Any]) -> str:
    used = entry.get("sensors")
    return "does not use it" if used is not None and sensor not in used else str(of(sensor, entry))


def _noise(told: str, sensor: str, entry: Mapping[str, Any]) -> str:
    scale = entry.get("r_scale", 1.0)
    found = told or _NOISE.get(str(entry.get("assumed_noise")), "")
    return found if scale in (None, 1.0) else f"{found}, times {scale:g}"


def _bias(sensor: str, entry: Mapping[str, Any]) -> str:
    carried = [_mapping(state) for state in entry.get("augment") or ()]
    mine = [state for state in carried if state.get("sensor") in (None, sensor) and "bias" in str(state.get("kind"))]
    return f"augmented states ({listed([str(state['kind']) for state in mine])})" if mine else NOT_TOLD


def _latency(sensor: str, entry: Mapping[str, Any]) -> str:
    return "told" if entry.get("assumed_latency") == "known" else NOT_TOLD


def _random_latency(sensor: str, entry: Mapping[str, Any]) -> str:
    return _RANDOM_LATENCY[entry.get("out_of_sequence") or "drop"]


def _filter(results: Results, index: int, name: str) -> Mapping[str, Any]:
    """Return the settings of a filter of a case, single values that the campaign varies filled in."""
    found = dict(filter_settings(results, index, name))
    start = f"filters.{name}."
    for path, value in results.headers[index].variables.items():
        if path.startswith(start) and "." not in (key := path.removeprefix(start)):
            found[key] = value
    return found


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _leaves(value: Any) -> str:
    """Return settings in a few words; what is not set, and zeros, are left out."""
    if isinstance(value, Mapping):
        return ", ".join(
            inner if key == "kind" else f"{key} {inner}" for key, part in value.items() if (inner := _leaves(part))
        )
    if isinstance(value, Sequence) and not isinstance(value, str):
        parts = [_leaves(part) for part in value]
        return "[" + ", ".join(parts) + "]" if any(parts) else ""
    if value is None or value is False or value == 0:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else str(value)
