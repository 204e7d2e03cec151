"""Fixtures of tests/runner/campaign_maker.py, and sensors of the tests' own."""

import pytest
from campaign_maker import campaign, make_campaign
from some_sensors import RangedOptions, SeenOptions

from relnav_sim.sensors import registry, sensor_kinds

__all__ = ["campaign", "make_campaign"]


@pytest.fixture
def own_sensors(monkeypatch):
    """Register the kinds `seen` (two angles) and `ranged` (range)."""
    sensor_kinds()
    monkeypatch.setitem(registry._KINDS, "seen", SeenOptions)
    monkeypatch.setitem(registry._KINDS, "ranged", RangedOptions)
