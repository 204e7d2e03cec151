"""The commands that compute a result, or one run of it, again."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING

from relnav_sim.plots.axes import Axes

if TYPE_CHECKING:
    from relnav_sim.results.read import Results

_CHANGING = ("--set", "--runs")
_SWITCHES = ("--fresh", "--fail-fast", "--quiet", "-q", "--verbose", "-v", "--trace", "--stress")
"""The options without a value; a test compares them with the command's own, which this module may not import."""


def reproduce_commands(results: Results, axes: Axes) -> tuple[str, ...]:
    """Return the commands that compute the result and its report again."""
    report = f"relnav report {shlex.quote(_from_here(results.path))}{'' if axes == 'rtn' else f' --axes {axes}'}"
    recorded = results.provenance.command_line
    if _recorded_words(recorded) or results.replay is not None:
        return (recorded, report)
    file = shlex.quote(f"{results.campaign_name}.yaml")
    stress = " --stress" if any(header.stress for header in results.headers) else ""
    return (
        f"relnav run {file} --runs {results.planned_runs}{stress}   # the campaign file below, saved as {file}",
        report,
    )


def run_command(results: Results) -> str:
    """Return the command that reads the result's campaign as it was, to which ``--only CASE:RUN`` can be added.

    Of the recorded command it keeps the campaign file and what changes the campaign.
    """
    words = iter(_recorded_words(results.provenance.command_line)[2:])
    file, kept = f"{results.campaign_name}.yaml", []
    for word in words:
        name, _, value = word.partition("=")
        if not word.startswith("-"):
            file = word
        elif name in _CHANGING:
            kept += [word] if value else [word, next(words, "")]
        elif not value and name not in _SWITCHES:
            next(words, "")
    return shlex.join(["relnav", "run", file, *kept])


def _recorded_words(recorded: str) -> list[str]:
    """Return the words of a recorded ``relnav run``; none where the result was computed otherwise."""
    try:
        words = shlex.split(recorded)
    except ValueError:
        return []
    return words if len(words) > 1 and Path(words[0]).name == "relnav" and words[1] == "run" else []


def _from_here(path: Path) -> str:
    """Return a path as a command run from this folder needs it; elsewhere the name must do."""
    whole, here = path.resolve(), Path.cwd()
    return str(whole.relative_to(here)) if whole.is_relative_to(here) else path.name
