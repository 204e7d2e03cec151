"""Tables and requirements of results with several sensors, against numbers worked out from the stored ones."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from relnav_sim.plots.facts import CaseFacts, case_facts
from relnav_sim.report.case_tables import consistency_table, reliability_table
from relnav_sim.report.latex import latex
from relnav_sim.report.layouts import case_table
from relnav_sim.report.metrics import NIS, NIS_PER_DOF, nis_metric
from relnav_sim.report.overview import overview_table
from relnav_sim.report.ranking import rank
from relnav_sim.report.requirements import judgements, requirement_in_words, requirements_table
from relnav_sim.report.tables import Table, comma_separated, markdown
from relnav_sim.report.write import write_report
from relnav_sim.results import open_results
from relnav_sim.statistics.requirements import Judgement

ResultMaker = Callable[..., Path]
RUNS = 12


@pytest.fixture(scope="module")
def result(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Path:
    rules = {
        "camera": {"kind": "nis", "sensor": "camera", "span": "whole"},
        "all": {"kind": "nis", "sigma_margin": 0.3},
        "radar": {"kind": "nis", "sensor": "radar"},
    }
    return invent(
        tmp_path_factory.mktemp("sensors"), filters={"ekf": 1.0, "bold": 1.5}, runs=RUNS, sensors=True,
        duration_s=600.0, settle_s=100.0, requirements=rules,
    )  # fmt: skip


@pytest.fixture(scope="module")
def case(result: Path) -> CaseFacts:
    with open_results(result) as results:
        return case_facts(results, 0)


def cells(table: Table, label: str, after: str = "") -> tuple:
    labels = [row.label for row in table.rows]
    return table.rows[labels.index(label, labels.index(after) if after else 0)].cells


def test_each_sensor_has_its_own_degrees_of_freedom(case: CaseFacts) -> None:
    table = consistency_table(case)
    item = case.filters[0]
    for sensor in ("camera", "lidar"):
        nis, dof = (item.of_sensor(sensor, name, "settled") for name in ("nis_sum", "dof_sum"))
        number = cells(table, f"NIS per degree of freedom, {sensor}")[0]
        assert (
            number.value == pytest.approx(nis.sum() / dof.sum(), rel=1e-12) and number.low < number.value < number.high
        )
        low, high = stats.chi2.ppf([0.025, 0.975], dof.sum()) / dof.sum()
        assert cells(table, f"95 % band if consistent, {sensor}")[0].text == f"[{low:.4g}, {high:.4g}]"
        assert low < number.value < high
    total = cells(table, "NIS per degree of freedom")[0].value
    assert total == pytest.approx(item.nis_sum[:, 1].sum() / item.dof[:, 1].sum(), rel=1e-12)
    low, high = stats.chi2.ppf([0.025, 0.975], item.dof[:, 1].sum()) / item.dof[:, 1].sum()
    assert (
        cells(table, "95 % band if consistent", after="NIS per degree of freedom")[0].text == f"[{low:.4g}, {high:.4g}]"
    )
    assert "1 per degree of freedom" in table.caption and "mean NIS" not in [row.label for row in table.rows]


def test_a_mixture_told_of_one_sensor_takes_only_its_band(case: CaseFacts) -> None:
    told = replace(case, filters=tuple(replace(item, mixture_sensors=("lidar",)) for item in case.filters))
    table = consistency_table(told)
    assert cells(table, "95 % band if consistent, lidar")[0].text == "\N{EN DASH}"
    assert cells(table, "95 % band if consistent, camera")[0].text.startswith("[0.9")


def test_availability_has_a_row_for_each_sensor(case: CaseFacts) -> None:
    table = reliability_table(case)
    epochs, item = case.filters[0].per_run("epochs", 1).sum(), case.filters[0]
    for sensor in ("camera", "lidar"):
        shown = cells(table, f"epochs with a measurement, {sensor}")[0].value
        assert shown == pytest.approx(100 * item.of_sensor(sensor, "updates", "settled").sum() / epochs)
    assert cells(table, "epochs with a measurement, camera")[0].shown == "56.2"
    assert "Epochs with a measurement" in table.caption


def test_the_tables_name_it_in_every_form(case: CaseFacts) -> None:
    assert nis_metric([case]) is NIS_PER_DOF
    overview = overview_table([rank(case)])
    assert "NIS per degree of freedom" in [column.label for column in overview.columns]
    assert "NIS per degree of freedom" in [row.label for row in case_table(case, "settled").rows]
    table = consistency_table(case)
    number = cells(table, "NIS per degree of freedom, camera")[0]
    assert f"& {number.shown}" in latex(table) and "NIS per degree of freedom, camera" in latex(table)
    assert f"| NIS per degree of freedom, camera | {number.shown}" in markdown(table).replace("|  |", "|")
    assert f"NIS per degree of freedom, camera,,{number.value!r}" in comma_separated(table).replace('"', "")


def test_one_sensor_without_an_outage_adds_nothing(make_result: ResultMaker) -> None:
    with open_results(make_result(runs=4, filters={"ekf": 1.0})) as results:
        bare = case_facts(results, 0)
    assert bare.dimension == 3 and nis_metric([bare]) is NIS
    labels = [row.label for row in (*consistency_table(bare).rows, *reliability_table(bare).rows)]
    assert "mean NIS" in labels and not [label for label in labels if "reading" in label or "degree" in label]
    assert "NIS: the dimension of the measurement, 3, and" in consistency_table(bare).caption


@pytest.mark.slow
def test_the_page_shows_both(result: Path, tmp_path: Path) -> None:
    said: list[str] = []
    write_report(result, tmp_path / "out", ("md",), say=said.append)
    text = (tmp_path / "out" / "report.md").read_text(encoding="utf-8")
    assert said == [] and (tmp_path / "out" / "figures" / "case_000_availability.png").exists()
    assert "camera: azimuth [rad], elevation [rad]; lidar: range [m]" in text.replace("\\", "")


def test_requirements_on_the_innovations(result: Path) -> None:
    with open_results(result) as results:
        found = {(item.name, item.filter): item for item in judgements(results)}
        by_sensor = results.by_sensor(0, "ekf")
        table = requirements_table(results, list(found.values()))
    assert [found["camera", name].verdict for name in ("ekf", "bold")] == ["pass", "fail"]
    assert [found["all", name].verdict for name in ("ekf", "bold")] == ["pass", "fail"]
    camera = found["camera", "ekf"]
    assert camera.finding is not None and camera.basis == "every measurement of camera"
    pooled = by_sensor.nis_sum[:, 0, 0].sum() / by_sensor.dof_sum[:, 0, 0].sum()
    assert camera.finding.figure.estimate == pytest.approx(pooled, rel=1e-12)
    radar: Judgement = found["radar", "ekf"]
    assert radar.finding is None and radar.verdict == "undecided" and radar.basis == "no measurement of radar"
    assert requirement_in_words(camera.requirement) == (
        "NIS per degree of freedom of camera between 0.81 and 1.21, whole run"
    )
    assert len(table.rows) == 6


def test_a_filter_that_counts_three_everywhere_has_the_dimension_three(make_result: ResultMaker) -> None:
    """Files of relnav 0.1: the mean NIS and its band are those of before."""
    with open_results(make_result(runs=4, filters={"ekf": 1.0})) as results:
        bare = case_facts(results, 0)
    updates = int(bare.filters[0].per_run("updates", 1).sum())
    low, high = stats.chi2.ppf([0.025, 0.975], 3 * updates) / updates
    shown = cells(consistency_table(bare), "95 % band if consistent", after="mean NIS")[0].text
    assert shown == f"[{low:.4g}, {high:.4g}]"
    np.testing.assert_allclose(bare.filters[0].nis_per_dof("settled"), bare.filters[0].nis[:, 1] / 3)
