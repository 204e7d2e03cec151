"""The chart's data: what is packed comes back, within the bytes it may take, and cannot break out of its element."""

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from relnav_sim.plots.facts import case_facts
from relnav_sim.plots.style import PALETTE
from relnav_sim.report import html
from relnav_sim.report.curves import case_curves, embedded, packed, picked_epochs, points_of
from relnav_sim.results import open_results

ResultMaker = Callable[..., Path]


def unpacked(curve: list[Any]) -> np.ndarray:
    """Decode as chart.js does."""
    low, high, logarithmic, text = curve
    levels = np.frombuffer(base64.b64decode(text), dtype="<u2").astype(float)
    values = np.where(levels == 65535, np.nan, low + (high - low) * levels / 65534)
    return 10**values if logarithmic else values


def test_linear_curves_come_back() -> None:
    values = np.array([-3.0, 0.0, np.nan, 5.25, 1e-3])
    assert_allclose(unpacked(packed(values)), values, atol=8.25 / 65534)


def test_logarithmic_curves_come_back_in_proportion() -> None:
    values = np.geomspace(1e-4, 1e3, 50)
    values[[3, 7]] = np.nan, 0.0  # a zero has no logarithm
    found = unpacked(packed(values, logarithmic=True))
    assert np.isnan(found[[3, 7]]).all()
    assert_allclose(np.delete(found, [3, 7]), np.delete(values, [3, 7]), rtol=7 * np.log(10) / 65534)


@pytest.mark.parametrize("values", [[2.0, 2.0], [np.nan, np.nan], []])
def test_flat_and_empty_curves(values: list[float]) -> None:
    assert_allclose(unpacked(packed(np.array(values))), values)


def test_the_start_keeps_every_epoch_and_the_end_its_last() -> None:
    assert picked_epochs(50, 60).tolist() == list(range(50))
    rows = picked_epochs(10_000, 200)
    assert rows[:50].tolist() == list(range(50))
    assert rows[-1] == 9999
    assert len(rows) <= 200


@pytest.mark.parametrize(("cases", "filters"), [(1, 1), (8, 6), (60, 6), (400, 4)])
def test_curves_take_a_quarter_of_the_page_at_most(cases: int, filters: int) -> None:
    points, with_axes = points_of(cases, filters)
    size = cases * filters * (18 if with_axes else 6) * points * 8 / 3
    assert size <= 1_250_000 or points == 60
    assert points >= 60


def test_curves_are_the_stored_series(make_result: ResultMaker) -> None:
    with open_results(make_result(runs=5, failed={"ekf": [2]})) as results:
        curves = case_curves(results, case_facts(results, 0), 600, with_axes=True)
        ok = np.arange(5) != 2
        rms = np.sqrt(np.mean(np.sum(results.error(0, "ekf")[ok, :, :3] ** 2, axis=2), axis=0))
        assert_allclose(unpacked(curves["filters"]["ekf"]["position"]), rms, rtol=1e-3)
        assert_allclose(
            unpacked(curves["filters"]["ekf"]["nees"]), results.nees(0, "ekf")[ok].mean(axis=0) / 6, atol=1e-3
        )
        median = curves["filters"]["kf"]["median"]
        assert_allclose(unpacked(curves["filters"]["kf"]["vz"]), results.error(0, "kf")[median, :, 5], atol=1e-4)


def test_names_cannot_leave_the_script_element(make_result: ResultMaker) -> None:
    nasty = "</script><script>alert(1)</script><!-- &amp;"
    with open_results(make_result(labels=(nasty,), runs=2)) as results:
        text = embedded([case_curves(results, case_facts(results, 0), 60, with_axes=False), None], results.filters)
    assert not set("<>&") & set(text)
    assert json.loads(text)["cases"][0]["label"] == nasty


def test_without_runs_there_is_no_chart() -> None:
    assert embedded([None, {"filters": {}}], ["ekf"]) == ""


def test_the_chart_has_the_colours_of_the_figures() -> None:
    light = html._asset("page.css").split("\n")[0]
    assert all(f"--f{place}:{colour.lower()}" in light for place, colour in enumerate(PALETTE))
