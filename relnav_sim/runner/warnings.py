"""All that a user should know of a campaign before it runs: its geometry, and what its runs are too short to show."""

from __future__ import annotations

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.warnings import campaign_warnings
from relnav_sim.statistics.convergence_seen import convergence_warnings


def warnings_before(campaign: Campaign) -> tuple[str, ...]:
    """Return the warnings of a campaign, a sentence each; none where all is well."""
    return (*campaign_warnings(campaign), *convergence_warnings(campaign))
