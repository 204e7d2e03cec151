"""The small campaign as a fixture."""

import pytest
from small_campaign import TEXT

from relnav_sim.campaign.load import parse_campaign


@pytest.fixture
def campaign():
    """Return a maker of the small campaign with overrides and text replacements."""

    def make(*overrides: str, **replacements: str):
        text = TEXT
        for old, new in replacements.items():
            assert f"{old}:" in text
            text = text.replace(f"  {old}: ", f"  {new}: ", 1)
        return parse_campaign(text, overrides)

    return make
