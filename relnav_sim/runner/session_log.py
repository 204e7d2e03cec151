"""A command's work under watch: its logs opened, its beginning and its end written, whatever ends it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from relnav_sim.printable import message_of
from relnav_sim.results.provenance import command_line, relnav_in_words
from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.watch import Watch


class Session:
    """One command's work on a campaign.

    Args:
        folder: The folder of its tasks.
        watch: Watches over these.

    Attributes:
        state: What is written at the end.
    """

    def __init__(self, folder: Path, watch: Watch) -> None:
        self.state = "finished"
        self._folder = folder
        self._watch = watch
        self._has_begun = False

    def expect(self, tasks: Sequence[Task], **about: Any) -> None:
        """Take note of what is to be computed; the first time, write that the work begins.

        Args:
            tasks: What is to be computed in addition to what was expected before.
            about: What the log says of the work besides, see docs/overnight.md.
        """
        self._watch.expect(tasks)
        if self._has_begun or not tasks:
            return
        self._has_begun = True
        self._watch.begin(self._folder, command=command_line(), relnav=relnav_in_words(), **about)

    def end(self, state: str, reason: str = "") -> None:
        """Write how the work has ended, if it has begun."""
        if self._has_begun:
            self._watch.end(self._folder, state, reason)


@contextmanager
def session_of(folder: Path, watch: Watch, logs: Sequence[Path]) -> Iterator[Session]:
    """Give the session of a command; its end is written whatever it is.

    Args:
        folder: The folder of its tasks.
        watch: Watches over these.
        logs: Files to write to.

    Raises:
        OSError: A log can't be opened for writing.
    """
    with watch.logging(folder, logs):
        session = Session(folder, watch)
        try:
            yield session
        except KeyboardInterrupt:
            session.end("interrupted")
            raise
        except BaseException as error:
            session.end("failed", message_of(error))
            raise
        session.end(session.state)
