"""Several campaigns over the same workers: none waits for the last block of another."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from pathlib import Path

from relnav_sim.campaign import Campaign
from relnav_sim.runner.bound_task import BoundTask, Task
from relnav_sim.runner.executors.interface import Backend
from relnav_sim.runner.job import Job, Say, job_of
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.progress import progress_of
from relnav_sim.runner.session_log import session_of
from relnav_sim.runner.shard_folder import shard_folder
from relnav_sim.runner.tally import Tally
from relnav_sim.runner.watch import Watch
from relnav_sim.runner.work import Block


@dataclass(frozen=True)
class _Share:
    """One of the campaigns.

    Attributes:
        job: The campaign; its folder is held until its results file is written.
        hold: Gives the folder free.
        waiting: What is still to be done of it.
    """

    job: Job
    hold: ExitStack
    waiting: set[Hashable]

    def write(self, say: Say) -> None:
        whole = self.job.write()
        self.hold.close()
        if whole:
            say(f"{self.job.campaign.name} is complete")


def run_campaigns(
    jobs: Sequence[tuple[Campaign, Path]],
    workers: int = 2,
    progress: bool = False,
    say: Say = lambda sentence: None,
    backend: Backend = "loky",
    scheduler: str | None = None,
    timeout_s: float | None = None,
) -> None:
    """Simulate, filter and store campaigns, in this order; as `run_campaign` does one after the other, but sooner.

    A results file is written as soon as its campaign is complete. What an earlier call has finished is taken as it
    is. Stopping rules are not for several campaigns: each runs all its runs.

    Args:
        jobs: Campaigns with their results files.
        workers: Processes; the results do not depend on it.
        progress: Show a progress bar, or plain lines where there is no terminal.
        say: Told what a user should know, a sentence at a time.
        backend: Where the work is done; the results do not depend on it.
        scheduler: With ``dask``, the scheduler's address; None: a cluster of so many workers on this machine.
        timeout_s: Most seconds for a block of runs, as in `run_campaign`.

    Raises:
        RefusedError: A results file belongs to another campaign, or to other settings of this one.
        ResultsError: What stands there is damaged.
        OSError: The output can't be written.
    """
    with ExitStack() as held:
        # All folders first: a refusal should not come after an hour, and leaves no trace.
        holds = [held.enter_context(ExitStack()) for _ in jobs]
        found = [
            hold.enter_context(job_of(campaign, out, _named_in(say, campaign), remedy=_remedy(out)))
            for (campaign, out), hold in zip(jobs, holds, strict=True)
        ]
        watch = Watch(say)
        watched = [session_of(job.folder, watch, job.logs()) for job in found]
        sessions = [hold.enter_context(session) for session, hold in zip(watched, holds, strict=True)]
        pool = held.enter_context(Pool(workers, backend, timeout_s, scheduler, watch.message, watch))
        shares, tasks = {}, []
        for job, session, hold in zip(found, sessions, holds, strict=True):
            job.take_stock()
            left = job.tasks(job.campaign.runs)
            session.expect(left, **job.about(left, workers, backend))
            tasks += left
            shares[job.folder] = _Share(job, hold, {unit for task in left for unit in _units(task)})
            if not left:
                shares[job.folder].write(say)
        pool.make_ready(tasks, say)
        tally = Tally([_named(task, shares[task.folder].job) for task in tasks if isinstance(task, Block)], {}, watch)
        with progress_of(tally, progress) as bar, closing(pool.computed(tasks)) as done_tasks:
            for done in done_tasks:
                share = shares[done.block.folder]
                share.job.accept(done)
                share.waiting.difference_update(_units(done.block))
                if isinstance(done.block, Block):
                    bar.advance(_named(done.block, share.job), done.figures)
                if not share.waiting:
                    share.write(say)


def _named_in(say: Say, campaign: Campaign) -> Say:
    return lambda sentence: say(f"{campaign.name}: {sentence}")


def _remedy(out: Path) -> str:
    return f"give another --out, or move {out.name} and {shard_folder(out).name} aside to start over"


def _units(task: Task) -> set[Hashable]:
    """Return the runs of filters that a task computes: a block whose worker was killed comes back in pieces."""
    if isinstance(task, BoundTask):
        return {task.path}
    return {(task.case.id, name, run) for name in task.case.config.filters for run in task.runs}


def _named(block: Block, job: Job) -> Block:
    """Return a block whose case says its campaign, for the eyes of the progress alone."""
    several = len(job.campaign.cases) > 1
    label = f"{job.campaign.name}, {block.case.label}" if several else job.campaign.name
    return replace(block, case=replace(block.case, label=label))
