"""`relnav inspect`: what a result file holds and where it came from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from relnav_sim.cli.output import count_in_words, in_words, print_table, say
from relnav_sim.cli.source import contents_by_now, readable

if TYPE_CHECKING:
    from relnav_sim.results import Results
    from relnav_sim.results.contents import Contents

FAILURES_SHOWN = 20


def inspect(
    result: Annotated[Path, typer.Argument(metavar="RESULT", help="The result file.")],
    other: Annotated[
        Path | None,
        typer.Argument(
            metavar="OTHER", help="Another result file: are the two comparable?", show_default="only the one"
        ),
    ] = None,
    campaign: Annotated[
        bool, typer.Option("--campaign", help="Print the campaign file that the result was computed from, only.")
    ] = False,
) -> None:
    """Show what a result holds: campaign, cases, filters, runs, failures and where it came from.

    Of two results, also say whether they are comparable.
    """
    from relnav_sim.results import open_results
    from relnav_sim.results.contents import contents_of

    if other is None or campaign:
        contents = contents_by_now(result)
        if campaign:
            text = contents.header.text
            say(text, nl=not text.endswith("\n"))
        else:
            _show(contents)
        return
    with readable(result) as file, open_results(file) as results:
        _show(contents_of(results))
        with readable(other) as other_file, open_results(other_file) as second:
            say(f"\n{other}")
            _show(contents_of(second))
            _compare(results, second)


def _show(contents: Contents) -> None:
    from relnav_sim.results.seal import NO_SEAL
    from relnav_sim.results.stopping import stopping_in_words

    provenance = contents.provenance
    source = provenance.git_commit[:12] + (", with changes" if provenance.git_dirty == 1 else "")
    header, failures, lacking = contents.header, contents.failures, contents.lacking
    filters = dict.fromkeys(name for case in header.cases for name in case.filters)
    rows = [
        ("campaign", header.campaign_name),
        ("hash", header.hash[:12]),
        ("seed", str(header.seed)),
        ("runs", _runs_in_words(contents)),
        ("cases", "\n".join(f"{case.id}  {case.label}" for case in header.cases)),
        ("filters", ", ".join(filters)),
        ("failed", count_in_words(len(failures) - lacking, "run of a filter", "runs of a filter")),
        ("began", f"{provenance.started}, took {in_words(provenance.wall_time_s)}"),
        ("ended", provenance.finished),
        ("command", provenance.command_line),
        ("source", source or "not known"),
        ("checksum", "agrees with every byte" if contents.sealed else NO_SEAL),
        ("versions", ", ".join(f"{name} {version}" for name, version in provenance.versions.items())),
        ("machine", ", ".join(f"{name} {value}" for name, value in provenance.machine.items())),
    ]
    if provenance.machines:
        blocks = [f"{name}: {count_in_words(n, 'block', 'blocks')}" for name, n in provenance.machines.items()]
        rows.append(("computed on", "\n".join(blocks)))
    if lacking:
        rows.insert(7, ("lacked memory or a worker", count_in_words(lacking, "run of a filter", "runs of a filter")))
    if len(provenance.sessions) > 1:
        began = [
            f"{session.started[:19]}, {in_words(session.wall_time_s)}, relnav {session.relnav}: {session.command_line}"
            for session in provenance.sessions
        ]
        rows.insert(rows.index(next(row for row in rows if row[0] == "source")), ("sessions", "\n".join(began)))
    if header.replay is not None:
        files = "\n".join(f"{path}  SHA-256 {digest}" for path, digest in header.replay.files.items())
        rows[4:4] = [("recorded", files), ("scored", f"against {header.replay.truth}")]
    if header.stopping:
        rows.insert(4, ("stopped", stopping_in_words(header.stopping)))
    print_table(rows)
    if failures:
        say("")
        shown = [
            (label, str(failure.run), failure.filter or "all", str(failure.epoch), failure.reason)
            for label, failure in failures[:FAILURES_SHOWN]
        ]
        print_table(shown, headings=("case", "run", "filter", "epoch", "reason"))
    if len(failures) > FAILURES_SHOWN:
        say(f"and {len(failures) - FAILURES_SHOWN} more; relnav export RESULT has them all")


def _runs_in_words(contents: Contents) -> str:
    if contents.header.replay is not None:
        return ", ".join(map(str, contents.header.replay.runs))
    planned = contents.header.planned
    if len(planned) == 1 and planned[0] > 0:
        return f"run {planned[0]} only"
    apart = {id(runs): runs for runs in contents.missing.values()}
    missing = {run for runs in apart.values() for run in runs}
    to_do = f"; not finished: {count_in_words(len(missing), 'run')} to do" if missing else ""
    return f"{len(contents.runs)} of {len(planned)}{to_do}"


def _compare(first: Results, second: Results) -> None:
    from relnav_sim.results.comparable import comparable, same_numbers

    say("")
    if same_numbers(first, second):
        say("identical: the same cases, filters, runs and numbers, bit for bit")
        return
    reasons = comparable(first, second)
    if not reasons:
        say("comparable: same problem, same random numbers, same code")
        return
    say("not comparable:")
    for reason in reasons:
        say(f"  {reason}")
