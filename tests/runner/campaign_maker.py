"""The small campaign as a fixture."""

import pytest
from small_campaign import TEXT

from relnav_sim.campaign.load import parse_campaign


@pytest.fixture(scope="session")
def make_campaign():
    """Return a maker of the small campaign with overrides."""

    def make(*overrides: str):
        return parse_campaign(TEXT, overrides)

    return make


@pytest.fixture
def campaign(make_campaign):
    """Return a maker of the small campaign with overrides."""
    return make_campaign
