"""Everything about Wei, Song and Zhang (2012): index, tables, figures, causes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relnav_sim.report.tables import Cell, Column, Number, Row, Table, Words
from relnav_sim.statistics.verdicts import mean_of_runs
from replication.evidence import number_of
from replication.figure_drawing import error_norms, orbit_plane
from replication.figure_files import save
from replication.measured import Measured
from replication.papers import papers
from replication.shi2025.tables import place
from replication.summary import PaperPart, Plot
from replication.wei2012.causes import COLUMNS, PARTICLE_FILTERS, experiments
from replication.wei2012.rules import DEPLETION, LEARNED, UNSCENTED, USUAL


def part(measured: Measured, folder: Path) -> PaperPart:
    """Return the paper's part of the summary; its figures are written to a folder."""
    paper = papers()["mf_upf"]
    return PaperPart(
        key=paper.key,
        short=paper.short,
        citation=paper.citation,
        scenario=paper.scenario,
        silent=paper.silent,
        learned=_learned(measured),
        index=_index(),
        tables=_tables(measured),
        plots=_plots(measured, folder),
        experiments=experiments(measured),
        beyond=_beyond(measured),
    )


def learned_filters(measured: Measured, campaign: str = LEARNED) -> dict[str, str]:
    """Return the filters over learned dynamics that a campaign ran, with their labels."""
    if not measured.has(campaign):
        return {}
    return {name: _label(name) for name in measured.results(campaign).filters if _label(name) != name}


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
    runs = max(len(measured.runs(campaign, case, filter)) for filter in filters)
    return Table(
        name,
        title,
        f"After 1000 s, mean over {runs} runs with 95 % interval.",
        "filter",
        tuple(Column(label) for label in COLUMNS),
        tuple(rows),
    )


def _tables(measured: Measured) -> tuple[Table, ...]:
    tables = []
    for campaign, name, title in (
        (LEARNED, "mf_upf_learned", "Particle filters over learned dynamics, by what is learned and from what"),
        (UNSCENTED, "mf_upf_unscented", "The same with an unscented filter instead of particles"),
    ):
        if filters := learned_filters(measured, campaign):
            tables.append(_error_table(measured, name, title, campaign, 0, filters))
    usual = measured.case(DEPLETION, USUAL)
    tables.append(
        _error_table(measured, "mf_upf_pf", "The particle filter of the comparison", DEPLETION, usual, PARTICLE_FILTERS)
    )
    return tuple(tables)


def _learned(measured: Measured) -> tuple[str, ...]:
    usual = measured.case(DEPLETION, USUAL)
    r = measured.values(DEPLETION, usual, "ekf_tuned", "settled_r_p95_m").mean()
    v = measured.values(DEPLETION, usual, "ekf_tuned", "settled_v_p95_m_s").mean()
    return (
        f"An extended Kalman filter on Clohessy-Wiltshire with a process noise of the right size stays below {r:.2f} "
        f"m and {v:.5f} m/s for 95 % of the time.",
        "The steps that the paper lists run no unscented filter: particles are drawn from the learned dynamics, "
        "weighed by the likelihood, resampled and moved. Here that is gp_particle; mf_upf is the filter that the "
        "title promises.",
        "Training on accurate states is leakage: no flight filter has 500 error-free positions and velocities.",
        "Its equation 3 has the exponent −1/2 where it must be +1/2, equation 4 has y where x is radial, and μ is "
        "printed ten times too small. relnav computes the measurement from the geometry instead.",
    )


def _beyond(measured: Measured) -> tuple[Table, ...]:
    usual = measured.case(DEPLETION, USUAL)
    filters = {name: PARTICLE_FILTERS[name] for name in ("ekf_tuned", "ekf_j2")}
    table = _error_table(
        measured, "beyond_mf_upf", "The same scenario with relnav's filters", DEPLETION, usual, filters
    )
    results = measured.results(DEPLETION)
    bound = results.bound(usual)
    if bound is None:
        return (table,)
    settled = results.time_s(usual) >= 1000
    r, v = (float(np.sqrt(np.mean(bound[settled, k] ** 2))) for k in (6, 7))
    cells: tuple[Any, ...] = (Number(r, decimals=4), Words("–"), Words("–"), Number(v, decimals=6), Words("–"))
    row = Row("bound, perfect model", cells, opens_block=True)
    return (Table(table.name, table.title, table.caption, table.corner, table.columns, (*table.rows, row)),)


def _limit_places(measured: Measured, shown: Mapping[str, str], velocity: bool, level: float) -> str:
    """Return where a published limit lies among each filter's errors that hold 95 % of the time."""
    column = "settled_v_p95_m_s" if velocity else "settled_r_p95_m"
    words = [f"{label}: {place(level, measured.values(LEARNED, 0, name, column))}" for name, label in shown.items()]
    return f"It is, among our runs' 95 % quantiles, {'; '.join(words)}."


def _plots(measured: Measured, folder: Path) -> tuple[Plot, ...]:
    usual = measured.case(DEPLETION, USUAL)
    filters = learned_filters(measured)
    campaign, case = (LEARNED, 0) if filters else (DEPLETION, usual)
    if filters:
        wanted = (
            "gp_particle_absolute_truth",
            "gp_particle_residual_radar",
            "mf_upf_residual_radar",
        )
        shown = {name: filters[name] for name in wanted if name in filters} or filters
    else:
        shown = {name: PARTICLE_FILTERS[name] for name in ("pf", "ekf_tuned")}
    plain = {"pf_no_roughening": "PF, paper's Q"} if filters else {}
    in_plane = {**shown, **plain}
    pf = {name: PARTICLE_FILTERS[name] for name in ("pf", "pf_50", "pf_tuned", "ekf_tuned")}
    plots = [
        Plot(
            "Fig. 2",
            save(folder, "mf_upf_fig_2", orbit_plane(measured, campaign, case, in_plane)),
            "Relative position in the orbit plane, run 0, with a magnified part: truth and estimates.",
            "Fig. 2 of Wei, Song and Zhang (2012), replicated",
        )
    ]
    for number, velocity, level, pf_level in (("Fig. 3", False, 0.5, 5.0), ("Fig. 4", True, 0.001, 0.01)):
        what, unit = ("Velocity", "m/s") if velocity else ("Position", "m")
        size, column_name = (
            ("RMS after 1000 s", "settled_v_rms_m_s") if velocity else ("largest after 1000 s", "settled_r_max_m")
        )
        runs = measured.values(DEPLETION, usual, "pf", column_name)
        name = f"mf_upf_{number.lower().replace('. ', '_')}"
        if filters:
            figure = error_norms(measured, campaign, case, shown, velocity, level)
            plots.append(
                Plot(
                    f"{number}, learned dynamics",
                    save(folder, f"{name}_learned", figure),
                    f"{what} error: median of {measured.runs_in_words(campaign)}, and where 90 % of them are. "
                    f"Dashed: the published limit, {level:g} {unit}. {_limit_places(measured, shown, velocity, level)}",
                    f"{number} of Wei, Song and Zhang (2012), filters over learned dynamics",
                )
            )
        bound = measured.results(DEPLETION).bound(usual)
        column = 7 if velocity else 6
        figure = error_norms(
            measured, DEPLETION, usual, pf, velocity, pf_level, None if bound is None else bound[:, column]
        )
        plots.append(
            Plot(
                f"{number}, Clohessy-Wiltshire",
                save(folder, f"{name}_cw", figure),
                f"{what} error: median of {measured.runs_in_words(DEPLETION)}, and where 90 % of them are. "
                f"Dashed: the published size for the PF, {pf_level:g} {unit}; dotted: the bound of a perfect model. "
                f"The published size among our runs of the PF with 500 particles ({size}): {place(pf_level, runs)}.",
                f"{number} of Wei, Song and Zhang (2012), filters over Clohessy-Wiltshire dynamics",
            )
        )
    return tuple(plots)


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
