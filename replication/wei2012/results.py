"""Everything about Wei, Song and Zhang (2012): index, tables, figures, causes."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.statistics.verdicts import mean_of_runs
from replication.built import built
from replication.evidence import number_of
from replication.figure_drawing import error_norms, orbit_plane
from replication.measured import Measured
from replication.papers import papers
from replication.summary import PaperPart, Plot
from replication.wei2012.causes import COLUMNS, PARTICLE_FILTERS, experiments
from replication.wei2012.rules import DEPLETION, LEARNED, PERFECT, UNSCENTED, USUAL

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def part(measured: Measured) -> PaperPart:
    """Return the paper's part of the summary."""
    paper = papers()["mf_upf"]
    return PaperPart(
        key=paper.key,
        short=paper.short,
        citation=paper.citation,
        scenario=paper.scenario,
        silent=paper.silent,
        index=_index(),
        tables=_tables(measured),
        plots=_plots(measured),
        experiments=experiments(measured),
        beyond=built(measured, ((DEPLETION,), lambda: _beyond(measured))),
    )


def _label(name: str) -> str:
    kinds = {"gp_particle": "GP particle filter", "mf_upf": "MF-UPF", "gp_ukf": "GP-UKF"}
    for kind, label in kinds.items():
        if name.startswith(kind + "_"):
            target, _, source = name.removeprefix(kind + "_").partition("_")
            return f"{label}, {target}, from {source or 'truth'}"
    return name


def _error_table(
    measured: Measured, name: str, title: str, campaign: str, case: int, filters: Mapping[str, str]
) -> Table:
    rows = [
        Row(
            "paper: MF-UPF",
            (Words("–"), Words("below 0.5"), Words("–"), Words("–"), Words("below 0.001")),
        ),
        Row("paper: PF", (Words("–"), Words("–"), Words("about 5"), Words("about 0.01"), Words("–"))),
    ]
    for index, (filter, label) in enumerate(filters.items()):
        cells: list[Cell] = [
            number_of(mean_of_runs(measured.values(campaign, case, filter, column)), decimals)
            for column, decimals in COLUMNS.values()
        ]
        rows.append(Row(label, tuple(cells), opens_block=index == 0))
    return Table(
        name,
        title,
        f"{measured.window(campaign, case)}, mean over {measured.runs_in_words(campaign)} with 95 % interval.",
        "filter",
        tuple(Column(label) for label in COLUMNS),
        tuple(rows),
    )


def _tables(measured: Measured) -> tuple[Table, ...]:
    def learned(campaign: str, name: str, title: str) -> Table:
        filters = {
            filter: _label(filter)
            for filter in measured.extracts[campaign].content["filters"]
            if _label(filter) != filter
        }
        return _error_table(measured, name, title, campaign, 0, filters)

    return built(
        measured,
        ((LEARNED,), lambda: learned(LEARNED, "mf_upf_learned", "Particle filters over learned dynamics")),
        ((UNSCENTED,), lambda: learned(UNSCENTED, "mf_upf_unscented", "The same with one unscented filter")),
        (
            (DEPLETION,),
            lambda: _error_table(
                measured,
                "mf_upf_pf",
                "The particle filter of the comparison",
                DEPLETION,
                measured.case(DEPLETION, USUAL),
                PARTICLE_FILTERS,
            ),
        ),
    )


def _beyond(measured: Measured) -> Table:
    usual = measured.case(DEPLETION, USUAL)
    filters = {name: PARTICLE_FILTERS[name] for name in ("ekf_tuned", "ekf_j2")}
    table = _error_table(
        measured, "beyond_mf_upf", "The same scenario with relnav's filters", DEPLETION, usual, filters
    )
    bound = measured.bound(DEPLETION, usual)
    if bound is None:
        return table
    cells = (Number(bound[0], decimals=4), Words("–"), Words("–"), Number(bound[1], decimals=6), Words("–"))
    row = Row("PCRB, perfect model", cells, opens_block=True)
    return replace(table, rows=(*table.rows, row))


_SHOWN = {
    "gp_particle_absolute_truth": "model-free filter as printed",
    "mf_upf_residual_radar": "MF-UPF, residual, from radar",
}


def _plots(measured: Measured) -> tuple[Plot, ...]:
    of = "of Wei, Song and Zhang (2012), replicated"
    plots = []
    if measured.has(LEARNED):
        plots.append(
            Plot(
                "Fig. 2",
                "mf_upf_fig_2",
                "Relative position in the orbit plane, run 0, with a magnified part: truth and estimates.",
                f"Fig. 2 {of}",
                lambda: orbit_plane(measured, LEARNED, {**_SHOWN, "pf_no_roughening": "PF, paper's Q"}),
            )
        )
    for number, velocity, level in (("Fig. 3", False, 0.5), ("Fig. 4", True, 0.001)):
        what, unit = ("Velocity", "m/s") if velocity else ("Position", "m")
        name = f"mf_upf_{number.lower().replace('. ', '_')}"
        if measured.has(LEARNED):
            plots.append(
                Plot(
                    f"{number}, learned dynamics",
                    f"{name}_learned",
                    f"{what} error: median of {measured.runs_in_words(LEARNED)}, and where 90 % of them are. Dashed: "
                    f"the published limit, {level:g} {unit}.",
                    f"{number} {of}: learned dynamics",
                    functools.partial(_norms, measured, LEARNED, {**_SHOWN, "pf": "PF, roughened"}, velocity, level),
                )
            )
        if measured.has(DEPLETION):
            size = 0.01 if velocity else 5.0
            shown = {filter: PARTICLE_FILTERS[filter] for filter in ("pf", "pf_50", "pf_tuned", "ekf_tuned")}
            plots.append(
                Plot(
                    f"{number}, Clohessy-Wiltshire dynamics",
                    f"{name}_cw",
                    f"{what} error: median of {measured.runs_in_words(DEPLETION)}, and where 90 % of them are. "
                    f"Open loop: from a perfect start. Dashed: the published size for the PF, {size:g} {unit}.",
                    f"{number} {of}: Clohessy-Wiltshire dynamics",
                    functools.partial(_norms, measured, DEPLETION, shown, velocity, size),
                )
            )
    return tuple(plots)


def _norms(measured: Measured, campaign: str, shown: Mapping[str, str], velocity: bool, level: float) -> Figure:
    time, curves = measured.curves(campaign, 0, "norms")
    places = [(label, time, curves[filter]) for filter, label in shown.items()]
    if campaign == DEPLETION:
        time, curves = measured.curves(campaign, measured.case(campaign, PERFECT), "norms")
        places.append(("open loop", time, curves["open_loop"]))
    return error_norms(places, velocity, level)


def _index() -> Table:
    rows = (
        ("Fig. 1", "Frames of chief and deputy. No numbers: docs/frames.md."),
        ("Tables 1, 2", "Orbit, masses and radar: the campaigns' truth and sensors sections."),
        ("Fig. 2", "Relative position in the orbit plane."),
        ("Fig. 3", "Position error, over learned dynamics and over Clohessy-Wiltshire."),
        ("Fig. 4", "Velocity error, likewise."),
    )
    return Table(
        "index_mf_upf",
        "The paper's tables and figures, by number",
        "",
        "in the paper",
        (Column("here", numeric=False),),
        tuple(Row(number, (Words(text),)) for number, text in rows),
    )
