"""The tables of large campaigns: their slopes, their page, and the campaigns that are timed."""

import dataclasses
import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from relnav_sim.campaign.load import parse_campaign

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(scope="module")
def scale():
    sys.path.insert(0, str(BENCHMARKS))
    try:
        yield {
            name: importlib.import_module(f"scale.{name}") for name in ("campaigns", "measure", "tables", "__main__")
        }
    finally:
        sys.path.remove(str(BENCHMARKS))


def test_the_slope_of_a_line_with_a_scatter_in_proportion(scale):
    sizes = [10, 100, 1000, 10000]
    exact = [2 + 0.003 * size for size in sizes]
    each, half = scale["tables"].slope(sizes, exact)
    assert each == pytest.approx(0.003, rel=1e-9) and half < 1e-9
    rng = np.random.default_rng(5)
    covered = 0
    for _ in range(400):
        seconds = [s * (1 + 0.05 * rng.standard_normal()) for s in exact]
        each, half = scale["tables"].slope(sizes, seconds)
        covered += abs(each - 0.003) < half
    # 0.95 within 4 standard errors of 400 draws, and what weights by measured times take away.
    assert covered / 400 == pytest.approx(0.95, abs=0.06)
    assert scale["tables"].slope(sizes[:2], exact[:2])[1] == np.inf


@pytest.mark.parametrize(
    "axis, value, cases, filters",
    [("cases", 12, 12, 1), ("filters", 3, 1, 3), ("epochs", 2000, 1, 1), ("full cases", 8, 8, 6)],
)
def test_the_campaigns_are_of_the_size_they_say(scale, axis, value, cases, filters):
    base = scale["campaigns"].AXES[axis][0]
    campaign = parse_campaign(scale["campaigns"].text(base.along(axis, value)))
    assert len(campaign.cases) == cases and len(campaign.cases[0].config.filters) == filters
    if axis == "epochs":
        assert campaign.cases[0].config.clock.epochs == pytest.approx(value, rel=0.06)


def test_the_page_holds_the_tables_of_the_timings_that_are_kept(scale):
    page = scale["tables"].PAGE.read_text(encoding="utf-8")
    begin, end = scale["tables"].MARKS
    assert page.partition(begin)[2].partition(end)[0].strip() == scale["tables"].tables(scale["tables"].known()).strip()


def test_a_measurement_goes_on_where_it_was_interrupted(scale, monkeypatch, tmp_path):
    """Each size is kept once it is measured, and a known one is not measured again."""
    timing = scale["measure"].Timing("cases", 100, "run", 5.0, 6.0, 120.0, 1000, 4)
    monkeypatch.setattr(scale["tables"], "RAW", tmp_path / "timings.csv")
    scale["tables"].keep([timing])
    asked = []

    def timings(axis, values, longest_s):
        for value in values:
            asked.append(value)
            if value == 1000:
                raise KeyboardInterrupt
            yield [dataclasses.replace(timing, value=value)]

    monkeypatch.setattr(scale["__main__"], "timings", timings)
    monkeypatch.setattr(sys, "argv", ["scale", "cases", "--most", "1000", "--no-docs"])
    for expected in ([10, 1000], [1000]):
        with pytest.raises(KeyboardInterrupt):
            scale["__main__"].main()
        assert asked == expected
        asked.clear()
    assert [one.value for one in scale["tables"].known()] == [10, 100]
