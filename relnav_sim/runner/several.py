"""Several campaigns over the same workers: none waits for the last block of another."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path

from relnav_sim.campaign import Campaign
from relnav_sim.runner.bound_task import BoundTask, Task, bound_tasks, bounds_left
from relnav_sim.runner.folder import check_same_campaign, working_folder, write_folder_header
from relnav_sim.runner.pool import computed
from relnav_sim.runner.progress import progress_of
from relnav_sim.runner.run import result_header, run_campaign
from relnav_sim.runner.sessions import begin_session, end_session
from relnav_sim.runner.tally import Tally
from relnav_sim.runner.work import Block, blocks_left, finished_work

Say = Callable[[str], None]


@dataclass
class _Job:
    """A campaign under way: its results file, its folder, held until all is computed, and what is left."""

    campaign: Campaign
    out: Path
    folder: Path
    hold: ExitStack
    left: list[Task] = field(default_factory=list)
    waiting: set[Hashable] = field(default_factory=set)


def run_campaigns(
    jobs: Sequence[tuple[Campaign, Path]],
    workers: int = 2,
    progress: bool = False,
    say: Say = lambda sentence: None,
) -> None:
    """Simulate, filter and store campaigns, in this order; as `run_campaign` does one after the other, but sooner.

    A results file is written as soon as its campaign is complete. What an earlier call has finished is taken as it
    is. Stopping rules are not for several campaigns: each runs all its runs.

    Args:
        jobs: Campaigns with their results files.
        workers: Processes; the results do not depend on it.
        progress: Show a progress bar, or plain lines where there is no terminal.
        say: Told what a user should know, a sentence at a time.

    Raises:
        RefusedError: A results file belongs to another campaign, or to other settings of this one.
        ResultsError: What stands there is damaged.
        OSError: The output can't be written.
    """
    with ExitStack() as held:
        # All folders first: a refusal should not come after an hour, and leaves no trace.
        waiting = [_held(campaign, out, held.enter_context(ExitStack())) for campaign, out in jobs]
        for job in waiting:
            _begin(job, say)
        named = {job.folder: job for job in waiting}
        tasks = [task for job in waiting for task in job.left]
        tally = Tally([_named(task, job) for job in waiting for task in job.left if isinstance(task, Block)], {})
        for job in waiting:
            if not job.left:
                _merge(job, workers, say)
        with progress_of(tally, progress) as bar, closing(computed(tasks, workers, "loky", None)) as done_tasks:
            for done in done_tasks:
                job = named[done.block.folder]
                job.waiting -= _units(done.block)
                if not isinstance(done.block, BoundTask):
                    bar.advance(_named(done.block, job), done.figures)
                if not job.waiting:
                    _merge(job, workers, say)


def _held(campaign: Campaign, out: Path, hold: ExitStack) -> _Job:
    folder = hold.enter_context(working_folder(out))
    aside = f"move {out.name} and {folder.name} aside to start over"
    check_same_campaign(out, result_header(campaign), f"give another --out, or {aside}")
    return _Job(campaign, out, folder, hold)


def _begin(job: _Job, say: Say) -> None:
    """Find out what is left of a campaign."""
    write_folder_header(job.folder, result_header(job.campaign))
    finished = finished_work(job.folder, job.campaign, say)
    bounds = bounds_left(bound_tasks(job.campaign, job.folder), say)
    job.left = [*blocks_left(job.campaign, finished.runs, job.folder), *bounds]
    job.waiting = {unit for task in job.left for unit in _units(task)}
    if job.left:
        begin_session(job.folder)


def _merge(job: _Job, workers: int, say: Say) -> None:
    """Write the results file of a campaign that is complete."""
    if job.left:
        end_session(job.folder)
    job.hold.close()
    run_campaign(job.campaign, job.out, workers)
    say(f"{job.campaign.name} is complete")


def _units(task: Task) -> set[Hashable]:
    """Return the runs of filters that a task computes: a block whose worker was killed comes back in pieces."""
    if isinstance(task, BoundTask):
        return {task.path}
    return {(task.case.id, name, run) for name in task.case.config.filters for run in task.runs}


def _named(block: Block, job: _Job) -> Block:
    """Return a block whose case says its campaign, for the eyes of the progress alone."""
    several = len(job.campaign.cases) > 1
    label = f"{job.campaign.name}, {block.case.label}" if several else job.campaign.name
    return replace(block, case=replace(block.case, label=label))
