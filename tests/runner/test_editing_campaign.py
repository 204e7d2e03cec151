"""Campaigns whose filters edit readings: what they lose, what they recover from, and what they say of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.stats import binom

from relnav_sim import load_campaign, open_results, run_campaign
from relnav_sim.campaign import CampaignError
from relnav_sim.campaign.load import parse_campaign
from relnav_sim.plots.facts import case_facts
from relnav_sim.report.editing_table import editing_notes, editing_table
from relnav_sim.report.requirements import judgements
from relnav_sim.results.block import EDIT_ENDS

SHIPPED = Path(__file__).parents[2] / "campaigns" / "editing.yaml"
N, STEP_S = 5, 10.0
QUIET, STEPPED, FAULTY, STORM = range(4)


def shipped(**changes):
    text = yaml.safe_load(SHIPPED.read_text(encoding="utf-8"))
    return parse_campaign(yaml.safe_dump(text | changes))


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """The shipped campaign with few runs and filters, shortened to what shows its point."""
    text = yaml.safe_load(SHIPPED.read_text(encoding="utf-8"))
    text["runs"], text["clock"] = 6, {"duration_s": 1100, "step_s": 10, "store_every_s": 100}
    text["filters"] = {name: text["filters"][name] for name in ("unedited", "gate", "restart")}
    text["zip"] = {path: values[:3] for path, values in text["zip"].items()}
    text["zip"]["truth.manoeuvres"][STEPPED]["unannounced"]["time_s"] = 495
    text["zip"]["sensors.relative_gnss.noise"][FAULTY][1]["from_s"] = 500
    text["statistics"]["settle_s"] = 200
    text["requirements"] = {"back": {"kind": "recovery", "within_s": 60, "share": 0.5}}
    out = tmp_path_factory.mktemp("editing") / "editing.h5"
    run_campaign(parse_campaign(yaml.safe_dump(text)), out=out, workers=1, backend="sequential")
    with open_results(out) as results:
        yield results


def test_a_step_of_the_true_state_is_lost_by_the_gate_and_recovered_by_a_restart(result):
    gate, restart = (result.editing(STEPPED, name) for name in ("gate", "restart"))
    assert (gate.lost > 0).all() and not gate.recoveries.any()
    assert (gate.end == EDIT_ENDS.index("rejecting")).all() and (gate.lock_outs == 1).all()
    assert (restart.recoveries == 1).all() and (restart.recovery >= N * STEP_S).all()
    assert np.median(restart.recovery) == N * STEP_S  # k = 0: right away
    assert not restart.open[~np.isnan(restart.open)].size


def test_a_persistent_step_of_a_sensor_is_reported_and_never_called_recovered(result):
    for name in ("gate", "restart"):
        held = result.editing(FAULTY, name)
        assert (held.lock_outs.sum(axis=1) > 0).all()
        assert not held.recoveries.any() and np.isnan(held.recovery).all()
    assert (result.editing(FAULTY, "restart").end == EDIT_ENDS.index("adopted")).all()


def test_the_requirement_judges_recoveries(result):
    found = {(item.case, item.filter): item for item in judgements(result)}
    assert found[STEPPED, "restart"].verdict == "pass"
    for case, name in ((STEPPED, "gate"), (FAULTY, "gate"), (FAULTY, "restart")):
        assert found[case, name].verdict == "fail", (case, name)
    assert found[QUIET, "restart"].basis == "no run was locked out or diverged"
    assert found[STEPPED, "unedited"].basis == "the filter edits no measurement"


def test_the_report_says_who_adopted_a_fault(result):
    facts = [case_facts(result, case) for case in range(3)]
    table = editing_table(facts[FAULTY])
    rows = {row.label: row for row in table.rows}
    places = {column.label: place for place, column in enumerate(table.columns)}
    adopted = rows["ends off the truth, fault adopted"].cells
    assert adopted[places["restart"]].value == 100 and np.isnan(adopted[places["unedited"]].value)
    assert rows["runs recovered"].cells[places["restart"]].value == 0
    assert rows["rejected if the filter is right"].cells[places["gate"]].value == pytest.approx(0.1)
    assert any("restart in 6 of 6 runs" in note and "adopted" in note for note in editing_notes(facts[FAULTY]))
    assert not editing_notes(facts[QUIET])


def test_the_summary_has_its_counts(result):
    summary = result.summary()
    rows = (summary["case"] == STEPPED) & (summary["filter"] == "restart")
    assert np.array_equal(summary["edit_lock_outs_relative_gnss"][rows], np.ones(6))
    assert np.array_equal(summary["edit_recovery_s"][rows], result.editing(STEPPED, "restart").recovery)
    assert (summary["edit_tests_relative_gnss"][rows] == 110).all()
    assert np.isnan(summary["edit_lost"][summary["filter"] == "unedited"]).all()


def small(**entry):
    text = yaml.safe_load(SHIPPED.read_text(encoding="utf-8"))
    text["filters"] = {"one": {"kind": "ekf"} | entry}
    text.pop("zip")
    return text


def test_without_editing_nothing_of_it_is_stored_or_hashed(tmp_path):
    text = small()
    text["filters"]["gated"] = {"kind": "ekf", "gate_probability": 0.999}
    text["clock"], text["runs"] = {"duration_s": 100, "step_s": 10, "store_every_s": 50}, 2
    text["statistics"] = {"settle_s": 50}
    made = parse_campaign(yaml.safe_dump(text))
    out = run_campaign(made, out=tmp_path / "plain.h5", workers=1, backend="sequential")
    with open_results(out) as results:
        assert results.editing(0, "one") is results.editing(0, "gated") is None
        assert not [name for name in results.summary() if name.startswith("edit_")]
        assert "rejected" in results.diagnostics(0, "gated") and not results.diagnostics(0, "one")
    assert parse_campaign(yaml.safe_dump(small(editing=None))).hash == (parse_campaign(yaml.safe_dump(small())).hash)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"kind": "imm", "editing": {"probability": 0.99}}, "filters.one.editing: the imm filter has no editing"),
        ({"editing": {"probability": 0.99}, "gate_probability": 0.9}, "is the former name of editing.probability"),
        ({"editing": {"probability": 99}}, "less than 1"),
        ({"editing": {"probability": 0.99, "action": "restart"}, "sensors": ["camera"]}, "no fix to restart from"),
        ({"editing": {"probability": 0.99, "inflation": 3}}, "inflation needs action: inflate"),
        (
            {"editing": {"probability": 0.99, "scope": "channel"}, "measurement": "cartesian", "sensors": ["radar"]},
            "takes radar converted to a position, which counts as a whole",
        ),
        ({"kind": "ukf", "underweighting": {"above_m": 10}}, "underweighting"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(entry, said):
    text = small(**entry)
    text["sensors"] |= {
        "camera": {"angle_sigma_deg": 0.01, "host": "chief"},
        "radar": {"range_sigma_m": 1, "angle_sigma_deg": 0.1, "host": "chief"},
        "star_tracker": {"cross_boresight_sigma_arcsec": 10, "about_boresight_sigma_arcsec": 30},
    }
    with pytest.raises(CampaignError, match=said):
        parse_campaign(yaml.safe_dump(text))


@pytest.mark.slow
def test_the_shipped_campaign_shows_what_its_page_says(tmp_path):
    """docs/editing.md: 200 runs a case."""
    out = run_campaign(load_campaign(SHIPPED), out=tmp_path / "editing.h5", workers=1, backend="sequential")
    with open_results(out) as results:
        for name in ("gate", "by_channel"):  # false rejections: two-sided 99.9 % binomial interval
            held = results.editing(QUIET, name)
            tests, rejected = int(held.tests[:, 0].sum()), int(held.rejected[:, 0].sum())
            low, high = binom.ppf([0.0005, 0.9995], tests, 0.001)
            assert low <= rejected <= high, (name, rejected, low, high)
        lost = results.editing(STEPPED, "gate").lost > 0
        assert len(lost) == 200 and lost.mean() > 0.9
        for name, k in (("restart", 0), ("by_channel", 0), ("inflate", 5)):
            held = results.editing(STEPPED, name)
            assert (held.recovery <= (N + k) * STEP_S).mean() > 0.9, name
        for name in ("gate", "accept", "inflate", "restart", "by_channel"):
            held = results.editing(FAULTY, name)
            assert (held.lock_outs.sum(axis=1) > 0).all() and not held.recoveries.any()
