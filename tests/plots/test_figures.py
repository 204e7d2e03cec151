from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from relnav_sim import plots as figures
from relnav_sim.plots.coinciding import coinciding
from relnav_sim.plots.facts import case_facts
from relnav_sim.plots.spare_figures import draw_over
from relnav_sim.plots.style import WIDTH_INCH, pdf, png, shown_name
from relnav_sim.results import open_results, seal
from relnav_sim.results.read import Results

ResultMaker = Callable[..., Path]


@pytest.fixture(scope="module")
def results(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    with open_results(
        invent(tmp_path_factory.mktemp("figures"), labels=("a=1", "a=2"), runs=9, failed={"ekf": [4]})
    ) as opened:
        yield opened


def test_the_envelope_is_what_the_filter_claims(results: Results) -> None:
    figure = figures.errors_with_envelope(results, 0, "ekf")
    ok = np.arange(9) != 4
    claimed = 3 * np.sqrt(np.mean(results.sigma(0, "ekf")[ok, :, 2] ** 2, axis=0))
    upper, lower, _ = figure.axes[4].lines  # third row, first column: z
    np.testing.assert_allclose(upper.get_ydata(), claimed)
    np.testing.assert_allclose(lower.get_ydata(), -claimed)


def test_the_line_is_the_run_with_the_median_error(results: Results) -> None:
    figure = figures.errors_with_envelope(results, 0, "ekf")
    ok = np.flatnonzero(np.arange(9) != 4)
    sizes = results.statistic(0, "ekf", "rms")[ok, 1, 6]
    median = ok[np.argsort(sizes)[3]]  # the lower of the two in the middle of 8
    np.testing.assert_allclose(figure.axes[0].lines[2].get_ydata(), results.error(0, "ekf")[median, :, 0])
    assert figure.legends[0].get_texts()[2].get_text() == f"run {median}"


def test_the_band_is_mean_and_three_standard_deviations_of_the_completed_runs(results: Results) -> None:
    figure = figures.errors_with_envelope(results, 0, "ekf")
    errors = results.error(0, "ekf")[np.arange(9) != 4, :, 1]
    top = errors.mean(axis=0) + 3 * errors.std(axis=0, ddof=1)
    outline = figure.axes[2].collections[0].get_paths()[0].vertices
    for time, height in zip(results.time_s(0)[::10], top[::10], strict=True):
        assert np.isclose(outline, [time, height], rtol=1e-9).all(axis=1).any()


def test_shi2025_axes_turn_the_panels(results: Results) -> None:
    rtn = figures.errors_with_envelope(results, 0, "kf")
    shi = figures.errors_with_envelope(results, 0, "kf", axes="shi2025")
    y_of_rtn, z_of_rtn = (np.asarray(rtn.axes[place].lines[2].get_ydata()) for place in (2, 4))
    np.testing.assert_allclose(shi.axes[0].lines[2].get_ydata(), y_of_rtn)
    np.testing.assert_allclose(shi.axes[2].lines[2].get_ydata(), -z_of_rtn)
    assert shi.axes[4].get_title(loc="left") == "nadir"


def test_rms_over_time_is_over_runs(results: Results) -> None:
    figure = figures.rms_over_time(results, "a=1")
    errors = results.error(0, "ekf")[np.arange(9) != 4, :, :3]
    expected = np.sqrt(np.mean(np.sum(errors**2, axis=2), axis=0))
    np.testing.assert_allclose(figure.axes[0].lines[2].get_ydata(), expected)
    assert figure.axes[0].get_yscale() == "log"


def test_boxes_show_the_completed_runs(results: Results) -> None:
    figure = figures.box_plots(results, 1)
    (dots,) = [line for line in figure.axes[0].lines if line.get_marker() == "."]
    rows = np.round(np.asarray(dots.get_ydata())).astype(int)
    assert sorted(np.bincount(rows)) == [8, 9, 9]


def test_every_axis_names_its_unit_and_figures_are_half_a_column_wide(results: Results) -> None:
    drawn = [
        figures.errors_with_envelope(results, 0, "kf"),
        figures.rms_over_time(results, 0),
        figures.box_plots(results, 0),
        figures.accuracy_by_case(results, [0, 1]),
    ]
    for figure in drawn:
        assert figure.get_figwidth() == WIDTH_INCH
        labels = [label for panel in figure.axes for label in (panel.get_xlabel(), panel.get_ylabel()) if label]
        assert labels
        assert all("[" in label or label.partition(":")[0] == "case" for label in labels)


def test_accuracy_by_case_shows_the_mean_over_runs(results: Results) -> None:
    figure = figures.accuracy_by_case(results, [0, 1])
    kf = figure.axes[0].containers[0].lines[0]
    expected = [results.statistic(case, "kf", "rms")[:, 1, 6].mean() for case in (0, 1)]
    np.testing.assert_allclose(kf.get_ydata(), expected)


@pytest.mark.slow
def test_the_same_result_gives_the_same_bytes(results: Results) -> None:
    for form in (png, pdf):
        assert form(figures.box_plots(results, 0)) == form(figures.box_plots(results, 0))


def test_a_figure_drawn_over_another_has_the_pixels_of_a_new_one(make_result: ResultMaker) -> None:
    path = make_result(
        filters={"ekf": 1.0, "lost": 1.0, "u$k$f_with_a_long_name": 30.0}, runs=4, failed={"lost": [0, 1, 2, 3]}
    )
    with open_results(path) as results:
        over = figures.errors_with_envelope(results, 0, "ekf", own_bound=True)
        for name in ("u$k$f_with_a_long_name", "lost", "ekf"):
            new = png(figures.errors_with_envelope(results, 0, name))
            assert new != png(over)
            draw_over(over)
            drawn = figures.errors_with_envelope(results, 0, name)
            assert drawn is over and png(drawn) == new, name


_OVER_TIME_AND_RUNS = (
    figures.rms_over_time,
    figures.consistency_over_time,
    figures.box_plots,
    figures.cost_against_accuracy,
)


@pytest.mark.parametrize(
    "draw", [pytest.param(draw, marks=pytest.mark.slow if n else ()) for n, draw in enumerate(_OVER_TIME_AND_RUNS)]
)
def test_every_kind_drawn_over_has_the_pixels_of_a_new_one(make_result: ResultMaker, draw: Any) -> None:
    """Filters of one size leave axes linear, those of very different sizes make them logarithmic, and lost ones say so.

    A panel keeps nothing of what it showed before.
    """
    path = make_result(filters={"a": 1.0, "b": 1.1, "far": 90.0, "lost": 1.0}, runs=4, failed={"lost": [0, 1, 2, 3]})
    with open_results(path) as results:
        over = draw(results, 0, ["a", "b"])
        png(over)
        for names in (["a", "far"], ["lost"], ["a", "b", "far"], ["b"]):
            new = png(draw(results, 0, names))
            draw_over(over)
            drawn = draw(results, 0, names)
            assert drawn is over and png(drawn) == new, names


def test_nothing_to_draw_is_said(make_result: ResultMaker) -> None:
    with open_results(make_result(filters={"ekf": 1.0}, runs=2, failed={"ekf": [0, 1]})) as results:
        for figure in (
            figures.errors_with_envelope(results, 0, "ekf"),
            figures.rms_over_time(results, 0),
            figures.box_plots(results, 0),
        ):
            assert png(figure).startswith(b"\x89PNG")
            assert any("failed" in text.get_text() or "no run" in text.get_text() for text in figure.axes[0].texts)


def test_a_run_without_error_is_no_crash(make_result: ResultMaker) -> None:
    with open_results(make_result(filters={"exact": 0.0}, runs=3)) as results:
        assert png(figures.rms_over_time(results, 0)).startswith(b"\x89PNG")
        assert png(figures.errors_with_envelope(results, 0, "exact")).startswith(b"\x89PNG")


def test_matplotlib_settings_are_left_alone(results: Results) -> None:
    import matplotlib

    before = matplotlib.rcParams.copy()
    png(figures.rms_over_time(results, 0))
    assert matplotlib.rcParams.copy() == before


def test_a_dollar_sign_is_no_formula() -> None:
    assert shown_name("a$b$c") == r"a\$b\$c"
    assert shown_name("x" * 30) == "x" * 21 + "…"


def test_filters_with_the_same_numbers_share_a_line(invent: ResultMaker, tmp_path: Path) -> None:
    path = invent(tmp_path, runs=3)
    with h5py.File(path, "r+") as file:
        del file.attrs[seal.ATTRIBUTE]  # of the numbers as they were
        for name, stored in file["case_000/ekf"].items():
            file[f"case_000/ukf/{name}"][...] = stored[...]
    with open_results(path) as results:
        assert [[item.name for item in group] for group in coinciding(case_facts(results, 0).filters)] == [
            ["kf"],
            ["ekf", "ukf"],
        ]
        figure = figures.rms_over_time(results, 0)
        names = [text.get_text() for text in figure.legends[0].get_texts()]
        assert names[:2] == ["kf", "ekf = ukf"]
        shapes = [line.get_marker() for line in figure.axes[0].lines if line.get_marker() != "None"]
        assert len(shapes) == len(set(shapes)) == 2
    with h5py.File(path, "r+") as file:
        file["case_000/ukf/rms"][1] *= 1 + 1e-5
    with open_results(path) as results:
        assert len(coinciding(case_facts(results, 0).filters)) == 3


def test_cases_stand_below_the_axis_by_number_and_name(results: Results, invent: ResultMaker, tmp_path: Path) -> None:
    panel = figures.accuracy_by_case(results).axes[0]
    assert panel.get_xlabel() == "case: a"
    assert [tick.get_text() for tick in panel.get_xticklabels()] == ["0: 1", "1: 2"]
    labels = [f"a={n}, b=1, c=long name {n}" for n in range(20)]
    with open_results(invent(tmp_path, labels=labels, filters={"ekf": 1.0}, runs=1, times=3)) as many:
        panel = figures.accuracy_by_case(many).axes[0]
        assert panel.get_xlabel() == "case: a, c"
        ticks = panel.get_xticklabels()
        assert [tick.get_text() for tick in ticks] == [f"{n}: {n}, long name {n}" for n in range(0, 20, 2)]
        assert all(tick.get_rotation() == 90 for tick in ticks)
    with open_results(invent(tmp_path, labels=["dusk", "noon"], filters={"ekf": 1.0}, runs=1, times=3)) as named:
        panel = figures.accuracy_by_case(named).axes[0]
        assert panel.get_xlabel() == "case"
        assert [tick.get_text() for tick in panel.get_xticklabels()] == ["0: dusk", "1: noon"]
