"""``--notify COMMAND``: a command of the user's own, run once when a campaign has ended, however it has."""

from __future__ import annotations

import os
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import typer

from relnav_sim.cli.failures import Exit
from relnav_sim.cli.output import say

LONGEST_S = 60.0
_ENDED_BY_SIGNAL = (Exit.HUNG_UP, Exit.INTERRUPTED, Exit.TERMINATED)


@dataclass
class Notice:
    """What is told at the end, as far as it is known by then.

    Attributes:
        command: What to run; None: nothing.
        result: The results file.
        campaign: Name of the campaign.
        summary: What came of it, in a sentence.
        failed: Failed runs of filters.
        process: The command, once it has been started.
    """

    command: str | None
    result: str = ""
    campaign: str = ""
    summary: str = ""
    failed: int | None = None
    process: subprocess.Popen[bytes] | None = None
    _began: float = field(default_factory=time.monotonic)
    _sent: threading.Event = field(default_factory=threading.Event)

    def send(self, code: int) -> None:
        """Start the command, if there is one and it has not been started; it outlives this process.

        Args:
            code: The exit code of this command.
        """
        if self.command is None or self._sent.is_set():
            return
        self._sent.set()
        variables = {
            "RELNAV_RESULT": self.result,
            "RELNAV_CAMPAIGN": self.campaign,
            "RELNAV_EXIT_CODE": str(code),
            "RELNAV_STATE": _state(code),
            "RELNAV_SUMMARY": self.summary,
            "RELNAV_FAILED": "" if self.failed is None else str(self.failed),
            "RELNAV_SECONDS": f"{time.monotonic() - self._began:.0f}",
        }
        try:
            self.process = subprocess.Popen(
                self.command,
                shell=True,
                env={**os.environ, **variables},
                stdin=subprocess.DEVNULL,
                stdout=2,  # standard output is the command's own
                start_new_session=True,
            )
        except (OSError, ValueError) as error:
            say(f"warning: --notify could not be started: {error}", err=True)


@contextmanager
def notifying(notice: Notice) -> Iterator[Notice]:
    """Send a notice at the end, with the exit code that comes of it, which it never changes."""
    code = int(Exit.UNEXPECTED)
    try:
        yield notice
        code = 0
    except typer.Exit as end:
        code = end.exit_code
        raise
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
        raise
    finally:
        notice.send(code)
        _wait(notice.process, code)


def _wait(process: subprocess.Popen[bytes] | None, code: int) -> None:
    """Wait for the user's command, unless this process is asked to end."""
    if process is None or code in _ENDED_BY_SIGNAL:
        return
    try:
        if returned := process.wait(LONGEST_S):
            say(f"warning: the command of --notify ended with exit code {returned}", err=True)
    except subprocess.TimeoutExpired:
        say(f"warning: the command of --notify takes longer than {LONGEST_S:g} s; it is left alone", err=True)


def _state(code: int) -> str:
    if code in (0, Exit.SOME_RUNS_FAILED):
        return "finished"
    return "interrupted" if code in _ENDED_BY_SIGNAL else "failed"
