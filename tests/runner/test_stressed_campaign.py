"""`relnav run --stress`: stressed cases extend a result and leave everything in it as it was."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from small_campaign import TEXT, data_of
from typer.testing import CliRunner

from relnav_sim import open_results, regret, run_campaign
from relnav_sim.campaign.load import load_campaign, parse_campaign
from relnav_sim.cli.app import app
from relnav_sim.report import write_report
from relnav_sim.report.campaign_facts import headline_facts
from relnav_sim.report.drawing import FigureFolder
from relnav_sim.report.regret import in_sentences, regret_section
from relnav_sim.report.tables import comma_separated
from relnav_sim.results import layout
from relnav_sim.results.block import RefusedError
from relnav_sim.results.stored_campaign import stored_campaign
from relnav_sim.runner.merging import merge_results
from relnav_sim.runner.single import run_single

ROOT = Path(__file__).parents[2]
STRESS = "stress:\n  noisy: {sensors.radar.range_sigma_m: {times: 3}}\n  heavy: {truth.chief.mass_kg: {times: 0.01}}\n"


def campaign(*overrides, stress=STRESS):
    return parse_campaign(TEXT + stress, ("runs=4", "block_runs=4", *overrides))


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """The result without stressed cases, what it held, and the same result with them."""
    path = tmp_path_factory.mktemp("stressed") / "small.h5"
    run_campaign(campaign(stress=""), path, backend="sequential")
    before = data_of(path)
    said = []
    run_campaign(campaign().with_stress(), path, backend="sequential", say=said.append)
    return path, before, said


def test_they_extend_the_result_of_the_campaign_without_a_stress(out):
    path, before, said = out
    assert "2 finished blocks found; 4 left to compute" in said
    after = data_of(path)
    for key, array in before.items():
        assert array.tobytes() == after[key].tobytes(), key
    with open_results(path) as results:
        assert results.nominal == (0, 1) and results.stressed(1) == {"noisy": 4, "heavy": 5}
        assert [header.stress for header in results.headers] == ["", "", "noisy", "heavy", "noisy", "heavy"]
        assert results.stressed(2) == {} and results.header.cases[4].nominal == results.headers[1].id
        assert results.bound(0) is not None and results.bound(2) is None
        assert set(results.summary()["stress"]) == {"", "noisy", "heavy"}
        assert not results.missing()
        again = stored_campaign(results)
        assert [case.id for case in again.cases] == [header.id for header in results.headers]
        alone = regret(results, 1)
        assert alone.cases == ("nominal", "noisy", "heavy") and alone.indices == (1, 4, 5)
        with pytest.raises(RefusedError, match="has no stressed cases"):
            regret(results, 4)


def test_one_run_of_a_stressed_case_is_that_of_the_campaign(out, tmp_path):
    path, _, _ = out
    made = campaign().with_stress()
    one = run_single(
        made, "sensors.radar.noise.kind=gaussian, stress=heavy", 2, tmp_path / "one.h5", backend="sequential"
    )
    with open_results(path) as whole, open_results(one) as single:
        assert single.headers[0].stress == "heavy" and single.nominal == (0,)
        np.testing.assert_array_equal(single.error(0, "ekf")[0], whole.error(3, "ekf")[2])
        assert [case.stress for case in stored_campaign(single).cases] == ["heavy"]
    with pytest.raises(RefusedError, match="add --stress"):
        run_single(campaign(), made.cases[2].id, 0, tmp_path / "two.h5", backend="sequential")


@pytest.mark.slow
def test_parts_with_stressed_cases_are_merged(out, tmp_path):
    path, _, _ = out
    made = campaign("block_runs=2").with_stress()
    for number in (1, 2):
        run_campaign(made, tmp_path / f"{number}.h5", backend="sequential", part=(number, 2))
    merged = data_of(merge_results(tmp_path / "whole.h5", [tmp_path / "1.h5", tmp_path / "2.h5"]))
    for key, array in data_of(path).items():
        assert array.tobytes() == merged[key].tobytes(), key


def test_the_section_on_regret_holds_the_numbers(out, tmp_path):
    path, _, _ = out
    with open_results(path) as results:
        found = regret(results, 0)
        section = regret_section(results, FigureFolder(tmp_path, vectors=False))
        assert headline_facts(results)[1:3] == ("2 cases", "4 stressed cases")
    assert section.missing == () and [picture.missing for picture in section.pictures] == ["", ""]
    assert [table.name for table in section.tables] == [
        "stresses", "case_000_regret", "case_000_stressed_rms", "case_001_regret", "case_001_stressed_rms",
    ]  # fmt: skip
    stresses, table = section.tables[:2]
    assert [(row.label, row.cells[0].text) for row in stresses.rows] == [
        ("noisy", "sensors.radar.range_sigma_m = {times: 3}"),
        ("heavy", "truth.chief.mass_kg = {times: 0.01}"),
    ]
    rows = [line.split(",") for line in comma_separated(table).splitlines()]
    assert rows[0][2:5] == ["nominal [%]", "nominal [%] low 95", "nominal [%] high 95"]
    for row, name in enumerate(found.filters):
        assert rows[1 + row][0] == name
        for place in range(3):
            shown = [float(cell) for cell in rows[1 + row][2 + 3 * place : 5 + 3 * place]]
            ends = [part[row, place] for part in (found.regret, found.low, found.high)]
            np.testing.assert_allclose(shown, 100 * np.array(ends))


@pytest.mark.slow
def test_the_report_keeps_all_but_the_section_on_regret_to_the_nominal_cases(out, tmp_path):
    path, _, _ = out
    shutil.copy(path, tmp_path / "small.h5")
    made = write_report(tmp_path / "small.h5", formats=("md", "html", "csv", "latex"), say=pytest.fail)
    assert '<section id="regret">' in made.read_text(encoding="utf-8")
    text = (tmp_path / "small" / "report.md").read_text(encoding="utf-8")
    overview = text[text.index("## Overview") : text.index("## Regret")]
    assert "stress" not in overview
    assert text[text.index("## Regret") : text.index("## Case 0")].count("](figures/case_00") == 2
    assert "Flown under the stress heavy, of which no filter is told" in text
    tables = tmp_path / "small" / "tables"
    assert (tables / "case_000_stressed_rms.tex").exists() and (tables / "stresses.csv").exists()


def test_rows_that_are_known_only_later_set_no_standard(tmp_path):
    """A smoother is nearer the truth than any filter in flight, and none to fly: regret leaves it out, and says so."""
    text = TEXT.partition("grid:")[0] + "  rts: {kind: ekf, smoother: rts}\n" + STRESS
    path = tmp_path / "later.h5"
    run_campaign(parse_campaign(text, ("runs=3", "bound=false")).with_stress(), path, backend="sequential")
    with open_results(path) as results:
        found = regret(results)
        smoothed, filtered = (
            results.statistic(0, name, "rms")[:, 1, layout.QUANTITIES.index("r")].mean() for name in ("rts", "ekf")
        )
    assert smoothed < filtered and found.filters == ("kf", "ekf") and found.known_later == ("rts",)
    assert (found.regret.min(axis=0) == 0).all()
    assert "Left out, because their estimates are known only later: rts." in in_sentences(found)


def test_the_command_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one = TEXT.partition("grid:")[0]
    (tmp_path / "plain.yaml").write_text(one, encoding="utf-8")
    (tmp_path / "small.yaml").write_text(one + STRESS, encoding="utf-8")
    refused = CliRunner().invoke(app, ["run", "plain.yaml", "--stress"])
    assert refused.exit_code == 2 and "has no section 'stress:'" in refused.output
    said = CliRunner().invoke(app, ["validate", "small.yaml"])
    assert said.exit_code == 0 and "stressed 2; relnav run --stress flies them too" in " ".join(said.output.split())
    assert "with --stress" in said.output
    arguments = ["run", "small.yaml", "--stress", "--runs", "1", "--backend", "sequential", "--set", "bound=false"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    with open_results(tmp_path / "results" / "small.h5") as results:
        assert results.cases == ("base", "stress=noisy", "stress=heavy")


@pytest.mark.slow
def test_the_shipped_campaign_shows_a_nominal_winner_that_loses(tmp_path):
    """Each filter whose model is the truth may be the best there; the nominal winner is not, in the real field."""
    made = load_campaign(ROOT / "campaigns" / "stress.yaml", ["runs=30"])
    with open_results(run_campaign(made.with_stress(), tmp_path / "stress.h5", workers=2)) as results:
        found = regret(results)
    assert found.nominal_winner == "ekf_quiet"
    assert found.of("ekf_quiet", "nominal").low == 0 and found.of("ekf_field", "real_field").low == 0
    assert found.of("ekf_quiet", "real_field").low > 0.2 and found.minimax != "ekf_quiet"
    assert any("ekf_quiet" in said and "loses under real_field" in said for said in in_sentences(found))
