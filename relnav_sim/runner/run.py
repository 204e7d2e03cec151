"""A campaign over all workers: what is left, computed in blocks, merged into the results file."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from relnav_sim.campaign import Campaign
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import CaseHeader, ResultHeader, ResultsError
from relnav_sim.results.merge import merge_shards
from relnav_sim.results.provenance import collect_provenance
from relnav_sim.results.read import open_results
from relnav_sim.runner.changes import changed_keys
from relnav_sim.runner.pool import Backend, computed
from relnav_sim.runner.progress import progress_of
from relnav_sim.runner.work import blocks_left, filter_ids, finished_work

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
    where it stopped, and more runs, filters or cases are added to a finished one.

    Args:
        campaign: From `load_campaign`.
        out: The results file; default ``results/<name>.h5`` below the current folder.
        workers: Processes; the results do not depend on it.
        backend: ``loky`` (worker processes) or ``sequential`` (this process).
        fresh: Start over: an existing result is moved aside, never deleted.
        part: (i, n): compute the i-th of n parts only, for several machines; merge the parts afterwards.
        max_failures: Stop once more runs than this have failed; the results file then holds what is finished.
        timeout_s: Most seconds for a block of runs; its runs then count as failed.
        progress: Show a progress bar, or plain lines where there is no terminal.
        say: Told what a user should know, a sentence at a time.

    Raises:
        ResultsError: The results file belongs to another campaign, or to other settings of this one.
        OSError: The output can't be written.
    """
    out = Path(out) if out is not None else Path("results") / f"{campaign.name}.h5"
    folder = shard_folder(out)
    if fresh:
        _move_aside(out, folder, say)
    _check_same_campaign(out, folder, campaign)
    folder.mkdir(parents=True, exist_ok=True)
    _write_content(folder, campaign)
    started, clock = datetime.now(UTC), time.monotonic()
    finished = finished_work(folder, campaign, say)
    left = list(blocks_left(campaign, finished.runs, folder, part))
    if finished.shards:
        say(f"{len(finished.shards)} finished blocks found; {len(left)} left to compute")
    failures = 0
    with progress_of(sum(len(block.runs) for block in left), progress) as bar:
        for done in computed(left, workers, backend, timeout_s):
            bar.advance(len(done.block.runs))
            failures += done.failures
            if max_failures is not None and failures > max_failures:
                say(f"stopped: {failures} failures are more than the {max_failures} allowed; the result is incomplete")
                break
    finished = finished_work(folder, campaign, say)
    provenance = collect_provenance(started, datetime.now(UTC), time.monotonic() - clock)
    merge_shards(finished.shards, result_header(campaign), provenance, out, complete=False)
    return out


def shard_folder(out: Path) -> Path:
    """Return where the shards of a results file are kept."""
    return out.with_name(f"{out.name}.shards")


def result_header(campaign: Campaign) -> ResultHeader:
    """Return what the results file says of its campaign."""
    constants = campaign.cases[0].config.truth.constants.model_dump()
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
        constants=constants,
    )


def _check_same_campaign(out: Path, folder: Path, campaign: Campaign) -> None:
    stored = _stored_content(out, folder)
    if stored is None:
        return
    changed = changed_keys(stored, campaign.content)
    if changed:
        shown = ", ".join(changed[:6]) + (f" and {len(changed) - 6} more" if len(changed) > 6 else "")
        raise ResultsError(
            f"{out} holds results of other settings: {shown} differ; give another --out, "
            "or --fresh to move it aside and start over"
        )


def _stored_content(out: Path, folder: Path) -> Mapping[str, Any] | None:
    file = folder / "campaign.json"
    if file.exists():
        try:
            content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        except ValueError:
            raise ResultsError(f"{file} is damaged; --fresh moves it aside and starts over") from None
        return content
    if out.exists():
        with open_results(out) as results:
            return results.campaign_content
    return None


def _write_content(folder: Path, campaign: Campaign) -> None:
    with written_whole(folder / "campaign.json") as temporary:
        temporary.write_text(json.dumps(campaign.content), encoding="utf-8")


def _move_aside(out: Path, folder: Path, say: Say) -> None:
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")
    for path in (out, folder):
        if path.exists():
            aside = path.with_name(f"{path.name}.before-{stamp}")
            path.rename(aside)
            say(f"moved {path} to {aside}")
