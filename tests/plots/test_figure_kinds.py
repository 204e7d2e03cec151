"""Every kind of figure: made by one call, what it draws compared with the stored numbers, and documented."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from relnav_sim.plots import conditions
from relnav_sim.plots.choice import pareto_front
from relnav_sim.plots.data import drawn_step, window
from relnav_sim.plots.ellipses import ellipse
from relnav_sim.plots.facts import case_facts
from relnav_sim.plots.regret import drawn_regret
from relnav_sim.plots.start import start_span
from relnav_sim.plots.style import BOUND, PALETTE, WIDTH_INCH, line_styles, marker, write_figure
from relnav_sim.plots.sweep_points import grid_paths, trends
from relnav_sim.plots.sweeps import axis_label
from relnav_sim.report import FIGURE_KINDS, figure
from relnav_sim.results import layout, open_results
from relnav_sim.results.by_channel import ByChannel
from relnav_sim.results.observability import Observability
from relnav_sim.results.read import Results
from relnav_sim.statistics.regret import regret

ResultMaker = Callable[..., Path]
ROOT = Path(__file__).parents[2]
GRID = [{"sensors.radar.range_sigma_m": r, "sensors.radar.angle_sigma_deg": a} for r in (1.0, 2.0) for a in (0.1, 1.0)]
RUNS = 9
OK = np.arange(RUNS) != 4


@pytest.fixture(scope="module")
def results(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    """Two by two cases, three filters, one failed run of the ekf."""
    path = invent(
        tmp_path_factory.mktemp("kinds"),
        labels=[f"case {n}" for n in range(4)],
        variables=GRID,
        runs=RUNS,
        failed={"ekf": [4]},
    )
    with open_results(path) as opened:
        yield opened


@pytest.fixture
def bounded(results: Results, monkeypatch: pytest.MonkeyPatch) -> Results:
    """The same with a bound: 1 to 8 times 0.01 for x y z vx vy vz r v, half as much again for a filter's own."""
    levels = 0.01 * np.arange(1, 9)

    def bound(self: Results, case: int | str, filter: str | None = None) -> np.ndarray:
        return np.tile(levels * (1.5 if filter else 1.0), (len(self.time_s(case)), 1))

    def observability(self: Results, case: int | str, filter: str) -> Observability:
        ratio = np.linspace(1.0, 0.01, len(self.time_s(case)))
        return Observability(("radar",), ratio, layout.COMPONENTS, np.ones(6), np.ones(6), 0, "radial position")

    def by_channel(self: Results, case: int | str, filter: str) -> ByChannel:
        shape = len(self.case_runs(case, filter)), 2, 1
        product = np.zeros((*shape, len(layout.LAGS)))
        product[..., 0] = 1.0
        return ByChannel(("radar range",), np.full(shape, 500), np.zeros(shape), product)

    monkeypatch.setattr(Results, "bound", bound, raising=False)
    monkeypatch.setattr(Results, "observability", observability)
    monkeypatch.setattr(Results, "by_channel", by_channel)
    return results


@pytest.fixture(scope="module")
def sensed(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    """One case with two sensors, told apart."""
    path = invent(
        tmp_path_factory.mktemp("sensed"),
        filters={"ekf": 1.0, "ukf": 1.1},
        runs=RUNS,
        sensors=True,
        duration_s=600.0,
        settle_s=100.0,
    )
    with open_results(path) as opened:
        yield opened


@pytest.fixture(scope="module")
def stressed(invent: ResultMaker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Results]:
    """One case and the same under two stresses; the ekf fails a run in each."""
    path = invent(
        tmp_path_factory.mktemp("stressed"),
        labels=["base", "stress=noisy", "stress=heavy"],
        runs=RUNS,
        failed={"ekf": [4]},
        stresses=["noisy", "heavy"],
    )
    with open_results(path) as opened:
        yield opened


@pytest.mark.parametrize("kind", FIGURE_KINDS)
def test_one_call_draws_it_with_units_on_every_axis(
    bounded: Results, sensed: Results, stressed: Results, kind: str
) -> None:
    drawn = figure({"availability": sensed, "regret": stressed}.get(kind, bounded), kind)
    assert drawn.get_figwidth() == WIDTH_INCH
    drawn.draw_without_rendering()
    labels = [label for panel in drawn.axes for label in (panel.get_xlabel(), panel.get_ylabel()) if label]
    assert labels and all("[" in label or label.partition(":")[0] == "case" for label in labels)
    for legend in [*drawn.legends, *(panel.get_legend() for panel in drawn.axes if panel.get_legend())]:
        assert all(text.get_text() for text in legend.get_texts())
        assert len(legend.legend_handles) == len(legend.get_texts())


@pytest.mark.parametrize("kind", FIGURE_KINDS)
def test_the_documentation_names_it(kind: str) -> None:
    rows = [line for line in (ROOT / "docs" / "figures.md").read_text(encoding="utf-8").splitlines() if "|" in line]
    each = FIGURE_KINDS[kind]
    assert f"| `{kind}` | {each.shows} | {each.papers} |" in rows


def test_every_figure_type_of_the_papers_is_a_kind() -> None:
    papers = " ".join(kind.papers for kind in FIGURE_KINDS.values())
    for number in (3, 4, 5, 6, 10, 11, 12, 13, 14, 15):
        assert any(f" {number}" in kind.papers for kind in FIGURE_KINDS.values() if "Shi" in kind.papers), number
    assert "Figs. 7 to 9" in papers
    for number in (2, 3, 4):
        assert any(f"Wei, Song and Zhang 2012, Fig. {number}" in kind.papers for kind in FIGURE_KINDS.values())


def test_a_filter_has_one_colour_everywhere(results: Results) -> None:
    index = results.filters.index("ekf")
    for kind in ("rms", "covariance", "consistency", "position_error", "plane"):
        colours = {line.get_color() for line in figure(results, kind, filter="ekf").axes[0].lines}
        assert PALETTE[index] in colours and not colours & (set(PALETTE) - {PALETTE[index]}), kind
    alone = figure(results, "errors", filter="ekf").axes[0].lines
    assert PALETTE[index] in {line.get_color() for line in alone}


def test_points_of_no_two_filters_look_alike() -> None:
    names = [f"filter {number}" for number in range(20)]
    looks = {(line_styles(names)[name].colour, marker(names, name)) for name in names}
    assert len(looks) == len(names)


def test_a_wide_interval_leaves_the_regrets_to_see(stressed: Results) -> None:
    found = regret(stressed)
    wide = replace(found, high=np.full_like(found.high, 1e20))
    bottom, top = drawn_regret(wide, stressed.filters).axes[0].get_ylim()
    largest = 1 + found.regret[np.isfinite(found.regret)].max()
    assert 0 < bottom < 1 and largest < top < 12 * largest


def test_the_bound_is_drawn_where_it_is_stored(results: Results, bounded: Results) -> None:
    level = {"rms": 0.07, "cases": 0.07, "covariance": 0.01}
    for kind, expected in level.items():
        panel = figure(bounded, kind).axes[0]
        heights = [line.get_ydata() for line in panel.lines if line.get_color() == BOUND]
        heights += [path.vertices[:, 1] for found in panel.collections for path in found.get_paths()] * (
            kind == "cases"
        )
        assert any(np.allclose(np.asarray(height, dtype=float), expected) for height in heights), kind
    # That of the filter's own model all but coincides with its formal sigma: only where it is asked for.
    heights = {"-.": 0.03, ":": 0.045}
    for asked, dashes in ((False, ("-.",)), (True, ("-.", ":"))):
        drawn = figure(bounded, "errors", filter="kf", own_bound=asked).axes[0].lines
        bounds = [line for line in drawn if line.get_color() == BOUND]
        assert {line.get_linestyle() for line in bounds} == set(dashes)
        for line in bounds:
            assert np.allclose(np.abs(np.asarray(line.get_ydata())), heights[line.get_linestyle()])


def test_without_a_bound_nothing_is_said_of_it(results: Results) -> None:
    texts = [text.get_text() for legend in figure(results, "rms").legends for text in legend.get_texts()]
    assert "bound" not in texts or hasattr(Results, "bound")


def test_covariance_compares_sigma_with_error(results: Results) -> None:
    panel = figure(results, "covariance", filter="ekf").axes[2]  # second row, first column: y
    done, claimed = (np.asarray(line.get_ydata()) for line in panel.lines)
    np.testing.assert_allclose(done, np.sqrt(np.mean(results.error(0, "ekf")[OK, :, 1] ** 2, axis=0)))
    np.testing.assert_allclose(claimed, np.sqrt(np.mean(results.sigma(0, "ekf")[OK, :, 1] ** 2, axis=0)))


def test_nees_and_its_band(results: Results) -> None:
    panel = figure(results, "nees", filter="ekf").axes[0]
    np.testing.assert_allclose(
        np.asarray(panel.lines[0].get_ydata()), results.nees(0, "ekf")[OK].mean(axis=0) / 6, rtol=1e-6
    )
    heights = panel.collections[0].get_paths()[0].vertices[:, 1]
    runs = OK.sum()
    np.testing.assert_allclose(
        [heights.min(), heights.max()], chi2.ppf([0.025, 0.975], 6 * runs) / (6 * runs), rtol=1e-9
    )


def test_the_band_of_nis_is_of_the_runs_that_measured(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    nis = results.nis(0, "kf")
    nis[:5, 20:30] = np.nan
    nis[:, 40:45] = np.nan
    monkeypatch.setattr(Results, "nis", lambda self, case, filter: nis)
    panel = figure(results, "nis", filter="kf").axes[0]
    line = np.asarray(panel.lines[0].get_ydata())
    np.testing.assert_allclose(line[25], nis[5:, 25].mean() / 3)
    assert np.isnan(line[40:45]).all()
    outline = panel.collections[0].get_paths()[0].vertices
    assert np.isclose(outline, [results.time_s(0)[25], chi2.ppf(0.975, 3 * 4) / (3 * 4)]).all(axis=1).any()


def test_one_run_of_all_filters(results: Results) -> None:
    drawn = figure(results, "position_error", run=2, case="case 1")
    for place, name in enumerate(results.filters):
        np.testing.assert_allclose(np.asarray(drawn.axes[2].lines[place].get_ydata()), results.error(1, name)[2, :, 2])
    only = figure(results, "position_error", run=4)  # the ekf failed there
    assert [text.get_text() for text in only.legends[0].get_texts()] == ["kf", "ukf"]


def test_the_start_ends_where_filters_have_converged(results: Results) -> None:
    facts = case_facts(results, 0)
    # The invented errors shrink as 1 + 30 exp(-t / 80): twice the final level after 80 ln 30 = 272 s.
    assert 300 <= start_span(results, facts) <= 1000
    drawn = figure(results, "start")
    assert drawn.axes[0].get_xlim()[1] == pytest.approx(start_span(results, facts))
    assert figure(results, "start", until_s=2000.0).axes[0].get_xlim()[1] == pytest.approx(2000.0)


def test_trends_over_cases_hold_the_other_values(results: Results) -> None:
    path, lines = trends(results, along="angle_sigma_deg")
    assert path == "sensors.radar.angle_sigma_deg"
    assert [[(p.value, p.case.index) for p in line.points] for line in lines] == [[(0.1, 0), (1.0, 1)]] * 3
    drawn = figure(results, "sweep", case=2, along="angle_sigma_deg", filter="kf")
    heights = np.asarray(drawn.axes[0].containers[0].lines[0].get_ydata())
    np.testing.assert_allclose(heights, [results.statistic(case, "kf", "rms")[:, 1, 6].mean() for case in (2, 3)])
    assert drawn.axes[0].get_xscale() == "log"


def test_trends_over_a_filters_option(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = {
        name: {"kind": "alpha_kf", "alpha": a} for name, a in zip(results.filters, (0.5, 0.05, 1.0), strict=True)
    }
    monkeypatch.setattr(results, "campaign_content", {**results.campaign_content, "filters": entries})
    path, lines = trends(results, along="alpha")
    assert path == "alpha_kf alpha"
    assert [(p.value, p.filter) for p in lines[0].points] == [(0.05, "ekf"), (0.5, "kf"), (1.0, "ukf")]
    boxes = figure(results, "position_boxes", along="alpha")
    assert [label.get_text() for label in boxes.axes[0].get_xticklabels()] == ["0.05", "0.5", "1"]
    assert boxes.axes[0].get_xlabel() == "alpha [-]"
    moments = figure(results, "sweep_moments", along="alpha").axes[0].containers
    np.testing.assert_allclose(
        np.asarray(moments[1].lines[0].get_ydata()),
        [
            results.statistic(0, name, "std")[runs, 1, 6].mean()
            for name, runs in (("ekf", OK), ("kf", ...), ("ukf", ...))
        ],
    )


def test_boxes_of_epochs_hold_the_settled_errors(results: Results) -> None:
    panel = figure(results, "position_boxes", filter="ekf", along="angle_sigma_deg").axes[0]
    settled = results.error(0, "ekf")[OK][:, results.time_s(0) >= 500, :3]
    first, third = np.quantile(np.linalg.norm(settled, axis=-1), [0.25, 0.75])
    box = panel.patches[0]
    np.testing.assert_allclose([box.get_y(), box.get_y() + box.get_height()], [first, third], rtol=1e-6)


def test_heat_map_cells_are_the_cases(results: Results) -> None:
    assert set(grid_paths(results)) == set(GRID[0])
    drawn = figure(results, "heat_map", filter="ukf", along=("angle_sigma_deg", "range_sigma_m"))
    shown = np.asarray(drawn.axes[0].images[0].get_array())
    expected = [results.statistic(case, "ukf", "rms")[:, 1, 6].mean() for case in range(4)]
    np.testing.assert_allclose(shown.ravel(), expected)
    best = figure(results, "heat_map")
    assert all("ekf" in text.get_text() or "ukf" in text.get_text() for text in best.axes[0].texts)


def test_a_heat_map_needs_two_parameters(make_result: ResultMaker) -> None:
    with (
        open_results(make_result(labels=("a", "b"), runs=2)) as results,
        pytest.raises(ValueError, match="two parameters"),
    ):
        figure(results, "heat_map")


def test_an_ellipse_is_a_level_of_the_normal_distribution() -> None:
    covariance, centre = np.array([[4.0, 1.5], [1.5, 1.0]]), np.array([0.3, -0.2])
    outline = ellipse(covariance, centre) - centre
    distances = np.einsum("ni,ij,nj->n", outline, np.linalg.inv(covariance), outline)
    np.testing.assert_allclose(distances, chi2.ppf(0.95, 2))


def test_the_estimate_is_truth_plus_error(results: Results) -> None:
    line = figure(results, "trajectory", filter="ekf", run=1).axes[0].lines
    truth, error = results.truth(0)[0], results.error(0, "ekf")[1]
    np.testing.assert_allclose(np.asarray(line[1].get_ydata()), truth[:, 0] + error[:, 0], atol=1e-9)
    np.testing.assert_allclose(np.asarray(line[1].get_xdata()), 1e-3 * (truth[:, 1] + error[:, 1]), atol=1e-9)


def test_the_front_is_what_no_other_beats() -> None:
    rng = np.random.default_rng(1)
    costs, values = rng.integers(0, 12, (2, 40)).astype(float)
    values[3] = np.nan
    kept = set(pareto_front(costs, values).tolist())
    for place in range(40):
        beaten = (
            (costs <= costs[place]) & (values <= values[place]) & ((costs < costs[place]) | (values < values[place]))
        )
        same = [other for other in kept if costs[other] == costs[place] and values[other] == values[place]]
        assert (place in kept) <= (not beaten.any() and np.isfinite(values[place]))
        assert beaten.any() or np.isnan(values[place]) or same


def test_worst_runs_are_those_with_the_largest_error(results: Results) -> None:
    drawn = figure(results, "worst", filter="ekf")
    rms = np.where(OK, results.statistic(0, "ekf", "rms")[:, 1, 6], -1)
    expected = [f"run {run} ({rms[run]:.3g} m)" for run in np.argsort(-rms)[:3]]
    assert [text.get_text() for text in drawn.legends[0].get_texts()] == expected


def test_events_are_read_off_the_measurements(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    nis = np.ones((RUNS, 61))
    nis[:, 0] = np.nan  # the start itself measures nothing
    nis[0, 10:15] = np.nan
    nis[1, :8] = np.nan
    nis[2, 50:] = np.nan
    monkeypatch.setattr(Results, "nis", lambda self, case, filter: nis)
    content = results.campaign_content
    burns = {**content, "truth": {"manoeuvres": {"brake": {"time_s": 1010.0}, "late": {"time_s": 9e9}}}}
    monkeypatch.setattr(results, "campaign_content", burns)
    facts = case_facts(results, 0)
    found = conditions.events_of(results, facts, facts.filter("kf"))
    assert found["outage"].tolist() == [[0, 10], [2, 50]]
    assert found["acquisition"].tolist() == [[0, 15], [1, 8]]
    assert found["manoeuvre"].tolist() == [[run, 11] for run in range(RUNS)]
    drawn = figure(results, "events", filter="kf", around_s=300.0)
    assert [panel.get_title(loc="left") for panel in drawn.axes] == [
        "outage (2 in all runs)", "acquisition (2 in all runs)", "manoeuvre (9 in all runs)",
    ]  # fmt: skip
    squares = np.sum(results.error(0, "kf")[..., :3] ** 2, axis=-1)
    middle = np.asarray(drawn.axes[0].lines[0].get_ydata())[3]
    assert middle == pytest.approx(np.sqrt((squares[0, 10] + squares[2, 50]) / 2))


def test_a_slow_radar_is_no_row_of_outages(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    nis = np.full((RUNS, 61), np.nan)
    nis[:, ::5] = 1.0
    monkeypatch.setattr(Results, "nis", lambda self, case, filter: nis)
    facts = case_facts(results, 0)
    assert not any(len(rows) for rows in conditions.events_of(results, facts, facts.filter("kf")).values())


def test_errors_in_bins_of_range() -> None:
    rng = np.random.default_rng(3)
    ranges = rng.uniform(10, 50, (4, 200))
    errors = 0.1 * ranges
    middle, rms, most = conditions._binned(errors, ranges, np.linspace(10, 50, 9))
    np.testing.assert_allclose(rms / middle, 0.1, rtol=0.01 + 2.5 / middle.min())
    assert (most >= rms * 0.99).all()


def test_a_range_that_stays_is_said(results: Results) -> None:
    assert any("stays at 12" in text.get_text() for text in figure(results, "range").axes[0].texts)


def test_windows_thin_long_series_and_refuse_empty_ones(results: Results) -> None:
    assert [drawn_step(n) for n in (0, 1200, 1201, 5000)] == [1, 1, 2, 5]
    facts = case_facts(results, 0)
    assert window(facts, 1000.0, 2000.0).times.tolist() == list(np.arange(1000.0, 2001.0, 100.0))
    with pytest.raises(ValueError, match="fewer than two stored epochs lie between 10 and 20 s"):
        window(facts, 10.0, 20.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"kind": "erors"}, "no figure is named 'erors'; did you mean 'errors'"),
        ({"kind": "rms", "axes": "rtn"}, "figure 'rms' takes no axes, only case, filters"),
        ({"kind": "errors", "filter": ["kf", "ekf"]}, "shows one filter, not 2"),
        ({"kind": "errors", "filter": "nope"}, "filter 'nope' has no run"),
        ({"kind": "errors", "filter": "ekf", "run": 4}, "run 4 of ekf failed"),
        ({"kind": "errors", "run": 77}, r"run 77 of \w+ has not been computed"),
        ({"kind": "sweep", "along": "mass"}, "'mass' is none of these: sensors.radar.range_sigma_m"),
        ({"kind": "sweep", "filter": "nope"}, "no filter is named 'nope'; there are"),
    ],
)
def test_what_cannot_be_drawn_is_said(results: Results, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        figure(results, **arguments)


def test_regret_is_that_of_the_statistics(stressed: Results) -> None:
    found = regret(stressed)
    panel = figure(stressed, "regret").axes[0]
    drawn = {container.lines[0].get_marker(): container.lines[0].get_ydata() for container in panel.containers}
    assert len(drawn) == len(found.filters) == 3 and found.cases == ("nominal", "noisy", "heavy")
    for row, ratio in enumerate(drawn.values()):
        expected = 1 + found.regret[row]
        np.testing.assert_allclose(ratio, np.where(np.isfinite(expected), expected, np.nan))
    assert np.isinf(found.regret[found.filters.index("ekf")]).all()
    lost = [line for line in panel.lines if line.get_marker() == "^" and len(line.get_xdata()) == 3]
    assert {float(at) for line in lost for at in line.get_ydata()} >= {panel.get_ylim()[1]}


@pytest.mark.parametrize(("runs", "failed"), [(2, [0, 1]), (1, [])])
def test_failed_runs_and_a_single_run_are_no_crash(make_result: ResultMaker, runs: int, failed: list[int]) -> None:
    with open_results(make_result(filters={"ekf": 1.0}, runs=runs, failed={"ekf": failed}, times=11)) as results:
        for kind in FIGURE_KINDS:
            try:
                figure(results, kind).draw_without_rendering()
            except ValueError as error:
                told = "varie" in str(error) or (failed and "completed" in str(error))
                lacking = {
                    "availability": "distinguish sensors",
                    "observability": "does not say what the filters can observe",
                    "whiteness": "holds no residuals by channel",
                    "regret": "has no stressed cases",
                }
                assert told or (kind in lacking and lacking[kind] in str(error)), kind


def test_a_campaign_without_runs_is_said(make_result: ResultMaker) -> None:
    path = make_result(labels=("a", "b"), runs=1, computed_cases=1)
    with pytest.raises(ValueError, match="no run of case 'b' has been computed yet"):
        figure(path, "rms", case="b")


@pytest.mark.parametrize(
    ("path", "label"),
    [
        ("sensors.radar.range_sigma_m", "radar.range sigma [m]"),
        ("truth.chief.orbit.a_km", "orbit.a [km]"),
        ("filters.ekf.process_noise.acceleration_psd_m2_s3", "process noise.acceleration psd [m²/s³]"),
        ("alpha_kf alpha", "alpha [-]"),
    ],
)
def test_axes_of_varied_values_name_their_unit(path: str, label: str) -> None:
    assert axis_label(path) == label


@pytest.mark.parametrize(("suffix", "start"), [(".pdf", b"%PDF"), (".svg", b"<?xml"), (".png", b"\x89PNG")])
def test_figures_as_files(results: Results, tmp_path: Path, suffix: str, start: bytes) -> None:
    for name in ("a", "b"):
        write_figure(figure(results, "boxes"), tmp_path / f"{name}{suffix}")
    first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("a", "b"))
    assert first.startswith(start)
    assert first == second
