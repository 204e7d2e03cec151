"""`relnav tune`: find the free numbers of a campaign's filters, every filter with the same budget."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from relnav_sim.cli.backend import BackendName, BackendOption, LocalClusterOption, SchedulerOption, WorkersOption, where
from relnav_sim.cli.failures import Exit, UserError, guarded
from relnav_sim.cli.files import CAMPAIGNS, existing, target_file
from relnav_sim.cli.interrupts import ending_promptly
from relnav_sim.cli.notify import Notice, notifying
from relnav_sim.cli.output import command, count_in_words, new_file, print_table, say
from relnav_sim.cli.validate import check_tuning
from relnav_sim.cli.watched import LogOption, NotifyOption, TimeoutOption, check_log, check_timeout
from relnav_sim.wording import first_of

if TYPE_CHECKING:
    from relnav_sim.campaign import Campaign
    from relnav_sim.campaign.models import TuneOptions


class Objective(StrEnum):
    """What is made small."""

    POSITION = "position"
    VELOCITY = "velocity"
    CONSISTENCY = "consistency"
    BOTH = "both"
    IN_BAND = "in_band"


class Span(StrEnum):
    """Over which epochs the metrics are taken."""

    SETTLED = "settled"
    WHOLE = "whole"


def tune(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The campaign, a YAML file.")],
    filters: Annotated[
        list[str] | None,
        typer.Option(
            "--filter",
            metavar="NAME",
            help="Tune this filter; may be repeated.",
            show_default="those of the section, or all",
        ),
    ] = None,
    objective: Annotated[
        Objective | None, typer.Option(case_sensitive=False, help="What is made small.", show_default="both")
    ] = None,
    budget: Annotated[
        int | None, typer.Option(min=5, max=1000, help="Most candidates for each filter.", show_default="25")
    ] = None,
    runs: Annotated[
        int | None, typer.Option(min=2, max=10_000, help="Runs of each case for a candidate.", show_default="20")
    ] = None,
    check_runs: Annotated[
        int | None,
        typer.Option(min=0, max=10_000, help="Further runs that compare start and tuned.", show_default="30"),
    ] = None,
    span: Annotated[
        Span | None,
        typer.Option(
            case_sensitive=False, help="Figures after settle_s, or from the first epoch.", show_default="settled"
        ),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATH[=LOW:HIGH]",
            help="A number to search, as filters.ekf.alpha=0.01:1; the filter then has these free and no others; "
            "may be repeated.",
            show_default="what `relnav show filter` lists",
        ),
    ] = None,
    cases: Annotated[
        list[str] | None,
        typer.Option(
            "--case",
            metavar="CASE",
            help="Tune on this case, by number from 0, id, or label as printed; may be repeated.",
            show_default="all",
        ),
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="PATH=VALUE",
            help="Change a value while tuning, as clock.duration_s=1200; not in the file written; may be repeated.",
        ),
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(
            metavar="PATH",
            help="The tuned campaign, or a folder for it; the curve goes beside it as _tuning.csv, .png and .pdf.",
            show_default="NAME_tuned.yaml beside FILE",
        ),
    ] = None,
    workers: WorkersOption = None,
    backend: BackendOption = BackendName.LOKY,
    scheduler: SchedulerOption = None,
    local_cluster: LocalClusterOption = None,
    timeout_s: TimeoutOption = None,
    log: LogOption = None,
    notify: NotifyOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing files.")] = False,
) -> None:
    """Find the free numbers of the filters, such as process noise, on random numbers that the campaign never uses.

    Every filter gets the same number of candidates on the same runs. The campaign is written with the numbers found
    and is otherwise left as it is. The options not given here come from the campaign's `tune:` section.
    """
    notice = Notice(notify)

    @guarded
    def compute() -> None:
        with ending_promptly("interrupted; nothing was written", notice.send):
            place = where(backend, workers, scheduler, local_cluster)
            check_timeout(timeout_s, backend)
            check_log(log)
            existing(file, CAMPAIGNS)
            name = f"{file.stem}_tuned.yaml"
            target = target_file(out, name) if out is not None else file.with_name(name)
            if target.exists() and file.exists() and target.samefile(file):
                raise UserError(f"--out {target} is the campaign itself; give another name")
            table, picture, page = (target.with_name(f"{target.stem}_tuning{end}") for end in (".csv", ".png", ".pdf"))
            for path in (target, table, picture, page):
                new_file(path, overwrite)
            if not target.parent.is_dir():
                raise UserError(f"{target.parent} is no directory")
            if set_on_filters := [text for text in changes or [] if text.strip().startswith("filters")]:
                raise UserError(
                    f"--set {set_on_filters[0]}: change the filters in the file, where the tuned ones are written"
                )

            from relnav_sim.campaign import load_campaign
            from relnav_sim.runner.single import case_number

            campaign = load_campaign(file, changes or [])
            notice.campaign, notice.result = campaign.name, os.path.abspath(target)
            check_tuning(campaign)
            numbers = tuple(dict.fromkeys(case_number(campaign, case) for case in cases or []))
            options = _options(
                campaign,
                {
                    "objective": None if objective is None else objective.value,
                    "budget": budget,
                    "runs": runs,
                    "check_runs": check_runs,
                    "span": None if span is None else span.value,
                },
                free or [],
                filters or [],
            )

            from relnav_sim.campaign.shared_field import shared_field_warnings
            from relnav_sim.plots.style import pdf, png
            from relnav_sim.results.atomic import written_whole
            from relnav_sim.tuning import TuningError, tune_campaign
            from relnav_sim.tuning.curve import curve_csv, curve_figure
            from relnav_sim.tuning.edit import edited, with_header
            from relnav_sim.tuning.words import FIGURES, NUMBERS, figure_rows, header_lines, number_rows, sentences

            for sentence in shared_field_warnings(campaign):
                say(f"warning: {sentence}", err=True)
            try:
                tuning = tune_campaign(
                    campaign,
                    options,
                    tuple(dict.fromkeys(filters or [])),
                    numbers,
                    place.workers,
                    backend=place.backend,
                    scheduler=place.scheduler,
                    log=log,
                    timeout_s=timeout_s,
                    progress=True,
                    say=lambda sentence: say(sentence, err=True),
                )
            except TuningError as error:
                raise UserError(str(error)) from None
            text = with_header(
                edited(campaign.text, tuning.changes(), campaign.path), header_lines(tuning, changes or [], numbers)
            )
            figure = curve_figure(tuning)
            contents = (text.encode(), curve_csv(tuning).encode(), png(figure), pdf(figure))
            for path, content in zip((target, table, picture, page), contents, strict=True):
                with written_whole(path) as temporary:
                    temporary.write_bytes(content)
        print_table(number_rows(tuning), NUMBERS)
        say("")
        print_table(figure_rows(tuning), FIGURES)
        say("")
        for sentence in sentences(tuning):
            say(sentence)
        say(f"wrote {target}; the curve is in {table}, {picture.name} and {page.name}")
        say(f"next: {command('relnav', 'run', target, '--out', f'results/{target.stem}.h5')}")
        notice.summary = f"{campaign.name}: {count_in_words(len(tuning.filters), 'filter')} tuned"
        if not all(found.found for found in tuning.filters.values()):
            raise typer.Exit(Exit.SOME_RUNS_FAILED)

    with notifying(notice):
        compute()


def _options(campaign: Campaign, given: dict[str, Any], free: list[str], filters: list[str]) -> TuneOptions:
    """Return the campaign's `tune:` section with what the command line says in its place."""
    from relnav_sim.campaign.models import TuneOptions

    base = campaign.tune or TuneOptions()
    chosen = filters or base.filters
    of_these = tuple(f"filters.{name}." for name in chosen)
    if chosen and (others := [text for text in free if not text.startswith(of_these)]):
        raise UserError(f"--free {others[0]} is no number of the filters to tune: {first_of(chosen)}")
    update = {key: value for key, value in given.items() if value is not None}
    if free:
        update["free"] = {**base.free, **dict(map(_free, free))}
    return base.model_copy(update=update)


def _free(text: str) -> tuple[str, tuple[float, float] | None]:
    path, equals, bounds = text.partition("=")
    if not equals:
        return path, None
    low, _, high = bounds.partition(":")
    try:
        return path, (float(low), float(high))
    except ValueError:
        raise UserError(f"--free takes PATH=LOW:HIGH, as filters.ekf.alpha=0.01:1, not {text!r}") from None
