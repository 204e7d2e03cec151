"""A campaign over all workers: plan blocks, compute shards, merge them into the results file."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from relnav_sim.campaign import Campaign, Case
from relnav_sim.results.block import CaseHeader, ResultHeader, ResultsError
from relnav_sim.results.merge import merge_shards
from relnav_sim.results.provenance import collect_provenance
from relnav_sim.results.read import open_results
from relnav_sim.results.shards import read_shard, shard_name, write_shard
from relnav_sim.runner.block import simulate_block
from relnav_sim.runner.progress import progress_of
from relnav_sim.truth import model_constants

Backend = Literal["loky", "sequential"]


@dataclass(frozen=True)
class Block:
    """Some runs of one case, the unit of work and of what can be lost.

    Attributes:
        case_index: Number of the case.
        case: The case.
        runs: Numbers of the runs.
        path: Where its shard belongs.
    """

    case_index: int
    case: Case
    runs: range
    path: Path


def run_campaign(
    campaign: Campaign,
    out: str | os.PathLike[str] | None = None,
    workers: int = 2,
    backend: Backend = "loky",
    fresh: bool = False,
    progress: bool = False,
    say: Callable[[str], None] = lambda sentence: None,
) -> Path:
    """Simulate, filter and store a campaign; return the results file.

    Blocks that an earlier, interrupted call has finished are taken as they are, after their checksums verify.

    Args:
        campaign: From `load_campaign`.
        out: The results file; default ``results/<name>.h5`` below the current folder.
        workers: Processes.
        backend: ``loky`` (processes) or ``sequential`` (this process).
        fresh: Start over: an existing result is moved aside, never deleted.
        progress: Show a progress bar, or plain lines where there is no terminal.
        say: Told what a user should know, a sentence at a time.

    Raises:
        ResultsError: The results file belongs to another campaign.
        OSError: The output can't be written.
    """
    out = Path(out) if out is not None else Path("results") / f"{campaign.name}.h5"
    shards = out.with_name(out.name + ".shards")
    if fresh:
        _move_aside(out, shards, say)
    elif out.exists():
        _check_same_campaign(out, campaign)
    shards.mkdir(parents=True, exist_ok=True)
    started, clock = datetime.now(UTC), time.monotonic()
    blocks = list(plan_blocks(campaign, shards))
    waiting = [block for block in blocks if not _is_done(block, campaign, say)]
    if len(waiting) < len(blocks):
        say(f"{len(blocks) - len(waiting)} of {len(blocks)} blocks are done already; computing the rest")
    with progress_of(sum(len(block.runs) for block in waiting), progress) as bar:
        for runs in _compute(waiting, campaign, workers, backend):
            bar.advance(runs)
    provenance = collect_provenance(started, datetime.now(UTC), time.monotonic() - clock)
    merge_shards([block.path for block in blocks], result_header(campaign), provenance, out)
    return out


def plan_blocks(campaign: Campaign, shards: Path) -> Iterator[Block]:
    """Yield the blocks of a campaign in order: cases, then runs."""
    for index, case in enumerate(campaign.cases):
        for first in range(0, campaign.runs, campaign.block_runs):
            runs = range(first, min(first + campaign.block_runs, campaign.runs))
            yield Block(index, case, runs, shards / shard_name(case.id, list(case.config.filters), runs))


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
            CaseHeader(case.id, case.label, case.variables, tuple(case.config.filters)) for case in campaign.cases
        ),
        constants=model_constants(campaign.cases[0].config.truth),
    )


def _compute(blocks: Sequence[Block], campaign: Campaign, workers: int, backend: Backend) -> Iterator[int]:
    """Compute blocks in any order; yield the number of runs of each as it is stored."""
    if not blocks:
        return
    from joblib import Parallel, delayed, parallel_config

    options = {"inner_max_num_threads": 1} if backend == "loky" else {}
    with parallel_config(backend=backend, n_jobs=workers, **options):
        calls = (delayed(_compute_block)(block, campaign.seed, campaign.hash) for block in blocks)
        yield from Parallel(return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs")(calls)


def _compute_block(block: Block, seed: int, campaign_hash: str) -> int:
    from threadpoolctl import threadpool_limits

    # Threads of BLAS would fight with the other workers; the matrices here are small.
    with threadpool_limits(1):
        result = simulate_block(block.case, seed, block.runs, block.case_index)
    write_shard(block.path, result, campaign_hash)
    return len(block.runs)


def _is_done(block: Block, campaign: Campaign, say: Callable[[str], None]) -> bool:
    if not block.path.exists():
        return False
    try:
        info, _ = read_shard(block.path)
    except ResultsError as error:
        say(f"{error}; computing it again")
        return False
    return info.campaign_hash == campaign.hash and info.case_id == block.case.id and info.runs == tuple(block.runs)


def _check_same_campaign(out: Path, campaign: Campaign) -> None:
    with open_results(out) as results:
        if results.hash != campaign.hash:
            raise ResultsError(
                f"{out} holds results of another campaign ({results.campaign_name}) or of other settings; "
                "give another --out, or --fresh to move it aside and start over"
            )


def _move_aside(out: Path, shards: Path, say: Callable[[str], None]) -> None:
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")
    for path in (out, shards):
        if path.exists():
            aside = path.with_name(f"{path.name}.before-{stamp}")
            path.rename(aside)
            say(f"moved {path} to {aside}")
