"""Covariances in full and residuals by channel of whole campaigns, and that nothing else changes by them."""

from dataclasses import replace

import numpy as np
import pytest

from relnav_sim import run_campaign
from relnav_sim.campaign import parse_campaign
from relnav_sim.campaign.warnings import campaign_warnings
from relnav_sim.plots.ellipses import ellipse
from relnav_sim.plots.facts import case_facts
from relnav_sim.report import figure
from relnav_sim.report.case_section import compose_case
from relnav_sim.report.case_tables import case_table_makers
from relnav_sim.report.drawing import FigureFolder
from relnav_sim.report.opened import Opened
from relnav_sim.report.ranking import rank
from relnav_sim.results import open_results
from relnav_sim.simulation.block import simulate_block

TEXT = """
name: review
seed: 5
runs: 8
bound: false
clock: {duration_s: 300, step_s: 1, store_every_s: 10}
truth:
  chief: {orbit: {a_km: 7137, e: 0, i_deg: 42}, mass_kg: 1, area_m2: 1}
  deputy: {relative: {position_m: [0, 3000, 0], velocity_m_s: [0, 0, 0]}, mass_kg: 1, area_m2: 1}
  forces: {zonals: 0, drag: none}
sensors:
  radar: {range_sigma_m: 4, angle_sigma_deg: 0.07}
start: {kind: dispersed, position_sigma_m: 10, velocity_sigma_m_s: 0.1}
statistics: {settle_s: 100}
filters:
  ekf: {kind: ekf}
  particle: {kind: particle, particles: 64}
  biased: {kind: ekf, augment: [{kind: range_bias, sigma_m: 1}]}
"""
FULL = ("clock.store_covariance=true", "statistics.whiteness=true")


@pytest.fixture(scope="module")
def blocks():
    return [simulate_block(parse_campaign(TEXT, given).cases[0], 5, range(8)).result for given in ((), FULL)]


def test_nothing_else_changes(blocks) -> None:
    plain, full = blocks
    for name, one in plain.filters.items():
        other = full.filters[name]
        assert one.covariance_root is None and one.by_channel is None
        kept = replace(other, covariance_root=None, by_channel=None).arrays(one.columns)
        for key, array in one.arrays(one.columns).items():
            if key != "cpu_per_step":
                assert array.tobytes() == kept[key].tobytes(), (name, key)


def test_every_kind_of_filter_has_its_covariance(blocks) -> None:
    """The diagonal is that of the sigmas, and the error has the NEES that is stored, in single precision."""
    from relnav_sim.results.covariance_root import covariances

    for one in blocks[1].filters.values():
        P = covariances(one.covariance_root.astype(float))
        np.testing.assert_allclose(np.sqrt(np.diagonal(P, axis1=2, axis2=3)), one.sigma, rtol=1e-6)
        e = one.error.astype(float)
        nees = np.einsum("rki,rki->rk", e, np.linalg.solve(P, e[..., None])[..., 0])
        np.testing.assert_allclose(nees, one.nees, rtol=1e-4)


def test_blocks_of_one_run_have_the_same_bits(blocks) -> None:
    case = parse_campaign(TEXT, FULL).cases[0]
    alone = simulate_block(case, 5, [3]).result
    for name, one in blocks[1].filters.items():
        assert alone.filters[name].covariance_root[0].tobytes() == one.covariance_root[3].tobytes()
        for part in ("count", "mean", "product"):
            ours, other = getattr(one.by_channel, part)[3], getattr(alone.filters[name].by_channel, part)[0]
            assert ours.tobytes() == other.tobytes()


def test_channels_are_named_and_consistent_ones_are_white(blocks) -> None:
    found = blocks[1].filters["ekf"].by_channel
    assert found.names == ("radar range", "radar azimuth", "radar elevation")
    assert (found.count[:, 0] == 300).all() and (found.count[:, 1] == 201).all()
    # 8 runs of 201 readings: mean square within 4.5 sigma of 1 for a filter with the right noise.
    assert np.abs(found.product[:, 1, :, 0].mean(axis=0) - 1).max() < 4.5 * np.sqrt(2 / (8 * 201))


@pytest.mark.slow
def test_report_and_figures(tmp_path) -> None:
    path = run_campaign(parse_campaign(TEXT, FULL), tmp_path / "r.h5", backend="sequential")
    with open_results(path) as results:
        makers = case_table_makers(rank(case_facts(results, 0)))
        wanted = "consistency by axis and plane", "formal and actual covariance", "residuals by channel"
        parts, against, channels = (makers[what]() for what in wanted)
        assert len(parts.rows) == 12 * 3 and [column.label for column in parts.columns] == list(results.filters)
        P, e = results.covariance(0, "ekf"), results.error(0, "ekf")
        settled = results.time_s(0) >= 100
        plane = next(row for row in parts.rows if row.label == "ANEES, plane x-y").cells[0]
        pair = np.ix_([0, 1], [0, 1])
        expected = np.mean([
            [x @ np.linalg.solve(C[pair], x) / 2 for x, C in zip(e[r, settled, :2], P[r, settled], strict=True)]
            for r in range(8)
        ])  # fmt: skip
        assert plane.value == pytest.approx(expected, rel=1e-9)
        row = next(row for row in against.rows if row.label == "correlation of x and vy")
        mean, moments = P[:, -1].mean(axis=0), e[:, -1].T @ e[:, -1] / 8
        for cell, C in zip(row.cells[:2], (mean, moments), strict=True):
            assert cell.value == pytest.approx(C[0, 4] / np.sqrt(C[0, 0] * C[4, 4]), abs=1e-9)
        assert any(row.label == "radar range, verdict" for row in channels.rows)
        drawn = figure(results, "ellipses", filter="ekf", sigma=3.0)
        dashed = drawn.axes[0].lines[1].get_xydata()
        turned = mean[np.ix_([1, 0], [1, 0])]
        np.testing.assert_allclose(dashed, ellipse(turned, np.zeros(2), 3.0), rtol=1e-6)
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", dashed, np.linalg.inv(turned), dashed), 9.0, rtol=1e-6)
        assert len(figure(results, "whiteness", filter="particle").axes) == 3
        with pytest.raises(ValueError, match="sigma must be a positive number"):
            figure(results, "ellipses", sigma=0.0)
        with pytest.raises(ValueError, match="there is no epoch"):
            figure(results, "ellipses", at_s=1e6)


GOING_BACK = "  buffer: {kind: ekf, out_of_sequence: buffer}\n  batch: {kind: batch_least_squares}\n"


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("others", ["  ekf: {kind: ekf}\n", ""], ids=["beside another", "alone"])
def test_filters_that_go_back_are_said_not_to_be_tested(tmp_path, others) -> None:
    text = TEXT[: TEXT.index("  ekf:")].replace("sigma_deg: 0.07", "sigma_deg: 0.07, drawn_latency_s: [0, 2]")
    text = text.replace("duration_s: 300", "duration_s: 120").replace("runs: 8", "runs: 3")
    campaign = parse_campaign(text + others + GOING_BACK, FULL[1:])
    (warning,) = (each for each in campaign_warnings(campaign) if "whiteness" in each)
    assert "statistics.whiteness does not test the residuals of buffer and batch: a filter that goes back" in warning
    path = run_campaign(campaign, tmp_path / "r.h5", backend="sequential")
    with open_results(path) as results:
        kept = [name for name in results.filters if results.by_channel(0, name) is not None]
    assert kept == (["ekf"] if others else [])
    ranking, section = compose_case(
        Opened(open_results(path)), 0, "rtn", FigureFolder(tmp_path, vectors=False), False, 10, False, False
    )
    table = case_table_makers(ranking)["residuals by channel"]()
    said = " ".join(section.notes) if table is None else table.caption
    assert (table is None) == (not others)
    assert "Residuals of buffer and batch are not tested: a filter that goes back for late measurements" in said
