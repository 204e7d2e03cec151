"""Fixtures of tests/runner/campaign_maker.py."""

from campaign_maker import campaign, make_campaign

__all__ = ["campaign", "make_campaign"]
