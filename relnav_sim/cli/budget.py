"""`relnav budget`: how much of a filter's error each source is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.failures import UserError
from relnav_sim.cli.files import CAMPAIGNS, existing, existing_result
from relnav_sim.cli.output import command, new_file, print_table, say

if TYPE_CHECKING:
    from relnav_sim.budget import Budget
    from relnav_sim.campaign import Campaign


def budget(
    file: Annotated[Path, typer.Argument(metavar="CAMPAIGN", help="The campaign, a YAML file.")],
    named: Annotated[
        str, typer.Option("--case", metavar="CASE", help="The case, by number from 0, id, or label as printed.")
    ] = "0",
    filters: Annotated[
        list[str] | None,
        typer.Option(
            "--filter",
            metavar="NAME",
            help="The filter; repeat for several.",
            show_default="the first that has a budget",
        ),
    ] = None,
    result: Annotated[
        Path | None,
        typer.Option(
            "--result",
            metavar="RESULT",
            help="A Monte Carlo of the campaign to compare with.",
            show_default="results/NAME.h5, if it is one",
        ),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Change a value, as clock.step_s=1; may be repeated."),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option("--csv", metavar="FILE", help="Also write the variances over time to this file.")
    ] = None,
    figure: Annotated[
        Path | None,
        typer.Option("--figure", metavar="FILE", help="Also draw the first filter's over time: a .png or .pdf."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the files of --csv and --figure.")] = False,
) -> None:
    """Show how much of a filter's error each source is, without a Monte Carlo run.

    Linear covariance analysis along the nominal truth: for filters whose gain does not depend on the measurements.
    What of the campaign is not in the budget is named below the table.
    """
    from relnav_sim.budget import budgeted_filters, error_budget
    from relnav_sim.campaign import load_campaign
    from relnav_sim.runner.single import case_number

    target = None if csv is None else new_file(csv, overwrite)
    if figure is not None and figure.suffix not in (".png", ".pdf"):
        raise UserError(f"--figure takes a name that ends with .png or .pdf, not {figure}")
    picture = None if figure is None else new_file(figure, overwrite)
    campaign = load_campaign(existing(file, CAMPAIGNS), changes or [])
    case = case_number(campaign, named)
    wanted: Sequence[str | None] = filters or [None]
    try:
        found = [error_budget(campaign, case, name) for name in wanted]
    except ValueError as error:
        raise UserError(str(error)) from None
    config = campaign.cases[case].config
    compared = _result(campaign, result)
    for one in found:
        _show(one, campaign, case)
        if compared is not None:
            _compare(one, campaign, case, compared)
    if not filters:
        known = budgeted_filters(config)
        if others := [name for name in known if name != found[0].filter]:
            say(f"\nothers: {command('relnav', 'budget', file, *(w for name in others for w in ('--filter', name)))}")
        if without := [name for name in config.filters if name not in known]:
            say(f"no budget of {', '.join(without)}: the gain depends on the measurements")
    if target is not None:
        from relnav_sim.budget.export import export_budgets

        export_budgets(found, config.clock.store_every, target)
        say(f"\nwrote {target}")
    if picture is not None:
        _draw(found[0], campaign, case, compared, picture)
        say(f"\nwrote {picture}")


def _draw(budget: Budget, campaign: Campaign, case: int, result: Path | None, target: Path) -> None:
    from relnav_sim.plots.budget import error_budget_over_time
    from relnav_sim.plots.style import pdf, png
    from relnav_sim.report.error_budget import actual_sigma, budget_curves
    from relnav_sim.results.atomic import written_whole

    actual = None if result is None else actual_sigma(result, campaign.cases[case].id, budget.filter)
    drawn = error_budget_over_time(budget_curves(budget, actual))
    with written_whole(target) as temporary:
        temporary.write_bytes((png if target.suffix == ".png" else pdf)(drawn))


def _show(budget: Budget, campaign: Campaign, case: int) -> None:
    from relnav_sim.budget.table import budget_rows, phase_rows

    of = campaign.cases[case]
    label = f", case {case}: {of.label}" if len(campaign.cases) > 1 else ""
    settle_s = of.config.statistics.settle_s
    say(f"{campaign.name}{label}\nfilter {budget.filter}, sigmas from {settle_s:g} s on (rms) and at the end\n")
    headings = ("source", "position, m", "at the end", "velocity, m/s", "at the end", "share", "halved", "per unit")
    print_table(budget_rows(budget, settle_s), headings)
    say(
        "\nshare, halved and per unit: of the position from then on; halved: what that gains; per unit: what a unit "
        "more adds; formal: the sigma that the filter itself predicts"
    )
    if len(budget.phases) > 1:
        ends = [f"{budget.times_s[phase.epoch]:g} s" for phase in budget.phases]
        say("\nposition sigma at the end of each phase, m; -: below a thousandth of the total")
        print_table(phase_rows(budget), ("source", *ends))
        say(f"\n{'; '.join(f'{time}: {phase.ends}' for time, phase in zip(ends, budget.phases, strict=True))}")
    for sentence in budget.not_covered:
        say(f"not in this budget: {sentence}")


def _result(campaign: Campaign, given: Path | None) -> Path | None:
    """Return the result to compare with: the one that is given, else the campaign's own where there is one.

    Raises:
        UserError: The given one is of another campaign.
    """
    from relnav_sim.cli.source import readable
    from relnav_sim.results import open_results

    path = Path("results") / f"{campaign.name}.h5" if given is None else existing_result(given)
    if not path.is_file():
        return None
    with readable(path) as file, open_results(file) as results:
        if results.campaign_hash == campaign.hash:
            return path
    if given is not None:
        raise UserError(f"{path} is a result of another campaign, or of another version of {campaign.name}")
    say(f"{path} is of another version of the campaign: it is not compared\n")
    return None


def _compare(budget: Budget, campaign: Campaign, case: int, path: Path) -> None:
    from relnav_sim.budget.verdict import in_words, squares_of, verdict
    from relnav_sim.cli.source import readable
    from relnav_sim.results import open_results

    of = campaign.cases[case]
    with readable(path) as file, open_results(file) as results:
        squares = squares_of(results, of.id, budget.filter)
    found = verdict(budget, squares, of.config.statistics.settle_s)
    if found is None:
        say(f"{path}: too few runs of {budget.filter} to compare with")
        return
    say(f"{path}: {in_words(found, budget)}")
