"""A campaign over all workers: what is left, computed in blocks, merged into the results file."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.warnings import campaign_warnings
from relnav_sim.results.block import CaseHeader, ResultHeader, ResultsError
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import shard_piece
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.read import open_results
from relnav_sim.runner.bound_task import BoundTask, bound_tasks, bounds_left, finished_bound
from relnav_sim.runner.folder import check_same_campaign, move_aside, shard_folder, working_folder, write_folder_header
from relnav_sim.runner.pool import Backend, computed
from relnav_sim.runner.progress import progress_of
from relnav_sim.runner.sessions import begin_session, end_session, past_sessions, provenance_of
from relnav_sim.runner.stopping import look_at, looks
from relnav_sim.runner.tally import Tally
from relnav_sim.runner.work import Finished, blocks_left, filter_ids, finished_work

Say = Callable[[str], None]


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
) -> Path:
    """Simulate, filter and store a campaign; return the results file.

    What an earlier call has finished is taken as it is, after its checksums verify: an interrupted campaign goes on
    where it stopped, and more runs, filters or cases are added to a finished one. For this the shards, one file for
    each block of runs, are kept in a folder beside the result.

    Args:
        campaign: From `load_campaign`.
        out: The results file; default ``results/<name>.h5`` below the current folder.
        workers: Processes; the results do not depend on it.
        backend: ``loky`` (worker processes) or ``sequential`` (this process).
        fresh: Start over: an existing result is moved aside, never deleted.
        part: (i, n): compute the i-th of n parts only, for several machines; merge the parts afterwards.
        max_failures: Stop once more runs than this have failed; the results file then holds what is finished.
        timeout_s: Most seconds for a block of runs; one that takes longer is cut until the runs and filters that do
            stand alone, and these count as failed.
        progress: Show a progress bar, or plain lines where there is no terminal.
        say: Told what a user should know, a sentence at a time.

    Raises:
        RefusedError: The results file belongs to another campaign, or to other settings of this one.
        ResultsError: What stands there is damaged.
        OSError: The output can't be written.
    """
    out = Path(out) if out is not None else default_out(campaign, part)
    if fresh:
        move_aside(out, say)
    header = result_header(campaign)
    for sentence in campaign_warnings(campaign):
        say(f"warning: {sentence}")
    failures = 0
    with working_folder(out) as folder:
        check_same_campaign(out, header)
        write_folder_header(folder, header)
        finished = finished_work(folder, campaign, say)
        bound_work = bounds_left(bound_tasks(campaign, folder, part), say)
        new_blocks = 0
        for runs in looks(campaign, part):
            left = list(blocks_left(replace(campaign, runs=runs), finished.runs, folder, part))
            if (left or bound_work) and not new_blocks:
                begin_session(folder)
                if finished.shards and left:
                    say(f"{len(finished.shards)} finished blocks found; {len(left)} left to compute")
            with (
                progress_of(Tally(left, _figures_so_far(finished, campaign)), progress) as bar,
                closing(computed([*left, *bound_work], workers, backend, timeout_s)) as done_blocks,
            ):
                for done in done_blocks:
                    new_blocks += 1
                    if isinstance(done.block, BoundTask):
                        continue
                    bar.advance(done.block, done.figures)
                    block = done.block
                    finished.add(block.path, block.case.id, block.filter_ids, block.runs, done.figures)
                    failures += done.failures
                    if max_failures is not None and failures > max_failures:
                        break
            if max_failures is not None and failures > max_failures:
                say(f"stopped: {failures} failures are more than the {max_failures} allowed; the result is incomplete")
                break
            bound_work = []
            header, met = look_at(header, campaign, finished, runs)
            if met:
                say(f"stopped at {runs} runs: the rule of the campaign is met")
                break
        if new_blocks:
            end_session(folder)
        else:
            say("every run was finished already")
        _say_what_is_left_out(out, header, say)
        provenance = _provenance(out, header, folder, new_blocks)
        found = (finished_bound(task, say) for task in bound_tasks(campaign, folder))
        bounds = [bound for bound in found if bound is not None]
        pieces = [shard_piece(path) for path in finished.shards]
        merge_pieces(pieces, header, provenance, out, complete=False, bounds=bounds)
    labels = {case.id: case.label for case in campaign.cases}
    for bound in bounds:
        if bound.reason:
            again = "; the same command tries again" if bound.retry else ""
            say(f"case {labels[bound.case_id]} lacks a Cramér-Rao bound: {bound.reason}{again}")
    say(f"the shards stay in {shard_folder(out)}, so that runs, filters and cases can be added")
    return out


def default_out(campaign: Campaign, part: tuple[int, int] = (1, 1)) -> Path:
    """Return the results file of a campaign below the current folder; parts for several machines have one each."""
    number, parts = part
    which = f".part_{number}_of_{parts}" if parts > 1 else ""
    return Path("results") / f"{campaign.name}{which}.h5"


def result_header(campaign: Campaign) -> ResultHeader:
    """Return what the results file says of its campaign."""
    return ResultHeader(
        campaign_name=campaign.name,
        text=campaign.text,
        content=campaign.content,
        hash=campaign.hash,
        seed=campaign.seed,
        runs=campaign.runs,
        cases=tuple(
            CaseHeader(case.id, case.label, case.variables, tuple(case.config.filters), filter_ids(case))
            for case in campaign.cases
        ),
        constants=campaign.cases[0].config.truth.constants.model_dump(),
    )


def _figures_so_far(finished: Finished, campaign: Campaign) -> dict[tuple[str, str], dict[int, float]]:
    """Return the headline figures of the finished runs by case id and filter name."""
    ids = [(case.id, *item) for case in campaign.cases for item in filter_ids(case).items()]
    return {
        key[:2]: {run: figure for run, figure in finished.figures.get(key, {}).items() if run < campaign.runs}
        for key in ids
    }


def _provenance(out: Path, header: ResultHeader, folder: Path, new_blocks: int) -> Provenance:
    """Return where the result came from; written anew with nothing new in it, the file keeps what it says."""
    if not new_blocks and (before := _result_before(out)) is not None:
        stored, provenance = before
        if (stored.runs, stored.cases) == (header.runs, header.cases):
            return provenance
    return provenance_of(past_sessions(folder))


def _say_what_is_left_out(out: Path, header: ResultHeader, say: Say) -> None:
    """Tell of runs, filters and cases that the file held and this campaign does not ask for; their shards stay."""
    before = _result_before(out)
    if before is None:
        return
    stored = before[0]
    wanted = {(case.id, name) for case in header.cases for name in case.filters}
    held = [(case, name) for case in stored.cases for name in case.filters]
    gone = [f"filter {name} of case {case.label}" for case, name in held if (case.id, name) not in wanted]
    left_out = [f"runs from {header.runs} on"] if stored.runs > header.runs else []
    left_out += gone if len(gone) <= 3 else [f"{len(gone)} filters of its cases"]
    if left_out:
        say(f"{out} held {', '.join(left_out)}, which this campaign does not ask for; they stay in the shards")


def _result_before(out: Path) -> tuple[ResultHeader, Provenance] | None:
    """Return what the file says now; None where there is none, or none that can be read: it is written anew."""
    if not out.exists():
        return None
    try:
        with open_results(out) as results:
            return results.header, results.provenance
    except ResultsError:
        return None
