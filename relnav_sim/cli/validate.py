"""`relnav validate`: every problem of a campaign, or what it will take."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.files import CAMPAIGNS, existing
from relnav_sim.cli.output import count_in_words, in_words, print_table, say, size_in_words

if TYPE_CHECKING:
    from relnav_sim.campaign import Campaign

CASES_SHOWN = 12


def validate(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The campaign, a YAML file.")],
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Change a value, as clock.step_s=1; may be repeated."),
    ] = None,
) -> None:
    """Check a campaign: print every problem, or the plan."""
    from relnav_sim.campaign import load_campaign, plan_campaign
    from relnav_sim.campaign.plan import START_S
    from relnav_sim.campaign.recorded_orbits import recorded_orbits
    from relnav_sim.runner.warnings import warnings_before

    campaign = load_campaign(existing(file, CAMPAIGNS), changes or [])
    check_tuning(campaign)
    plan = plan_campaign(campaign)
    say(f"{file} is a valid campaign")
    config = campaign.cases[0].config
    labels = [case.label for case in campaign.cases]
    more = [f"and {len(labels) - CASES_SHOWN} more"] if len(labels) > CASES_SHOWN else []
    print_table(
        [
            ("name", campaign.name),
            ("hash", campaign.hash[:12]),
            ("cases", "\n".join([str(len(labels)), *labels[:CASES_SHOWN], *more])),
            *_stress_rows(campaign),
            ("filters", ", ".join(dict.fromkeys(name for case in campaign.cases for name in case.config.filters))),
            ("runs", f"{campaign.runs} of each case, seed {campaign.seed}"),
            ("time", f"{config.clock.duration_s:g} s in steps of {config.clock.step_s:g} s"),
            ("work", f"{count_in_words(plan.blocks, 'block')} of at most {count_in_words(campaign.block_runs, 'run')}"),
            ("", f"{plan.filter_steps:.3g} filter steps, about {in_words(plan.cpu_s + START_S)} of CPU time"),
            ("disk", f"about {size_in_words(plan.disk_bytes)}"),
            ("memory", f"about {size_in_words(plan.memory_bytes)} for each worker"),
            *_with_stress_rows(campaign),
        ]
    )
    for sentence in recorded_orbits(campaign):
        say(sentence)
    for sentence in warnings_before(campaign):
        say(f"warning: {sentence}", err=True)


def _stress_rows(campaign: Campaign) -> list[tuple[str, str]]:
    """Return how many stressed cases there are, and under which names; nothing without any."""
    names = list(dict.fromkeys(case.stress for case in campaign.stressed))
    if not names:
        return []
    each = "" if len(campaign.cases) == 1 else f", {len(names)} of each case"
    return [("stressed", "\n".join([f"{len(campaign.stressed)}{each}; relnav run --stress flies them too", *names]))]


def _with_stress_rows(campaign: Campaign) -> list[tuple[str, str]]:
    """Return what the campaign takes with its stressed cases."""
    from relnav_sim.campaign import plan_campaign
    from relnav_sim.campaign.plan import START_S

    if not campaign.stressed:
        return []
    plan = plan_campaign(campaign.with_stress())
    time, disk = in_words(plan.cpu_s + START_S), size_in_words(plan.disk_bytes)
    return [("with --stress", f"{plan.filter_steps:.3g} filter steps, about {time} of CPU time, {disk} of disk")]


def check_tuning(campaign: Campaign) -> None:
    """Refuse a `tune:` section that names what is not there, every mistake with its line."""
    tune = campaign.tune
    if tune is None:
        return
    from relnav_sim.campaign import CampaignError
    from relnav_sim.campaign.load import located
    from relnav_sim.campaign.problems import Problem
    from relnav_sim.tuning.scalars import TuningError, free_scalars

    problems = []
    for text, bounds in tune.free.items():
        try:
            free_scalars(campaign, (), {text: bounds}, tune.objective)
        except TuningError as error:
            problems.append(Problem(("tune", "free", text), str(error)))
    if not problems:
        try:
            free_scalars(campaign, tune.filters, tune.free, tune.objective)
        except TuningError as error:
            problems.append(Problem(("tune", "filters") if tune.filters else ("tune",), str(error)))
    if problems:
        raise CampaignError([located(campaign, problem) for problem in problems])
