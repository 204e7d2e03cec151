"""What the measurements can tell of the state at the ends of the phases of a run."""

from __future__ import annotations

import numpy as np

from relnav_sim.plots.facts import CaseFacts
from relnav_sim.plots.observability import alike
from relnav_sim.report.tables import Column, Number, Row, Table, Words
from relnav_sim.results.observability import NOT_OBSERVABLE


def observability_table(case: CaseFacts) -> Table | None:
    """Return the weakest direction and its ratio at the end of each phase; None where nothing is known of it.

    Phases end where settling does, where a manoeuvre begins, and with the run.
    """
    groups = alike(case.filters)
    if not groups:
        return None
    rows = []
    for what, time_s in _phase_ends(case):
        place = int(np.searchsorted(case.times_s, time_s, "right")) - 1
        cells: list[Number | Words] = []
        for _, found in groups:
            ratio = float(found.ratio[place])
            # The state at the start is known as well as the start says while there is no measurement.
            words = found.weakest_at(float(case.times_s[place]))
            blind = ratio > NOT_OBSERVABLE
            cells += [Number(ratio, decimals=4, mark="failed" if blind else ""), Words(words)]
        rows.append(Row(f"{what}, t = {case.times_s[place]:g} s", tuple(cells)))
    return Table(
        name=f"case_{case.index:03d}_observability",
        title="Observability",
        caption="Ratio of posterior to prior sigma in the direction of position and velocity of which the measurements "
        "so far tell least, by their information alone, scaled by the sigmas of the start. 1: nothing is told; above "
        f"{NOT_OBSERVABLE:g} it is not observable. A direction is that of the state at the start; where several are "
        "not observable none is named.",
        corner="end of phase",
        columns=tuple(
            Column(label, ", ".join(names), numeric=label == "ratio", opens_group=label == "ratio")
            for names, _ in groups
            for label in ("ratio", "weakest direction")
        ),
        rows=tuple(rows),
    )


def _phase_ends(case: CaseFacts) -> list[tuple[str, float]]:
    """Return what ends each phase, and when, s, in order of time."""
    first, last = float(case.times_s[0]), float(case.times_s[-1])
    ends = [("settled", case.settle_s)] + [("manoeuvre", time_s) for time_s in case.manoeuvres_s]
    inside = sorted(((what, time_s) for what, time_s in ends if first < time_s < last), key=lambda end: end[1])
    return [*inside, ("end of the run", last)]
