"""`relnav run`: simulate a campaign, or one run of it."""

from __future__ import annotations

import os
import re
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.backend import BackendName, BackendOption, LocalClusterOption, SchedulerOption, WorkersOption, where
from relnav_sim.cli.failures import Exit, UserError, guarded
from relnav_sim.cli.files import CAMPAIGNS, existing, result_name, target_file
from relnav_sim.cli.interrupts import ending_promptly
from relnav_sim.cli.notify import Notice, notifying
from relnav_sim.cli.output import command, count_in_words, say
from relnav_sim.cli.part import part_of
from relnav_sim.cli.watched import LogOption, NotifyOption, TimeoutOption, check_log, check_timeout

if TYPE_CHECKING:
    from relnav_sim.campaign import Campaign


_ROUTINE = re.compile(r"compil|\d+ finished blocks found|every run was finished|the shards stay|moved ")
"""How sentences begin that --quiet leaves out: all is well."""


def run(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The campaign, a YAML file.")],
    out: Annotated[
        str | None,
        typer.Option(
            metavar="PATH",
            help="The result file; in a folder, which is there or ends in /, it is called NAME.h5. A part has its own "
            "beside it, NAME.part_I_of_N.h5.",
            show_default="results/NAME.h5 in this folder",
        ),
    ] = None,
    runs: Annotated[int | None, typer.Option(min=1, help="Runs of each case instead of the campaign's own.")] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Change a value, as clock.step_s=1; may be repeated."),
    ] = None,
    filters: Annotated[
        list[str] | None,
        typer.Option(
            "--filter",
            metavar="NAME",
            help="Only this filter; may be repeated. The others can be added to the result later.",
            show_default="all",
        ),
    ] = None,
    workers: WorkersOption = None,
    backend: BackendOption = BackendName.LOKY,
    scheduler: SchedulerOption = None,
    local_cluster: LocalClusterOption = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Start over: an existing result is moved aside, never deleted.")
    ] = False,
    fail_fast: Annotated[bool, typer.Option("--fail-fast", help="Stop at the first failed run of a filter.")] = False,
    max_failures: Annotated[
        int | None, typer.Option(metavar="N", min=0, help="Stop once more than N runs of filters have failed.")
    ] = None,
    timeout_s: TimeoutOption = None,
    shard: Annotated[
        str | None,
        typer.Option(
            metavar="I/N|slurm",
            help="Only the I-th of N parts, as 1/4, or by the variables of a SLURM job array; then relnav merge.",
        ),
    ] = None,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Print warnings, failures and errors only, and no progress.")
    ] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print a line for every block that is done.")
    ] = False,
    log: LogOption = None,
    notify: NotifyOption = None,
    only: Annotated[
        str | None,
        typer.Option(metavar="CASE:RUN", help="Only one run of one case, as 0:17, into a file of its own."),
    ] = None,
    trace: Annotated[bool, typer.Option("--trace", help="With --only: store every step.")] = False,
    stress: Annotated[
        bool, typer.Option("--stress", help="Fly the truths of `stress:` too, which no filter is told of.")
    ] = False,
) -> None:
    """Simulate a campaign, run its filters and store the result.

    The same command continues a campaign that was interrupted.
    """
    notice = Notice(notify)

    @guarded
    def compute() -> None:
        with ending_promptly(_going_on(), notice.send):
            _check_options(only, trace, shard, fresh, fail_fast, max_failures, log, quiet, verbose)
            place = where(backend, workers, scheduler, local_cluster)
            check_timeout(timeout_s, backend)
            part = part_of(shard, os.environ)
            case, number = _case_and_run(only)

            from relnav_sim.campaign import load_campaign

            changed = [*(changes or []), *([f"runs={runs}"] if runs is not None else [])]
            campaign = load_campaign(existing(file, CAMPAIGNS), changed)
            if stress:
                campaign = _with_stress(campaign, file)
            if filters:
                campaign = _with_filters(campaign, filters)

            from relnav_sim.runner.run import default_out, part_out, run_campaign
            from relnav_sim.runner.single import case_number, run_single, single_out

            usual = default_out(campaign, part)
            if only is not None:
                usual = single_out(usual, case_number(campaign, case), number)
            result = None if out is None else part_out(target_file(out, usual.name), part)
            if result is not None and result.exists() and result.samefile(file):
                raise UserError(f"--out {result} is the campaign itself; give the name of a result file")

            if result is not None:
                result_name(result)

            from relnav_sim.results.block import RefusedError

            notice.campaign = campaign.name
            notice.result = os.path.abspath(result or default_out(campaign, part))

            def to_user(sentence: str) -> None:
                if not quiet or _ROUTINE.match(sentence) is None:
                    say(sentence, err=True)

            def detail(sentence: str) -> None:
                say(sentence, err=True)

            try:
                if only is not None:
                    target = _single_target(campaign, result, case, number)
                    path = run_single(
                        campaign, case, number, target, trace, place.backend, timeout_s, to_user, place.scheduler
                    )
                else:
                    path = run_campaign(
                        campaign,
                        result,
                        workers=place.workers,
                        backend=place.backend,
                        fresh=fresh,
                        part=part,
                        max_failures=0 if fail_fast else max_failures,
                        timeout_s=timeout_s,
                        scheduler=place.scheduler,
                        progress=not quiet,
                        say=to_user,
                        detail=detail if verbose else None,
                        log=log,
                    )
            except RefusedError as error:
                raise UserError(str(error)) from None
            _say_what_came_of_it(path, part, notice, quiet)

    with notifying(notice):
        compute()


def _with_stress(campaign: Campaign, file: Path) -> Campaign:
    """Return the campaign with its stressed cases.

    Raises:
        UserError: It has none.
    """
    if not campaign.stressed:
        raise UserError(f"{file} has no section 'stress:' to fly; leave out --stress, or see docs/regret.md")
    return campaign.with_stress()


def _with_filters(campaign: Campaign, names: list[str]) -> Campaign:
    """Return the campaign with these filters only.

    Raises:
        UserError: They can't be flown alone.
    """
    try:
        return campaign.with_filters(names)
    except ValueError as error:
        raise UserError(f"--filter: {error}") from None


def _say_what_came_of_it(path: Path, part: tuple[int, int], notice: Notice, quiet: bool) -> None:
    from relnav_sim.cli.failure_summary import divergence_summary, failure_summary
    from relnav_sim.results import open_results
    from relnav_sim.runner.failure_log import log_beside

    with open_results(path) as results:
        lacking = len(results.lacked_memory())
        failed = len(results.failures()) - lacking
        summary = failure_summary(results) + divergence_summary(results)
    following = command("relnav", "report", path) if part == (1, 1) else _merge_command(path, part)
    if not quiet:
        say(f"wrote {path}; next: {following}")
    if failed:
        log = log_beside(path)
        say(
            f"{count_in_words(failed, 'run of a filter', 'runs of a filter')} failed; the report counts them, "
            f"{command('relnav', 'inspect', path)} lists them{f', {log} has the tracebacks' if log else ''}",
            err=True,
        )
    for line in summary:
        say(line, err=True)
    notice.failed = failed
    notice.summary = f"{notice.campaign}: {count_in_words(failed, 'failed run of a filter', 'failed runs of filters')}"
    if failed or lacking:
        raise typer.Exit(Exit.SOME_RUNS_FAILED)


def _merge_command(path: Path, part: tuple[int, int]) -> str:
    """Return the command that merges the parts of a campaign once all are in the folder of this one."""
    number, parts = part
    name, _, ending = str(path).rpartition(f".part_{number}_of_{parts}")
    whole = command("relnav", "merge", name + ending)
    return (
        f"{whole} {shlex.quote(name + '.part_')}*{shlex.quote(f'_of_{parts}{ending}')} when all {parts} parts are there"
    )


def _check_options(
    only: str | None,
    trace: bool,
    shard: str | None,
    fresh: bool,
    fail_fast: bool,
    max_failures: int | None,
    log: Path | None,
    quiet: bool,
    verbose: bool,
) -> None:
    if quiet and verbose:
        raise UserError("--quiet and --verbose are opposites; give one of them")
    if trace and only is None:
        raise UserError("--trace needs --only CASE:RUN: it stores every step of one run")
    if only is not None and (shard is not None or fresh):
        raise UserError("--only computes one run into a file of its own; it takes neither --shard nor --fresh")
    if only is not None and log is not None:
        raise UserError("--log is of a campaign; leave it out with --only")
    check_log(log)
    if fail_fast and max_failures is not None:
        raise UserError("--fail-fast means --max-failures 0; give one of them")


def _case_and_run(only: str | None) -> tuple[str, int]:
    if only is None:
        return "", 0
    case, _, run = only.rpartition(":")
    if case and run.isdecimal():
        return case, int(run)
    raise UserError(f"--only takes CASE:RUN, as 0:17, not {only!r}; relnav inspect RESULT lists the cases")


def _single_target(campaign: Campaign, out: Path | None, case: str, run: int) -> Path | None:
    """Return where one run goes: never over the campaign's own result."""
    from relnav_sim.results.block import RefusedError
    from relnav_sim.runner.shard_folder import shard_folder

    if out is not None and shard_folder(out).exists():
        raise RefusedError(f"{out} holds a campaign; give --out another file for the run {case}:{run}")
    return out


def _going_on() -> str:
    """Return how to go on after an interruption."""
    again = shlex.join([Path(sys.argv[0]).name, *(word for word in sys.argv[1:] if word != "--fresh")])
    return f"interrupted; what is finished is kept, and this continues it: {again}"
