"""The figure of a scenario, and what the campaign leaves out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from relnav_sim import plots
from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.scenario import scenario_words
from relnav_sim.report.drawing import Drawing, FigureFolder, Picture, draw
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


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
