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


def test_without_sensors_it_says_so(invent: ResultMaker, tmp_path: Path) -> None:
    with (
        open_results(invent(tmp_path, runs=3)) as bare,
        pytest.raises(FigureError, match="does not distinguish sensors"),
    ):
        figure(bare, "availability")
