"""Figures of results with several sensors, compared with the stored numbers."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2
from sensors_result import OUT

from relnav_sim.plots import FIGURE_KINDS, FigureError, figure
from relnav_sim.plots.availability import availability, has_outage
from relnav_sim.plots.conditions import events_of
from relnav_sim.plots.facts import case_facts
from relnav_sim.results import open_results
from relnav_sim.results.read import Results

ResultMaker = Callable[..., Path]
RUNS = 6


@pytest.fixture(scope="module")
def results(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    path = invent(
        tmp_path_factory.mktemp("sensors"), filters={"ekf": 1.0}, runs=RUNS, sensors=True, duration_s=600.0,
        settle_s=100.0,
    )  # fmt: skip
    with open_results(path) as opened:
        yield opened


def test_the_nis_of_each_sensor_per_degree_of_freedom(results: Results) -> None:
    drawn = figure(results, "nis")
    assert [panel.get_title(loc="left") for panel in drawn.axes] == ["", "camera", "lidar"]
    assert {panel.get_ylabel() for panel in drawn.axes} == {"NIS / dof [-]"}
    found = results.by_sensor(0, "ekf")
    for place, panel in enumerate(drawn.axes[1:]):
        dof = found.dof[..., place].sum(axis=0)
        read = np.flatnonzero(dof > 0)
        expected = np.nansum(found.nis[:, read, place], axis=0) / dof[read]
        line = np.asarray(panel.lines[0].get_ydata(), dtype=float)
        np.testing.assert_allclose(line[np.isfinite(line)], expected, rtol=1e-5)
        outline = panel.collections[0].get_paths()[0].vertices
        at = results.time_s(0)[read[1]]
        high = chi2.ppf(0.975, dof[read[1]]) / dof[read[1]]
        assert np.isclose(outline, [at, high]).all(axis=1).any()
    # The lidar is stored at every fourth epoch, and a line joins its points; the camera's is broken by the outage.
    camera, lidar = (np.asarray(panel.lines[0].get_ydata(), dtype=float) for panel in drawn.axes[1:])
    assert np.isfinite(lidar).all() and np.isnan(camera).any()


def test_readings_between_others_are_drawn_as_points(results: Results) -> None:
    """While the camera is out, the sum over the sensors has single epochs with a lidar reading."""
    panel = figure(results, "nis").axes[0]
    times = np.asarray(panel.lines[1].get_xdata(), dtype=float)
    assert len(times) and ((times >= OUT[0]) & (times < OUT[1])).all()


def test_availability_is_the_share_of_runs_with_readings(results: Results) -> None:
    facts = case_facts(results, 0)
    shares = availability(facts.filters)
    times_s = results.time_s(0)
    # A stored epoch stands for those since the one before, so the camera is back at the first after the outage's end.
    out = (times_s > OUT[0]) & (times_s < OUT[1])
    np.testing.assert_array_equal(shares["camera"][~out], 1.0)
    np.testing.assert_array_equal(shares["camera"][out], 0.0)
    assert (shares["lidar"] == 1).all() and has_outage(facts)
    drawn = figure(results, "availability")
    assert [panel.get_title(loc="left") for panel in drawn.axes] == ["camera", "lidar"]
    (shaded,) = [patch for patch in drawn.axes[0].patches if patch.get_width() > 0]
    assert shaded.get_x() == pytest.approx(OUT[0], abs=1e-9) and shaded.get_x() + shaded.get_width() <= OUT[1]
    assert not drawn.axes[1].patches
    words = FIGURE_KINDS["availability"].in_words(facts)
    assert "camera 6" in words.alt and "lidar 100 %" in words.alt


def test_events_are_told_by_sensor(results: Results) -> None:
    facts = case_facts(results, 0)
    found = {kind: rows.tolist() for kind, rows in events_of(results, facts, facts.filters[0]).items()}
    first = int(np.searchsorted(results.time_s(0), OUT[0], side="right"))
    back = int(np.searchsorted(results.time_s(0), OUT[1], side="left"))
    assert found["outage of camera"] == [[run, first] for run in range(RUNS)]
    assert found["acquisition of camera"] == [[run, back] for run in range(RUNS)]
    assert found["outage of lidar"] == found["acquisition of lidar"] == found["manoeuvre"] == []
    drawn = figure(results, "events")
    assert [panel.get_title(loc="left") for panel in drawn.axes] == [
        f"{kind} of camera ({RUNS} in all runs)" for kind in ("outage", "acquisition")
    ]


def test_a_sensor_read_less_often_than_is_stored_has_no_outages(results: Results, monkeypatch) -> None:
    found = results.by_sensor(0, "ekf")
    found.readings[...] = 0
    found.readings[:, 3::3, 0] = 1
    found.readings[:2, 30:40, 0] = 0
    monkeypatch.setattr(Results, "by_sensor", lambda self, case, filter: found)
    share = availability(case_facts(results, 0).filters)["camera"]
    assert (share[:30] == 1).all() and share[34] == pytest.approx(4 / 6) and share[-1] == 1


def test_a_period_that_stored_epochs_do_not_divide_is_no_row_of_outages(results: Results, monkeypatch) -> None:
    """Every 60 s, stored every 25 s: gaps of 2, 2 and 3 stored epochs in turn, and a real outage of 300 s."""
    times_s = 25.0 * np.arange(len(results.time_s(0)))
    found, measured_s = results.by_sensor(0, "ekf"), np.arange(60.0, times_s[-1] + 1, 60.0)
    measured_s = measured_s[(measured_s < 600) | (measured_s >= 900)]
    found.readings[..., 0] = np.histogram(measured_s, np.concatenate([[-25.0], times_s]) + 1e-6)[0]
    monkeypatch.setattr(Results, "by_sensor", lambda self, case, filter: found)
    monkeypatch.setattr(Results, "time_s", lambda self, case: times_s)
    content = {**results.campaign_content, "sensors": {"camera": {"period_s": 60.0}, "lidar": {"period_s": 10.0}}}
    monkeypatch.setattr(results, "campaign_content", content)
    facts = case_facts(results, 0)
    out = (times_s > 540 + 3 * 25) & (times_s < 900)  # seen after the stored epochs that a period can span
    np.testing.assert_array_equal(availability(facts.filters)["camera"], np.where(out, 0.0, 1.0))
    events = {kind: len(rows) for kind, rows in events_of(results, facts, facts.filters[0]).items()}
    assert (events["outage of camera"], events["acquisition of camera"]) == (RUNS, RUNS)


def test_fixed_outages_of_a_receiver_are_bars_of_the_scenario(results: Results, monkeypatch) -> None:
    windows = [[150.0, 300.0], [450.0, 600.0]]
    gnss = {"kind": "gnss", "noise": [{"kind": "gaussian"}, {"kind": "outage", "windows_s": windows}]}
    content = {**results.campaign_content, "sensors": {"camera": {}, "lidar": {}, "gnss": gnss, "star_tracker": {}}}
    monkeypatch.setattr(results, "campaign_content", content)
    facts = case_facts(results, 0)
    assert facts.own_outages == {"gnss": ((150.0, 300.0), (450.0, 600.0))}
    panel = figure(results, "scenario").axes[3]  # behind the three planes
    assert [label.get_text() for label in panel.get_yticklabels()] == ["camera", "lidar", "gnss"]
    corners = [np.asarray(path.vertices)[:, 0] for path in panel.collections[-1].get_paths()]
    spans = [(float(each.min()), float(each.max())) for each in corners]
    step_s = float(results.time_s(0)[1])
    assert spans[0] == pytest.approx((0.0, 150.0), abs=step_s) and spans[1] == pytest.approx((300.0, 450.0), abs=step_s)
    assert "Of gnss: outside of fixed outages" in FIGURE_KINDS["scenario"].in_words(facts, np.ones(3)).caption


def test_without_sensors_it_says_so(invent: ResultMaker, tmp_path: Path) -> None:
    with (
        open_results(invent(tmp_path, runs=3)) as bare,
        pytest.raises(FigureError, match="does not distinguish sensors"),
    ):
        figure(bare, "availability")
