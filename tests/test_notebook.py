"""What objects show of themselves in a session and in a notebook."""

import dataclasses
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from invented_results import invented_result

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, load_campaign, run_filter
from relnav_sim.notebook import MOST_ROWS, table_html
from relnav_sim.results import open_results
from relnav_sim.results.block import ResultsError
from relnav_sim.wording import MISSING

ROOT = Path(__file__).parents[1]


class Cells(HTMLParser):
    """Collects the words of a page; complains of tags that are not closed in order."""

    def __init__(self, page):
        super().__init__()
        self.open, self.words = [], []
        self.feed(page)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_a_campaign():
    campaign = load_campaign(ROOT / "campaigns" / "demo.yaml", ["runs=7"])
    assert repr(campaign) == "<Campaign demo: 2 cases, 4 filters, 7 runs>"
    words = Cells(campaign._repr_html_()).words
    assert "sensors.radar.noise.kind=mixture" in words
    assert words.count("kf, ekf, ukf, imm") == 2


def test_a_campaign_of_many_cases_shows_the_first():
    campaign = load_campaign(ROOT / "campaigns" / "demo.yaml")
    many = dataclasses.replace(campaign, cases=campaign.cases[:1] * 1000)
    assert Cells(many._repr_html_()).words[-1] == f"and {1000 - MOST_ROWS} more"


@pytest.mark.parametrize("runs", [1, 5])
def test_a_history(runs):
    filter = create_filter("kf", LinearDynamics(np.eye(2), np.eye(2)), LinearMeasurement(np.eye(2), np.eye(2)))
    readings = np.ones((runs, 3, 2))
    readings[:, 2] = np.nan
    history = run_filter(filter, readings, np.zeros(2), np.eye(2))
    assert repr(history) == f"<FilterHistory: {runs} run{'s' * (runs > 1)}, 3 epochs, 2 states>"
    words = Cells(history._repr_html_()).words
    assert f"{np.sqrt(history.covariance[0, 1, 0, 0]):.4g}" in words
    assert MISSING in words  # no NIS where nothing was read


def test_what_stands_in_a_table_is_text():
    assert Cells(table_html("<b>", ["a & b"], [["<script>"]])).words == ["<b>", "a & b", "<script>"]


def test_a_result(tmp_path):
    path = invented_result(tmp_path, labels=("a=1", "b<2"), runs=5, failed={"ekf": [1]})
    with open_results(path) as results:
        assert repr(results) == f"<Results of invented: 2 cases, 3 filters, 5 runs planned, in {path}>"
        words = Cells(results._repr_html_()).words
        assert [words.count(name) for name in ("b<2", "ekf", "5")] == [3, 2, 6]
        ok = ~results.statistic(0, "ekf", "failed").astype(bool)
        assert f"{results.statistic(0, 'ekf', 'rms')[ok, 1, 6].mean():.3f}" in words
    assert "file closed" in Cells(results._repr_html_()).words


def test_a_result_as_a_frame(tmp_path, monkeypatch):
    pandas = pytest.importorskip("pandas")
    with open_results(invented_result(tmp_path, runs=4, failed={"ekf": [1]})) as results:
        frame, columns = results.summary_frame(), results.summary()
        assert list(frame.columns) == list(columns) and len(frame) == len(columns["run"])
        mean = frame[~frame.failed].groupby("filter").settled_r_rms_m.mean()
        kept = (columns["filter"] == "ekf") & ~columns["failed"]
        assert mean["ekf"] == pytest.approx(columns["settled_r_rms_m"][kept].mean(), rel=1e-14)
        assert isinstance(frame, pandas.DataFrame)
        monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
        with pytest.raises(ResultsError, match="pip install pandas"):
            results.summary_frame()
