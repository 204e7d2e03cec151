"""What a user should know of a campaign before it runs: its geometry, what it is too short and too simple for."""

from __future__ import annotations

from dataclasses import replace

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.shared_field import shared_field_warnings
from relnav_sim.campaign.warnings import campaign_warnings, together
from relnav_sim.crlb.case_observability import case_observability
from relnav_sim.kernels.compiling import interpreted
from relnav_sim.results.observability import not_observable
from relnav_sim.statistics.convergence_seen import convergence_warnings

MOST_CASES = 12
"""Cases whose observability is looked at before a run."""


def warnings_before(campaign: Campaign) -> tuple[str, ...]:
    """Return the warnings of a campaign, a sentence each; none where all is well. Stressed cases are not looked at."""
    campaign = replace(campaign, cases=campaign.nominal_cases or campaign.cases)
    with interpreted():
        return (
            *campaign_warnings(campaign),
            *observability_warnings(campaign),
            *convergence_warnings(campaign),
            *shared_field_warnings(campaign),
        )


def observability_warnings(campaign: Campaign) -> tuple[str, ...]:
    """Return which filters of a campaign can't observe the state by their sensors, a sentence each."""
    looked = campaign.cases[:MOST_CASES]
    found = together([(case.label, not_observable(case_observability(case.config))) for case in looked])
    unseen = len(campaign.cases) - len(looked)
    rest = [f"The observability of {unseen} more cases was not looked at; the report says it of all."]
    return (*found, *rest) if found and unseen else found
