"""A campaign file to frozen, validated objects, to cases and runs."""

from relnav_sim.campaign.load import Campaign, Case, load_campaign, parse_campaign
from relnav_sim.campaign.models import (
    CaseConfig,
    Clock,
    DispersedStart,
    FirstFixStart,
    GivenStart,
    StartOptions,
    StatisticsOptions,
)
from relnav_sim.campaign.plan import Plan, plan_campaign
from relnav_sim.campaign.problems import CampaignError

__all__ = [
    "Campaign",
    "CampaignError",
    "Case",
    "CaseConfig",
    "Clock",
    "DispersedStart",
    "FirstFixStart",
    "GivenStart",
    "Plan",
    "StartOptions",
    "StatisticsOptions",
    "load_campaign",
    "parse_campaign",
    "plan_campaign",
]
