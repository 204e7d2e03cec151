"""The small campaign as a fixture."""

import functools

import pytest
from small_campaign import TEXT

from relnav_sim.campaign.load import parse_campaign


@pytest.fixture(scope="session")
def make_campaign():
    """Return a maker of the small campaign with overrides; of the same ones it returns the same campaign."""

    @functools.cache
    def make(*overrides: str):
        return parse_campaign(TEXT, overrides)

    return make


@pytest.fixture
def campaign(make_campaign):
    """Return a maker of the small campaign with overrides."""
    return make_campaign
