"""A campaign's session under watch: its logs opened, its beginning and its end written, whatever ends it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from relnav_sim.printable import message_of
from relnav_sim.results.provenance import command_line, relnav_in_words
from relnav_sim.runner.bound_task import Task
from relnav_sim.runner.job import Job
from relnav_sim.runner.watch import Watch


class Session:
    """One command's work on a campaign.

    Args:
        job: The campaign.
        watch: Watches over its tasks.

    Attributes:
        state: What is written at the end.
    """

    def __init__(self, job: Job, watch: Watch) -> None:
        self.state = "finished"
        self._job = job
        self._watch = watch
        self._has_begun = False

    def expect(self, tasks: Sequence[Task], workers: int, backend: str) -> None:
        """Take note of what is to be computed now; the first time, write that the session begins."""
        self._watch.expect(tasks)
        if self._has_begun or not tasks:
            return
        self._has_begun = True
        job = self._job
        self._watch.begin(
            job.folder,
            command=command_line(),
            relnav=relnav_in_words(),
            campaign=job.campaign.name,
            runs=job.campaign.runs,
            cases=len(job.campaign.cases),
            part=list(job.part),
            backend=backend,
            workers=workers,
            blocks=len(tasks),
            found=_found(job),
        )

    def end(self, state: str, reason: str = "") -> None:
        """Write how the session has ended, if it has begun."""
        if self._has_begun:
            self._watch.end(self._job.folder, state, reason)


@contextmanager
def session_of(job: Job, watch: Watch, log: Path | None = None) -> Iterator[Session]:
    """Give the session of a command; its end is written whatever it is.

    Args:
        job: The campaign.
        watch: Watches over its tasks.
        log: A log besides that in the folder of shards.

    Raises:
        OSError: A log can't be opened for writing.
    """
    with watch.logging(job.folder, log):
        session = Session(job, watch)
        try:
            yield session
        except KeyboardInterrupt:
            session.end("interrupted")
            raise
        except BaseException as error:
            session.end("failed", message_of(error))
            raise
        session.end(session.state)


def _found(job: Job) -> int:
    """Return how many pairs of a run and a filter earlier commands have computed of a campaign."""
    wanted = {(case.id, *item) for case in job.campaign.cases for item in case.filter_ids.items()}
    runs = (runs for key, runs in job.finished.runs.items() if key in wanted)
    return sum(sum(run < job.campaign.runs for run in each) for each in runs)
