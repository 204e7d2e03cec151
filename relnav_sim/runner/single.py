"""One run of a campaign by itself, the same bits as in the campaign, for a closer look at it."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from relnav_sim.campaign import Campaign, Case
from relnav_sim.campaign.identity import campaign_hash
from relnav_sim.results.block import RefusedError
from relnav_sim.results.case_names import place_of_case
from relnav_sim.results.layout import case_group
from relnav_sim.results.merge import merge_shards
from relnav_sim.results.provenance import collect_provenance
from relnav_sim.results.read import open_results
from relnav_sim.runner.executors.interface import Backend
from relnav_sim.runner.failure_log import keep_log
from relnav_sim.runner.job import Say, result_header
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.run import default_out
from relnav_sim.runner.warnings import warnings_before
from relnav_sim.runner.work import Block
from relnav_sim.simulation.memory import lacking_in_words


def run_single(
    campaign: Campaign,
    case: int | str,
    run: int,
    out: str | os.PathLike[str] | None = None,
    trace: bool = False,
    backend: Backend = "loky",
    timeout_s: float | None = None,
    say: Say = lambda sentence: None,
    scheduler: str | None = None,
) -> Path:
    """Compute one run of one case; return its results file, which holds that case and run only.

    Args:
        campaign: From `load_campaign`.
        case: Number, id or label of the case.
        run: Number of the run.
        out: The file; default ``results/<name>.case_000.run_17.h5``, or beside the campaign's result.
        trace: Store every epoch.
        backend: ``loky``: in a process of its own, which a run that kills takes down; ``sequential``: in this one;
            ``dask``: on a worker.
        timeout_s: Most seconds for the run.
        say: Told what a user should know, a sentence at a time.
        scheduler: With ``dask``, the scheduler's address; None: a worker of this machine.

    Raises:
        RefusedError: There is no such case or run.
        OSError: The file can't be written.
    """
    index = case_number(campaign, case)
    if not 0 <= run < campaign.runs:
        raise RefusedError(f"the campaign has no run {run}; its runs are 0 to {campaign.runs - 1}")
    out = Path(out) if out is not None else single_out(default_out(campaign), index, run)
    chosen = _traced(campaign.cases[index]) if trace else campaign.cases[index]
    content = {**campaign.content, **chosen.config.model_dump(mode="json", exclude={"name"}), "grid": {}, "zip": {}}
    stresses = content.pop("stress", {})
    if chosen.stress:
        content["stress"] = {chosen.stress: stresses[chosen.stress]}
    alone = replace(campaign, cases=(chosen,), content=content, hash=campaign_hash(content))
    for sentence in warnings_before(alone):
        say(f"warning: {sentence}")
    out.parent.mkdir(parents=True, exist_ok=True)
    started, clock = datetime.now(UTC), time.monotonic()
    with tempfile.TemporaryDirectory(prefix=f".{out.name}.", dir=out.parent.absolute()) as folder:
        block = Block(campaign.seed, 0, chosen, (run,), Path(folder))
        with Pool(1, backend, timeout_s, scheduler, say) as pool:
            pool.make_ready([block], say)
            shards = [done.block.path for done in pool.computed([block])]
        provenance = collect_provenance(started, datetime.now(UTC), time.monotonic() - clock)
        merge_shards(shards, replace(result_header(alone), only=run), provenance, out, complete=False)
        keep_log(Path(folder), out)
    with open_results(out) as results:
        if lacking := len(results.lacked_memory()):
            say(lacking_in_words(lacking))
    return out


def single_out(out: Path, case: int, run: int) -> Path:
    """Return the results file of one run beside that of its campaign."""
    return out.with_name(f"{out.stem}.{case_group(case)}.run_{run}.h5")


def case_number(campaign: Campaign, case: int | str) -> int:
    """Return the number of the case with this number, id or label, in full or as reports print it.

    Raises:
        RefusedError: There is none.
    """
    found = place_of_case(case, [known.label for known in campaign.cases], [known.id for known in campaign.cases])
    if found is not None:
        return found
    last = len(campaign.cases) - 1
    if any(case in (known.id, known.label) for known in campaign.stressed):
        raise RefusedError(f"{case!r} is a stressed case; add --stress")
    raise RefusedError(f"the campaign has no case {case!r}; its cases are 0 to {last}, as `relnav validate` lists them")


def _traced(case: Case) -> Case:
    """Return the case with every epoch stored; its id stays that of the campaign's case."""
    clock = case.config.clock
    update: Mapping[str, Any] = {"clock": clock.model_copy(update={"store_every_s": clock.step_s})}
    return replace(case, config=case.config.model_copy(update=dict(update)))
