"""The error budget in a report: computed from the campaign that the result holds, beside its runs."""

import pytest
from invented_results import invented_result
from typer.testing import CliRunner

from relnav_sim.cli.app import app
from relnav_sim.plots.facts import case_facts
from relnav_sim.report.case_section import compose_case
from relnav_sim.report.drawing import FigureFolder
from relnav_sim.report.error_budget import budget_section
from relnav_sim.report.opened import Opened
from relnav_sim.results import open_results

TEXT = """
name: budgeted
seed: 7
runs: 12
clock: {duration_s: 60, step_s: 1, store_every_s: 5}
truth:
  chief: {orbit: {a_km: 6878, e: 0.001, i_deg: 51.6, raan_deg: 30, argp_deg: 0, ta_deg: 40}, mass_kg: 200, area_m2: 1}
  deputy: {relative: {position_m: [0, -2000, 100], velocity_m_s: [0, 0, 0]}, mass_kg: 100, area_m2: 1}
sensors:
  radar: {range_sigma_m: 2, angle_sigma_deg: 0.1}
  gnss: {position_sigma_m: 10, velocity_sigma_m_s: 0.1}
start: {kind: first_fix, velocity_sigma_m_s: 0.5}
filters:
  huber: {kind: huber, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}
  ekf: {kind: ekf, process_noise: {acceleration_psd_m2_s3: 1.0e-6}}
statistics: {settle_s: 20}
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("budget")
    campaign, path = folder / "budgeted.yaml", folder / "budgeted.h5"
    campaign.write_text(TEXT, encoding="utf-8")
    done = CliRunner().invoke(app, ["run", str(campaign), "--out", str(path), "--backend", "sequential"])
    assert done.exit_code == 0, done.output
    return path


def test_the_best_filter_that_has_one_gets_its_budget_beside_its_runs(result):
    with open_results(result) as results:
        found = budget_section(results, case_facts(results, 0, "rtn"), ["huber", "ekf"])
        assert budget_section(results, case_facts(results, 0, "rtn"), ["huber"]) == (
            "No error budget: the gain of every filter depends on the measurements."
        )
    assert found.note.startswith("Error budget of ekf: position error of 12 runs") and "linear here" in found.note
    by_source, by_phase = found.tables
    assert [column.label for column in by_phase.columns] == ["steady state, 20 s", "end, 60 s"]
    assert {row.label for row in by_source.rows} >= {"radar range noise", "unmodelled acceleration", "total", "formal"}
    assert len(found.curves.actual[0]) == 13 and (found.curves.total > 0).all()
    assert sum(found.curves.shares.values()) == pytest.approx(1, rel=1e-10)


def test_a_campaign_that_cannot_be_run_again_has_none_and_says_why(tmp_path):
    path = invented_result(tmp_path)
    with open_results(path) as results:
        said = budget_section(results, case_facts(results, 0, "rtn"), results.filters)
    assert said.startswith("No error budget: its campaign can't be run again: ") and str(tmp_path) not in said


def test_a_case_has_its_tables_without_figures_too_and_names_the_command_where_there_are_too_many_cases(
    result, tmp_path
):
    def section(budgeted):
        return compose_case(
            Opened(open_results(result)), 0, "rtn", FigureFolder(tmp_path, vectors=False), False, 50, False, budgeted
        )[1]

    with_budget, without = section(True), section(False)
    titles = [table.title for table in with_budget.more_tables]
    assert titles[-2:] == ["Error budget of ekf", "Error budget of ekf by phase"] and with_budget.pictures == ()
    assert any(note.startswith("Error budget of ekf: ") for note in with_budget.notes)
    assert without.more_tables == with_budget.more_tables[:-2]
    assert any("relnav budget CAMPAIGN --case 0 --result budgeted.h5" in note for note in without.notes)


def test_a_run_of_too_many_epochs_for_the_memory_gets_the_command(result, monkeypatch):
    monkeypatch.setattr("relnav_sim.report.error_budget.MOST_EPOCHS", 10)
    with open_results(result) as results:
        said = budget_section(results, case_facts(results, 0, "rtn"), ["ekf"])
    assert said.startswith("No error budget of this case, because a run has more than 10 epochs; it is: relnav budget")
