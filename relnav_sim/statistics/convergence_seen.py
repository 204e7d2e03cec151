"""How late can a run be seen to converge? Its error must stay small for the hold time, and the run must last so long.

A run that is no longer than the hold time never converges, however good the filter is. That is no verdict on it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.models import exact
from relnav_sim.campaign.requirements import ConvergedRequirement
from relnav_sim.results.settings import case_setting

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


def hold_epochs(hold_s: float, step_s: float) -> int:
    """Return how many steps make up the hold time, the last one begun counted whole."""
    return max(0, math.ceil(hold_s / step_s - 1e-9))


def latest_convergence_s(duration_s: float, step_s: float, hold_s: float) -> float:
    """Return the latest time at which a run can be seen to converge, s; not positive: it can't be seen at all."""
    steps = round(exact(duration_s) / exact(step_s))
    return (steps - hold_epochs(hold_s, step_s)) * step_s


def seen_until_s(results: Results, case: int) -> float:
    """Return that time for a case of a result, s; NaN where the result does not say."""
    paths = ("clock.duration_s", "clock.step_s", "statistics.convergence_hold_s")
    given = [case_setting(results, case, path, None) for path in paths]
    return math.nan if None in given else latest_convergence_s(*map(float, given))


def convergence_warnings(campaign: Campaign) -> list[str]:
    """Return what a campaign asks about convergence that its runs are too short to answer."""
    sentences = []
    for case in campaign.cases:
        clock, statistics = case.config.clock, case.config.statistics
        hold = f"statistics.convergence_hold_s of {statistics.convergence_hold_s:g} s"
        run = f"the run of {clock.duration_s:g} s"
        latest = latest_convergence_s(clock.duration_s, clock.step_s, statistics.convergence_hold_s)
        if latest <= 0:
            sentences.append(f"{run} is not longer than {hold}: convergence cannot be judged")
            continue
        if latest < statistics.settle_s:
            sentences.append(
                f"{hold} leaves {latest:g} s of {run} to converge in, less than statistics.settle_s of "
                f"{statistics.settle_s:g} s: a run that converges later counts as one that never does"
            )
        sentences += [
            f"requirements.{name}.within_s of {requirement.within_s:g} s and {hold} reach beyond {run}: a run that "
            f"converges later than {latest:g} s cannot be judged"
            for name, requirement in campaign.requirements.items()
            if isinstance(requirement, ConvergedRequirement) and requirement.within_s > latest
        ]
    return list(dict.fromkeys(sentences))
