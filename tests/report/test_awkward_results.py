"""Results that leave little to draw: every figure is made or says why not, and one that fails costs only itself."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from relnav_sim import plots
from relnav_sim.cli.app import app
from relnav_sim.plots import FigureError
from relnav_sim.report import FIGURE_KINDS, case_section, figure, write_report
from relnav_sim.results import open_results
from relnav_sim.results.block import ResultsError

ResultMaker = Callable[..., Path]
TWO = {"ekf": 1.0, "ukf": 1.1}
GRID = [{"sensors.radar.range_sigma_m": r, "sensors.radar.angle_sigma_deg": a} for r in (1.0, 2.0) for a in (0.1, 1.0)]
FOUR = {"labels": [f"case {n}" for n in range(4)], "variables": GRID, "runs": 2, "times": 9}
AWKWARD: dict[str, dict[str, Any]] = {
    "own truth in each run, range varies after settling": {"dispersed": True, "runs": 4, "failed": {"ekf": [1]}},
    "nothing is known": {"unknown": True, "runs": 3},
    "one stored epoch": {"times": 1, "runs": 3},
    "no error at all": {"filters": {"ekf": 0.0, "ukf": 0.0}, "runs": 3},
    "no cost": {"runs": 3, "summaries": {name: {"cpu_per_step": np.zeros(3)} for name in TWO}},
}
FURTHER: dict[str, dict[str, Any]] = {
    "one run": {"runs": 1, "dispersed": True},
    "one filter, one run": {"runs": 1, "filters": {"ekf": 1.0}},
    "every run failed": {"runs": 3, "dispersed": True, "failed": dict.fromkeys(TWO, range(3))},
    "one filter failed in every run": {"runs": 3, "failed": {"ekf": range(3)}},
    "no common run": {"runs": 4, "failed": {"ekf": [0, 1], "ukf": [2, 3]}},
    "no settling": {"runs": 3, "settle_s": 0.0},
    "settled at the last epoch": {"runs": 3, "times": 3, "settle_s": 6000.0},
    "never settled": {"runs": 3, "settle_s": 1e9},
    "two epochs": {"runs": 3, "times": 2},
    "a nanosecond": {"runs": 3, "times": 5, "settle_s": 0.0, "duration_s": 1e-9},
    "tiny errors": {"runs": 3, "filters": {"ekf": 1e-30}},
    "vast errors": {"runs": 3, "filters": {"ekf": 1e30, "ukf": 1.0}},
    "grid of failures": {**FOUR, "failed": dict.fromkeys(TWO, range(2))},
    "grid of unknowns": {**FOUR, "unknown": True},
    "grid with one case computed": {**FOUR, "computed_cases": 1},
    "sweep over 600 decades": {**FOUR, "variables": [{"x": x} for x in (1e-300, 1.0, 2.0, 1e300)]},
    "sweep below zero": {**FOUR, "variables": [{"x": x} for x in (-1.0, 0.0, 1.0, 1e300)]},
    "sweep of sections": {**FOUR, "variables": [{"x": x} for x in ({"k": 1}, {"k": 2, "j": 3}, [1, 2], "text")]},
    "nothing computed": {"computed_cases": 0},
}


def made(maker: ResultMaker, settings: dict[str, Any]) -> Path:
    return maker(**{"filters": TWO, "times": 13, **settings})


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param(settings, id=name, marks=[] if number == 1 else pytest.mark.slow)
        for number, (name, settings) in enumerate(AWKWARD.items())
    ],
)
def test_nothing_of_the_report_is_missing(
    make_result: ResultMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, settings: dict[str, Any]
) -> None:
    # Laid out but not painted, which the long check below does too.
    monkeypatch.setattr("relnav_sim.plots.style.png", lambda made: made.draw_without_rendering() or b"\x89PNG")
    said: list[str] = []
    write_report(made(make_result, settings), tmp_path / "out", say=said.append)
    assert said == []


@pytest.mark.slow
@pytest.mark.parametrize("settings", [*AWKWARD.values(), *FURTHER.values()], ids=[*AWKWARD, *FURTHER])
def test_every_kind_is_drawn_or_refused_in_words(
    make_result: ResultMaker, tmp_path: Path, settings: dict[str, Any]
) -> None:
    path = made(make_result, settings)
    said: list[str] = []
    write_report(path, tmp_path / "out", ("html", "md", "csv", "latex"), say=said.append)
    assert said == []
    with open_results(path) as results:
        for kind in FIGURE_KINDS:
            try:
                figure(results, kind).canvas.draw()
            except (FigureError, ResultsError) as refusal:
                assert str(refusal)


def test_errors_against_range_are_those_of_each_runs_own_truth(make_result: ResultMaker) -> None:
    """Run r at epoch t is at |12000 + 100 r - 1.9 t| m; every point lies at the RMS of the errors in its bin."""
    path = made(make_result, AWKWARD["own truth in each run, range varies after settling"] | {"times": 61})
    with open_results(path) as results:
        (line, *_) = figure(results, "range", filter="ekf").axes[0].lines
        errors = np.linalg.norm(results.error(0, "ekf")[[0, 2, 3]][..., :3], axis=-1)
        times = results.time_s(0)
    late = times >= 500.0
    ranges = np.abs(12000 + 100 * np.array([[0.0], [2.0], [3.0]]) - 1.9 * times[late])
    edges = np.geomspace(ranges.min(), ranges.max() * (1 + 1e-12), len(line.get_ydata()) + 1)
    which = np.digitize(ranges, edges) - 1
    expected = [np.sqrt(np.mean(errors[:, late][which == place] ** 2)) for place in range(len(edges) - 1)]
    filled = np.array([np.sum(which == place) >= 5 for place in range(len(edges) - 1)])
    np.testing.assert_allclose(np.asarray(line.get_ydata())[filled], np.array(expected)[filled], rtol=1e-5)
    assert filled.sum() > 5


@pytest.mark.slow
def test_a_figure_that_fails_costs_only_itself(
    make_result: ResultMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = made(make_result, {"runs": 3})
    out = tmp_path / "out"
    (out / "figures").mkdir(parents=True)
    for form in ("png", "pdf"):
        (out / "figures" / f"case_000_boxes.{form}").write_bytes(b"of an earlier report")

    def failing(*_: Any) -> None:
        raise ZeroDivisionError("not \x1b[31m today <b>")

    monkeypatch.setattr(plots, "box_plots", failing)
    monkeypatch.setattr(case_section.layouts, "case_table", failing)
    done = CliRunner().invoke(app, ["report", str(path), "--out", str(out)])
    assert done.exit_code == 0
    reason = "could not be made: ZeroDivisionError: not \\x1b[31m today <b>"
    figure_line, table_line = f"The figure case_000_boxes {reason}", f"The table of errors {reason}"
    assert figure_line in done.stderr.splitlines()
    assert f"Case 0: {table_line}" in done.stderr.splitlines()
    html = (out / "index.html").read_text(encoding="utf-8")
    for line in (figure_line, table_line):
        assert line.replace("<", "&lt;").replace(">", "&gt;") in html
        assert line.partition(":")[0].replace("_", "\\_") in (out / "report.md").read_text(encoding="utf-8")
    assert "figures/case_000_boxes.png" not in html
    held = {file.name for file in (out / "figures").iterdir()}
    assert {"case_000_rms.png", "case_000_consistency.png"} <= held
    assert not {"case_000_boxes.png", "case_000_boxes.pdf"} & held, "the earlier report's would pass for this one's"


@pytest.mark.usefixtures("unrendered")
def test_damage_still_ends_the_report(
    make_result: ResultMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = made(make_result, {"runs": 3})

    def damaged(*_: Any) -> None:
        raise ResultsError("the file is damaged")

    monkeypatch.setattr(plots, "box_plots", damaged)
    assert CliRunner().invoke(app, ["report", str(path), "--out", str(tmp_path / "out")]).exit_code == 3
