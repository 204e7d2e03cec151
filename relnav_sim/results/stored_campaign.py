"""The campaign that a result is of, to be simulated again."""

from __future__ import annotations

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.load import parse_content
from relnav_sim.campaign.problems import CampaignError
from relnav_sim.results.block import RefusedError
from relnav_sim.results.read import Results


def stored_campaign(results: Results) -> Campaign:
    """Return the campaign of a result as it was run, what the command line set included.

    Raises:
        RefusedError: This version of relnav, or a package of the user's that is not here, reads it otherwise.
    """
    try:
        campaign = parse_content(results.campaign_content)
    except CampaignError as error:
        problem = error.problems[0].removeprefix("campaign:1: ")
        raise RefusedError(f"{results.path}: its campaign can't be run again: {problem}") from None
    if [case.id for case in campaign.cases] != [header.id for header in results.headers]:
        raise RefusedError(
            f"{results.path}: this relnav reads its campaign otherwise than the one that made it, so that the numbers "
            "would be others; run the campaign again"
        )
    return campaign
