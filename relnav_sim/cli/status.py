"""`relnav status`: how a campaign stands, from any terminal, while it runs and afterwards."""

from __future__ import annotations

import json
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.failures import Exit, UserError
from relnav_sim.cli.files import existing_result
from relnav_sim.cli.output import count_in_words, in_words, print_table, say
from relnav_sim.cli.source import SHARDS, newest_result

if TYPE_CHECKING:
    from relnav_sim.runner.status import RunningBlock, Status

BLOCKS_SHOWN = 12


def status(
    results: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RESULT...",
            help="Result files, which need not exist yet, or logs that --log has written.",
            show_default="the newest in results/",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print a line of JSON for each result.")] = False,
) -> None:
    """Show what a command is at: what runs, since when, what failed, how long to go.

    It only reads. Of relnav tune and relnav replay it needs the file of their --log. Several results, as the parts of
    a campaign on several machines, get a row each.
    """
    paths = [_result(path) for path in results or [newest_result(Path("results"))]]
    found = {path: _status(path) for path in paths}
    for path, one in found.items() if as_json else ():
        say(json.dumps({"result": str(path), **asdict(one)}))
    if not as_json:
        if len(found) == 1:
            _show(*next(iter(found.items())))
        else:
            _show_rows(found)
    if code := max((_code(one) for one in found.values()), default=0):
        raise typer.Exit(code)


def _result(path: Path) -> Path:
    return path.with_name(path.name.removesuffix(SHARDS)) if path.name.endswith(SHARDS) else path


def _status(path: Path) -> Status:
    from relnav_sim.runner.event_log import NAME
    from relnav_sim.runner.shard_folder import shard_folder
    from relnav_sim.runner.status import is_log, status_of

    if is_log(path):
        if (logged := status_of(path)) is None:
            raise UserError(f"'{path}' is neither a result file nor a log that --log has written")
        return logged
    folder = shard_folder(path)
    if not folder.exists():
        existing_result(path)
        if path.is_dir():
            raise UserError(f"'{path}' is a directory; give a result file, as results/NAME.h5")
    found = status_of(path)
    if found is None:
        raise UserError(f"{folder} has no {NAME}, so nothing is known of who is at work; see relnav inspect {path}")
    return found


def _code(one: Status) -> int:
    from relnav_sim.runner.status import AT_REST

    if one.state not in AT_REST:
        return Exit.UNFINISHED
    return Exit.SOME_RUNS_FAILED if one.failures or one.missing else 0


def _show(path: Path, one: Status) -> None:
    from relnav_sim.runner.status import is_log

    what, again = ("log", "") if is_log(path) else ("result", "; the same command goes on")
    rows = [(what, str(path)), ("state", _state_in_words(one, again)), ("done", _done_in_words(one))]
    if one.left_s is not None:
        rows.append(("time left", f"about {in_words(one.left_s)}"))
    if one.memory_mb is not None:
        rows.append(("memory", f"at most {one.memory_mb:.0f} MB in a worker"))
    if one.retries:
        rows.append(("tried again", count_in_words(one.retries, "block")))
    if one.missing:
        rows.append(("given up", count_in_words(one.missing, "run of a filter", "runs of filters") + ", left out"))
    rows.append(("failed", count_in_words(one.failures, "run of a filter", "runs of filters")))
    rows += [("", f"{count} {kind}") for kind, count in one.kinds.items()]
    rows.append(("command", one.command))
    print_table(rows)
    if one.running:
        say("")
        blocks = sorted(one.running, key=lambda block: (not block.is_slow, -block.elapsed_s))
        print_table(
            [_block_row(block) for block in blocks[:BLOCKS_SHOWN]],
            headings=("runs", "host", "since", "for", "expected", "filters", "case"),
        )
        if len(blocks) > BLOCKS_SHOWN:
            say(f"and {len(blocks) - BLOCKS_SHOWN} more")


def _show_rows(found: dict[Path, Status]) -> None:
    print_table(
        [
            (
                one.state.value,
                _done_in_words(one),
                "" if one.left_s is None else in_words(one.left_s),
                str(one.failures),
                str(one.retries),
                one.host,
                str(path),
            )
            for path, one in found.items()
        ],
        headings=("state", "done", "left", "failed", "again", "host", "result"),
    )


def _state_in_words(one: Status, again: str) -> str:
    from relnav_sim.runner.status import State

    where = f"on {one.host}, process {one.pid}, since {_local(one.began)}"
    return {
        State.RUNNING: f"running {where}",
        State.FINISHED: f"finished {_local(one.last_word)}",
        State.STOPPED: f"stopped {_local(one.last_word)}: too many failures",
        State.INTERRUPTED: f"interrupted {_local(one.last_word)}{again}",
        State.FAILED: f"failed {_local(one.last_word)}: {one.reason}",
        State.KILLED: f"killed: its process is gone; last word {_local(one.last_word)}{again}",
        State.SILENT: f"no word since {_local(one.last_word)} of process {one.pid} on {one.host}: look there",
    }[one.state]


def _done_in_words(one: Status) -> str:
    share = f" ({100 * one.done // one.total} %)" if one.total else ""
    return f"{one.done} of {one.total} runs of filters{share}"


def _block_row(block: RunningBlock) -> tuple[str, ...]:
    runs = "bound" if block.runs is None else "-".join(map(str, dict.fromkeys(block.runs)))
    expected = "" if block.expected_s is None else in_words(block.expected_s)
    slow = " slow" if block.is_slow else ""
    filters = ", ".join(block.filters)
    return (runs, block.host, _local(block.since), in_words(block.elapsed_s) + slow, expected, filters, block.case)


def _local(moment: str) -> str:
    return datetime.fromisoformat(moment).astimezone().strftime("%Y-%m-%d %H:%M:%S")
