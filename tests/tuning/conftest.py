"""The small campaign of the runner's tests, to tune."""

import pytest
from small_campaign import TEXT

from relnav_sim.campaign.load import parse_campaign


@pytest.fixture
def make_campaign():
    """Return a maker of the small campaign, with lines added and overrides."""

    def make(*overrides: str, added: str = "", replace: tuple[str, str] = ("", "")):
        return parse_campaign(TEXT.replace(*replace) + added, overrides)

    return make
