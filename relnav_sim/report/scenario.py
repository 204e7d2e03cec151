"""The figure of a scenario, and what the campaign leaves out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim import plots
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.scenario import scenario_words
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw
from relnav_sim.report.told import execution_errors
from relnav_sim.results.settings import case_setting
from relnav_sim.wording import listed

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


def scenario_picture(results: Results, case: CaseFacts, folder: FigureFolder) -> Picture | None:
    """Return the figure of the scenario of a case."""

    def drawing() -> Drawing | None:
        if not case.filters:
            return None
        ranges = np.linalg.norm(results.truth(case.index)[0, :, :3], axis=-1)
        words = scenario_words(case, ranges)
        return Drawing(plots.scenario(results, case, case.axes), words.caption, words.alt)

    return draw(folder, f"case_{case.index:03d}_scenario", drawing)


def limitations(results: Results) -> tuple[str, ...]:
    """Return what the campaign assumes and leaves out, a sentence each."""
    return tuple(_limitations(results))


def _limitations(results: Results) -> Iterator[str]:
    if results.replay is not None:
        yield "Recorded measurements: what acted on them is not known beyond what the files say."
        return
    absent = [
        words
        for words, force in (
            ("third bodies", "third_bodies"),
            ("solar radiation pressure", "radiation_pressure"),
            ("drag", "drag"),
        )
        if not any(_is_on(case_setting(results, case, f"truth.forces.{force}", None)) for case in results.nominal)
    ]
    if absent and _mapping(_mapping(results.campaign_content.get("truth")).get("forces")):
        yield f"The truth has no {listed(absent).replace(' and ', ' and no ')}."
    if all(results.truth_runs(index).tolist() == [-1] for index in _flown(results)):
        yield "Every run flies the same true trajectory: runs differ in measurement noise and start only."
    errors = [execution_errors(results, case) for case in results.nominal]
    if any(errors) and not any(any(each.values()) for case in errors for each in case.values()):
        yield "Manoeuvres are executed without error."
    yield "No attitude dynamics are simulated: only errors of the measured attitude enter."
    if not _mapping(results.campaign_content.get("stress")):
        yield "No stress: filters are told the right sensor models, but for what the table shows as not told."


def _flown(results: Results) -> list[int]:
    """Return the cases that have runs."""
    cases = range(len(results.headers))
    return [case for case in cases if any(len(results.case_runs(case, name)) for name in results.headers[case].filters)]


def _is_on(force: Any) -> bool:
    return bool(force) and force != "none"


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
