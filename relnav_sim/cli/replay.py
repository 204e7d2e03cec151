"""`relnav replay`: a campaign's filters on recorded measurements."""

from __future__ import annotations

import os
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.failures import Exit, UserError, guarded
from relnav_sim.cli.files import CAMPAIGNS, existing
from relnav_sim.cli.interrupts import ending_promptly
from relnav_sim.cli.notify import Notice, notifying
from relnav_sim.cli.output import command, count_in_words, print_table, say
from relnav_sim.cli.watched import LogOption, NotifyOption, check_log

if TYPE_CHECKING:
    from relnav_sim.report.replay import FilterFigures
    from relnav_sim.simulation.replayed import Replay

_READINGS = ("*.csv", "*.tdm")
RESULT = "result.h5"


class Truth(StrEnum):
    """What estimates are scored against."""

    AUTO = "auto"
    CAMPAIGN = "campaign"
    NONE = "none"


def replay(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The campaign, a YAML file.")],
    measurements: Annotated[
        list[Path],
        typer.Option(
            "--measurements",
            "-m",
            metavar="READINGS",
            help="A file of recorded measurements, CSV or CCSDS TDM; may be repeated. More files may follow the "
            "campaign's name.",
        ),
    ],
    more: Annotated[
        list[Path] | None, typer.Argument(metavar="[READINGS]...", help="Further files of measurements.")
    ] = None,
    sort: Annotated[bool, typer.Option("--sort", help="Rows may be out of order, or stand there twice.")] = False,
    participants: Annotated[
        list[str] | None,
        typer.Option(
            "--participant",
            metavar="NAME=SENSOR",
            help="Which sensor a participant of a TDM stands for; may be repeated.",
            show_default="by the sensors' names and what they read",
        ),
    ] = None,
    case: Annotated[str, typer.Option(help="The case, by number from 0, id, or label as printed.")] = "0",
    filters: Annotated[
        list[str] | None,
        typer.Option("--filter", metavar="NAME", help="A filter; repeat for several.", show_default="all"),
    ] = None,
    runs: Annotated[
        list[int] | None,
        typer.Option("--run", metavar="N", min=0, help="A recorded run; repeat for several.", show_default="all"),
    ] = None,
    truth: Annotated[
        Truth,
        typer.Option(
            case_sensitive=False,
            help="What estimates are scored against. auto: recorded orbits (truth.ephemeris), or the simulated truth "
            "where the measurements are the campaign's own, which is checked; campaign: the campaign's truth, "
            "unchecked; none: nothing.",
        ),
    ] = Truth.AUTO,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="PATH=VALUE", help="Change a value, as clock.step_s=1; may be repeated."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="The folder to write to.", show_default="results/NAME.replay")
    ] = None,
    log: LogOption = None,
    notify: NotifyOption = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what is there.")] = False,
) -> None:
    """Run a campaign's filters on recorded measurements, and say whether their residuals bear them out.

    With a truth the estimates are scored too, into a result that relnav report opens.
    """
    notice = Notice(notify)

    @guarded
    def compute() -> None:
        with ending_promptly("interrupted; nothing was written", notice.send):
            check_log(log)
            existing(file, CAMPAIGNS)
            files = [existing(path, _READINGS) for path in (*measurements, *(more or []))]

            from relnav_sim.campaign import load_campaign

            campaign = load_campaign(file, changes or [])
            folder = out if out is not None else Path("results") / f"{campaign.name}.replay"
            if folder.exists() and not folder.is_dir():
                raise UserError(f"{folder} is a file; give --out the name of a folder")
            if folder.is_dir() and any(folder.iterdir()) and not overwrite:
                raise UserError(f"{folder} holds something already; give another --out, or --overwrite to replace it")

            notice.campaign, notice.result = campaign.name, os.path.abspath(folder)

            from relnav_sim.recorded import EphemerisError
            from relnav_sim.recorded.readings import ReadingsError
            from relnav_sim.report.replay import figures_of, shared_findings, verdict, write_replay
            from relnav_sim.runner.replay import replay_campaign, write_result
            from relnav_sim.simulation.own_readings import ReplayError

            try:
                sensors = _sensors(participants or [])
                done = replay_campaign(
                    campaign, files, case, filters or (), runs or (), sort, truth.value, sensors, log
                )
            except (ReadingsError, EphemerisError, ReplayError) as error:
                raise UserError(str(error)) from None
            for sentence in (*done.notes, *done.block.warnings):
                say(f"warning: {sentence}", err=True)
            found = figures_of(done)
            for one in found:
                say(f"{one.name} is {verdict(one, len(done.recorded))}")
            for name, why in done.block.broken.items():
                say(f"{name} broke: {why.reason}", err=True)
            if shared := shared_findings(found):
                say(shared)
            say("")
            _print(found, done)
            (folder / RESULT).unlink(missing_ok=True)  # an earlier one would pass for this replay's
            page = write_replay(done, found, folder)
            say(f"wrote {page}")
            if done.truth and found:
                result = write_result(done, folder / RESULT)
                say(f"wrote {result}; next: {command('relnav', 'report', result)}")
        notice.failed = len(done.block.broken) * len(done.recorded) + sum(len(one.replayed.failures) for one in found)
        notice.summary = f"{campaign.name}: {count_in_words(len(done.recorded), 'recorded run')} replayed"
        if notice.failed:
            raise typer.Exit(Exit.SOME_RUNS_FAILED)

    with notifying(notice):
        compute()


def _sensors(participants: list[str]) -> dict[str, str]:
    """Return the sensor that each participant named stands for."""
    named: dict[str, str] = {}
    for text in participants:
        name, equals, sensor = text.rpartition("=")
        if not (name and equals and sensor):
            raise UserError(f"--participant {text!r} is not NAME=SENSOR, as in GRACE-B=crosslink")
        if named.setdefault(name, sensor) != sensor:
            raise UserError(f"--participant gives {name} two sensors, {named[name]} and {sensor}; leave one out")
    return named


def _print(found: list[FilterFigures], done: Replay) -> None:
    """Print the tables over all filters."""
    from relnav_sim.report.replay.tables import scores_table, sensors_table

    tables = [sensors_table(found)]
    if done.truth:
        tables.insert(0, scores_table(found, done.truth, done.block.config.statistics.settle_s))
        say(f"scored against {done.truth}")
    else:
        say("not scored: no truth is known for these measurements, so that nothing says how far the estimates are off")
        if done.unscored:
            say(done.unscored)
    for table in tables:
        rows = [[row.record or row.label, *(cell.text for cell in row.cells)] for row in table.rows]
        print_table(rows, headings=[table.corner, *(column.label for column in table.columns)])
        say("")
