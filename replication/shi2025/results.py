"""Everything about Shi et al. (2025): index, tables, figures, causes, and what lies beyond."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.report.tables import Column, Number, Row, Table, Words
from relnav_sim.statistics.intervals import Interval
from relnav_sim.statistics.verdicts import mean_of_runs
from replication.built import built
from replication.effects import judge
from replication.evidence import found_in_words, number_of, runs_of
from replication.measured import Measured
from replication.papers import papers
from replication.shi2025 import causes, sweep_causes
from replication.shi2025.adaptive_rules import future_rules
from replication.shi2025.figures import plots
from replication.shi2025.interpretations import R_MEAN, V_MEAN
from replication.shi2025.tables import published_table, table_four
from replication.summary import Experiment, PaperPart

_LIMIT = "limit"


@dataclass(frozen=True)
class _Scenario:
    """One of the paper's scenarios: its best row, the filters of its own campaign and those of the campaign limit."""

    label: str
    paper: tuple[str, float, float, float, float]
    campaign: str
    own: Mapping[str, str]
    case: Mapping[str, Any]
    better: Mapping[str, str]


def _scenarios() -> tuple[_Scenario, ...]:
    content = papers()["alpha_kf"].content
    gaussian, mixture = (
        (*content[table]["r"]["alpha_kf"], *content[table]["v"]["alpha_kf"]) for table in ("table_2", "table_3")
    )
    best = min(content["table_4"], key=lambda row: math.hypot(row[1], row[2]))
    own = {
        "alpha_kf": "αKF, one process noise",
        "kf": "KF, one process noise",
        "adaptive_alpha": "adaptive alpha filter, one process noise",
    }
    white = {"sensors.radar.azimuth_bias_deg": 0}
    return (
        _Scenario(
            "Gaussian",
            ("αKF", *gaussian),
            "alpha_kf_gaussian",
            own,
            {**white, "sensors.radar.noise": {"kind": "gaussian"}},
            {"kf": "KF with J2 to J4"},
        ),
        _Scenario(
            "mixture",
            ("αKF", *mixture),
            "alpha_kf_mixture",
            own,
            {**white, "sensors.radar.noise": {"kind": "mixture"}},
            {"kf": "KF with J2 to J4", "imm": "IMM with J2 to J4"},
        ),
        _Scenario(
            "mixture and bias",
            (f"αKF, α = {best[0]:g}", *best[1:]),
            "alpha_kf_sweep",
            {f"alpha_{best[0]:g}": f"αKF, α = {best[0]:g}"},
            {"sensors.radar.azimuth_bias_deg": 0.05},
            {
                "kf": "KF with J2 to J4",
                "imm_biases": "IMM with J2 to J4 and the biases as states",
            },
        ),
    )


def part(measured: Measured) -> PaperPart:
    """Return the paper's part of the summary."""
    paper = papers()["alpha_kf"]
    gaussian, mixture, sweep = "alpha_kf_gaussian", "alpha_kf_mixture", "alpha_kf_sweep"
    return PaperPart(
        key=paper.key,
        short=paper.short,
        citation=paper.citation,
        scenario=paper.scenario,
        silent=paper.silent,
        index=_index(),
        tables=built(
            measured,
            ((gaussian,), lambda: published_table(measured, 2, gaussian)),
            ((mixture,), lambda: published_table(measured, 3, mixture)),
            ((sweep,), lambda: table_four(measured)),
        ),
        plots=plots(measured),
        experiments=experiments(measured),
        beyond=built(
            measured,
            ((gaussian, mixture, sweep, _LIMIT), lambda: _best_filters(measured)),
            ((gaussian, mixture, sweep), lambda: _future(measured)),
        ),
    )


def experiments(measured: Measured) -> tuple[Experiment, ...]:
    """Return the experiments that show the causes."""
    gaussian, mixture, sweep = "alpha_kf_gaussian", "alpha_kf_mixture", "alpha_kf_sweep"
    return built(
        measured,
        ((gaussian, mixture), lambda: causes.alpha_is_a_gain(measured)),
        (("alpha_kf_tuned", gaussian), lambda: causes.equal_gain(measured)),
        (("alpha_kf_process_noise",), lambda: causes.process_noise_orders_the_filters(measured)),
        (("alpha_kf_orbit",), lambda: causes.orbit_is_free(measured)),
        ((gaussian,), lambda: causes.unscented_is_extended(measured)),
        ((sweep, "alpha_kf_draws"), lambda: sweep_causes.sampling_floor(measured)),
        ((sweep, "alpha_kf_bias"), lambda: sweep_causes.small_alpha_is_slow(measured)),
        ((sweep,), lambda: sweep_causes.outliers(measured)),
        ((), causes.counted_operations),
    )


def _index() -> Table:
    rows = (
        (
            "Fig. 1, Fig. 2",
            "Definition of the radar's angles; signal flow. No numbers: docs/frames.md, docs/sensors.md.",
        ),
        ("Table 1", "Sensor errors: the campaigns' sensors sections, a third of each."),
        ("Table 2", "Table 2 below, with convergence times."),
        ("Figs. 3, 5", "Errors over 6000 s, Gaussian noise."),
        ("Figs. 4, 6", "The first 100 s, at full rate."),
        ("Figs. 7, 8, 9", "Formal sigma of αKF, EKF and UKF, in one figure."),
        ("Table 3", "Table 3 below."),
        ("Figs. 10, 11", "Errors with mixture noise."),
        ("Table 4", "Table 4 below."),
        ("Figs. 12, 13", "Box plots by alpha."),
        ("Figs. 14, 15", "Mean and standard deviation against alpha."),
    )
    return Table(
        "index_alpha_kf",
        "The paper's tables and figures, by number",
        "",
        "in the paper",
        (Column("here", numeric=False),),
        tuple(Row(number, (Words(text),)) for number, text in rows),
    )


def _best_filters(measured: Measured) -> Table:
    """Relnav's best filters on the paper's scenarios, with the bound where it is stored."""
    rows = []
    columns = (R_MEAN, "settled_r_rms_m", V_MEAN, "settled_v_rms_m_s")
    for scenario in _scenarios():
        name, r, r_std, v, v_std = scenario.paper
        paper = zip((r, math.hypot(r, r_std), v, math.hypot(v, v_std)), (3, 3, 3, 4), strict=True)
        cells = tuple(Number(value, decimals=decimals) for value, decimals in paper)
        rows.append(Row(f"{scenario.label}: paper's {name}", cells, opens_block=True))
        case = measured.case(_LIMIT, scenario.case)
        places = [(scenario.campaign, 0, filter, label) for filter, label in scenario.own.items()]
        places += [(_LIMIT, case, filter, label) for filter, label in scenario.better.items()]
        for campaign, number, filter, label in places:
            found = (_over_runs(measured.values(campaign, number, filter, column), column) for column in columns)
            ours = tuple(number_of(f, 3 if "_r_" in c else 5) for f, c in zip(found, columns, strict=True))
            rows.append(Row(f"{scenario.label}: {label}", ours))
        bound = _bound_row(measured, case)
        if bound is not None:
            rows.append(Row(f"{scenario.label}: bound, perfect model", bound))
    return Table(
        "beyond_alpha_kf",
        "The same scenario with relnav's filters",
        "t ≥ 500 s with 95 % interval: mean over time and runs, root of the mean square over time and runs; "
        f"{measured.runs_in_words('alpha_kf_gaussian', 'alpha_kf_mixture', 'alpha_kf_sweep', _LIMIT)}; the "
        "paper's RMS is made of its mean and standard deviation. "
        "The bound is the posterior Cramér-Rao bound of a filter whose dynamics are perfect.",
        "noise: filter",
        (Column("r mean [m]"), Column("r RMS [m]"), Column("v mean [m/s]"), Column("v RMS [m/s]")),
        tuple(rows),
    )


def _over_runs(values: Array, column: str) -> Interval:
    """Return the mean over runs, of squares where the figure is an RMS: a mean of roots would look too good."""
    if "_rms_" not in column:
        return mean_of_runs(values)
    square = mean_of_runs(np.square(values))
    middle, low, high = (math.sqrt(max(x, 0.0)) for x in (square.estimate, square.low, square.high))
    return Interval(middle, low, high, square.level, square.runs)


def _bound_row(measured: Measured, case: int) -> tuple[Words | Number, ...] | None:
    """Return the bound's RMS over the settled time, or None where results hold none."""
    bound = measured.bound(_LIMIT, case)
    if bound is None:
        return None
    return (Words("–"), Number(bound[0], decimals=3), Words("–"), Number(bound[1], decimals=5))


def _future(measured: Measured) -> Table:
    """The paper's future work, an alpha found online, by the same rules."""
    rows = []
    for rule in future_rules():
        judgement = judge(rule, measured)
        rows.append(
            Row(
                f"{rule.claim} with the adaptive alpha filter",
                (
                    Words(" ".join((judgement.verdict, *judgement.conditions[:1]))),
                    Words(found_in_words(judgement)),
                    Number(float(runs_of(judgement.evidence)), decimals=0)
                    if runs_of(judgement.evidence)
                    else Words("counted"),
                ),
            )
        )
    return Table(
        "future_alpha_kf",
        "The paper's future work by the same rules: alpha found at each epoch",
        "adaptive_alpha_kf in the alpha filter's place. Gaussian noise: scheme student_t; mixture: responsibilities, "
        "which is told the mixture. One process noise for all. A6 asks which fixed α is best; here the α that the "
        "filter finds must lie in 0.05 to 0.1, and its errors below those of every fixed α.",
        "claim",
        (Column("verdict", numeric=False), Column("found", numeric=False), Column("runs")),
        tuple(rows),
    )
