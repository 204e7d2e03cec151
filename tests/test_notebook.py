"""What objects show of themselves in a session and in a notebook."""

import dataclasses
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, load_campaign, run_filter
from relnav_sim.notebook import MOST_ROWS, table_html
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
