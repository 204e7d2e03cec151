"""A campaign over all workers: what is left, computed in blocks, merged into the results file."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.recorded_orbits import recorded_orbits
from relnav_sim.runner.executors.interface import Backend
from relnav_sim.runner.job import Say, job_of
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.progress import progress_of
from relnav_sim.runner.session_log import session_of
from relnav_sim.runner.shard_folder import move_aside, shard_folder
from relnav_sim.runner.stopping import look_at, looks
from relnav_sim.runner.tally import Tally
from relnav_sim.runner.warnings import warnings_before
from relnav_sim.runner.watch import Watch
from relnav_sim.runner.work import Block


def run_campaign(
    campaign: Campaign,
    out: str | os.PathLike[str] | None = None,
    workers: int = 2,
    backend: Backend = "loky",
    fresh: bool = False,
    part: tuple[int, int] = (1, 1),
    max_failures: int | None = None,
    timeout_s: float | None = None,
    progress: bool = False,
    say: Say = lambda sentence: None,
    scheduler: str | None = None,
    log: str | os.PathLike[str] | None = None,
    detail: Say | None = None,
) -> Path:
    """Simulate, filter and store a campaign; return the results file.

    What an earlier call has finished is taken as it is, after its checksums verify: an interrupted campaign goes on
    where it stopped, and more runs, filters or cases are added to a finished one. For this the shards, one file for
    each block of runs, are kept in a folder beside the result.

    Args:
        campaign: From `load_campaign`.
        out: The results file; default ``results/<name>.h5`` below the current folder.
        workers: Processes; the results do not depend on it.
        backend: ``loky`` (worker processes), ``sequential`` (this process) or ``dask`` (workers of a Dask scheduler).
        fresh: Start over: an existing result is moved aside, never deleted.
        part: (i, n): compute the i-th of n parts only, for several machines; merge the parts afterwards.
        max_failures: Stop once more runs than this have failed; the results file then holds what is finished.
        timeout_s: Most seconds for a block of runs from when a worker begins it; one that takes longer is ended, and
            cut until the runs and filters that do stand alone, and these count as failed. Not with ``sequential``.
        progress: Show a progress bar, or plain lines where there is no terminal.
        say: Told what a user should know, a sentence at a time.
        scheduler: With ``dask``, the scheduler's address, as ``tcp://host:8786``; None: a cluster of so many workers on
            this machine, for this campaign alone.
        log: A file to add a line of JSON to for everything that happens, see docs/overnight.md; the same is in the
            folder of shards in any case.
        detail: Told of every block that is done, a sentence at a time.

    Raises:
        RefusedError: The results file belongs to another campaign, or to other settings of this one; with ``dask``: the
            package distributed is not installed, or every worker has another relnav.
        ResultsError: What stands there is damaged.
        WorkersError: No worker process can be started, or the scheduler is gone, an `OSError`; what is finished is
            kept.
        OSError: The output can't be written.
        ValueError: A time limit with ``sequential``: nothing could end what hangs.

    Examples:
        >>> from relnav_sim import load_campaign, run_campaign
        >>> campaign = load_campaign("campaigns/demo.yaml", ["runs=2", "clock.duration_s=200", "name=short"])
        >>> run_campaign(campaign, backend="sequential").as_posix()
        'results/short.h5'
    """
    out = Path(out) if out is not None else default_out(campaign, part)
    watch = Watch(say, detail)
    # What it refuses is refused before anything is moved or written.
    pool = Pool(workers, backend, timeout_s, scheduler, watch.message, watch)
    if fresh:
        move_aside(out, say)
    with (
        job_of(campaign, out, say, part) as job,
        session_of(job.folder, watch, job.logs(None if log is None else Path(log))) as session,
        pool,
    ):
        job.take_stock()
        for sentence in recorded_orbits(campaign):
            say(sentence)
        for sentence in warnings_before(campaign):
            say(f"warning: {sentence}")
        for runs in looks(campaign, part):
            goes_on = not job.in_session and len(job.finished.shards)
            tasks = job.tasks(runs)
            blocks = [task for task in tasks if isinstance(task, Block)]
            if goes_on and blocks:
                say(f"{goes_on} finished blocks found; {len(blocks)} left to compute")
            session.expect(tasks, **job.about(tasks, workers, backend))
            pool.make_ready(tasks, say)
            tally = Tally(blocks, job.figures(), watch)
            with progress_of(tally, progress) as bar, closing(pool.computed(tasks)) as done_tasks:
                for done in done_tasks:
                    job.accept(done)
                    if isinstance(done.block, Block):
                        bar.advance(done.block, done.figures)
                    if max_failures is not None and job.failures > max_failures:
                        break
            if max_failures is not None and job.failures > max_failures:
                allowed = f"the {max_failures} allowed"
                session.state = "stopped"
                say(f"stopped: {job.failures} failures are more than {allowed}; the result is incomplete")
                break
            job.header, met = look_at(job.header, campaign, job.finished, runs)
            if met:
                say(f"stopped at {runs} runs: the rule of the campaign is met")
                break
        if not job.in_session:
            say("every run was finished already")
        job.write()
    say(f"the shards stay in {shard_folder(out)}, so that runs, filters and cases can be added")
    return out


def default_out(campaign: Campaign, part: tuple[int, int] = (1, 1)) -> Path:
    """Return the results file of a campaign below the current folder; parts for several machines have one each."""
    return part_out(Path("results") / f"{campaign.name}.h5", part)


def part_out(out: Path, part: tuple[int, int]) -> Path:
    """Return the file of a part beside that of its campaign, so that no part replaces another."""
    number, parts = part
    which = f".part_{number}_of_{parts}"
    return out if parts == 1 or out.stem.endswith(which) else out.with_name(f"{out.stem}{which}{out.suffix}")
