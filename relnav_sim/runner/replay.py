"""Recorded measurements through a campaign's filters, and the result file of what can be scored."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from relnav_sim.campaign import Campaign, Case
from relnav_sim.campaign.identity import campaign_hash
from relnav_sim.campaign.problems import no_such
from relnav_sim.named_files import digest_of
from relnav_sim.recorded.readings import Readings
from relnav_sim.recorded.readings_files import load_readings
from relnav_sim.results.campaign_header import ReplayHeader
from relnav_sim.results.failure_kinds import kind_of
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.missing_runs import run_ranges
from relnav_sim.results.pieces import bundle_piece
from relnav_sim.results.provenance import collect_provenance
from relnav_sim.results.shards import unwritten_shard
from relnav_sim.runner.compute import Outcome
from relnav_sim.runner.executors.interface import Ended
from relnav_sim.runner.job import result_header
from relnav_sim.runner.peak_memory import peak_memory
from relnav_sim.runner.session_log import session_of
from relnav_sim.runner.single import case_number
from relnav_sim.runner.watch import HERE, Watch
from relnav_sim.runner.work import Block, with_filters
from relnav_sim.sensors import readings_layout
from relnav_sim.simulation.origin import difference_from_campaign
from relnav_sim.simulation.own_readings import ReplayError
from relnav_sim.simulation.recorded_chunks import last_epoch
from relnav_sim.simulation.replay import replay_block, shortened
from relnav_sim.simulation.replayed import RecordedFile, Replay, ReplayedBlock, joined
from relnav_sim.truth import EphemerisTruthOptions

TruthChoice = Literal["auto", "campaign", "none"]
_MOST_NUMBERS = 30_000_000
"""Numbers that are kept for the smoother at a time; runs are replayed so many together."""
_RANGES_NAMED = 6  # of runs


def replay_campaign(
    campaign: Campaign,
    files: Sequence[str | os.PathLike[str]],
    case: int | str = 0,
    filters: Sequence[str] = (),
    runs: Sequence[int] = (),
    sort: bool = False,
    truth: TruthChoice = "auto",
    participants: Mapping[str, str] = MappingProxyType({}),
    log: Path | None = None,
) -> Replay:
    """Run a campaign's filters on recorded measurements.

    Args:
        campaign: From `load_campaign`.
        files: Files of measurements.
        case: Number, id or label of the case.
        filters: Names of the filters; none: all.
        runs: Numbers of the recorded runs to replay; none: all.
        sort: Whether rows of a file may be out of order.
        truth: ``auto``: score where the campaign's truth is recorded orbits, or where the measurements are those that
            the campaign itself simulates; ``campaign``: score against the campaign's truth, whatever it is; ``none``.
        participants: Which sensor a participant of a TDM stands for, by the participant's name.
        log: A file to add a line of JSON to for everything that happens, see docs/overnight.md.

    Raises:
        ReadingsError: A file can't be used.
        ReplayError: The measurements do not fit the campaign, or a participant's sensor is none of it.
        RefusedError: There is no such case.
        OSError: A file can't be read, or the log can't be written.
    """
    started, clock = datetime.now(UTC), time.monotonic()
    number = case_number(campaign, case)
    chosen = _chosen(campaign.cases[number], filters)
    config = chosen.config
    layout = readings_layout(config.sensors)
    for sensor in participants.values():
        if sensor not in layout:
            raise ReplayError(no_such("sensor", sensor, list(layout)))
    recorded = _of_runs(load_readings(files, layout, config.truth.start_epoch, sort, participants), runs)
    against, unscored = _truth(campaign, chosen, recorded, truth)
    numbers = config.clock.epochs * 3 * 36 * len(config.filters)
    at_once = max(1, _MOST_NUMBERS // numbers)
    epochs = last_epoch(config, recorded) + 1
    own_errors = bool(against) and _errors_are_of_campaign(campaign, chosen, recorded)
    together = [recorded[first : first + at_once] for first in range(0, len(recorded), at_once)]
    as_replayed = replace(chosen, config=shortened(config, epochs))
    blocks = [Block(campaign.seed, number, as_replayed, tuple(one.run for one in some), Path()) for some in together]
    watch = Watch()
    with session_of(Path(), watch, [] if log is None else [log]) as session:
        about = {"campaign": campaign.name, "runs": len(recorded), "cases": 1, "backend": "sequential", "workers": 1}
        session.expect(blocks, **about, blocks=len(blocks), found=0)
        parts = []
        for block, some in zip(blocks, together, strict=True):
            replayed = partial(replay_block, chosen, campaign.seed, some, bool(against), epochs, own_errors)
            parts.append(_watched(watch, block, replayed))
    return Replay(
        campaign=_alone(campaign, chosen),
        case=chosen,
        files=tuple(RecordedFile(os.fspath(path), digest_of(Path(path))) for path in files),
        recorded=tuple(recorded),
        block=joined(parts),
        truth=against,
        unscored=unscored,
        started=started,
        wall_time_s=time.monotonic() - clock,
        notes=tuple(note for one in recorded for note in one.notes),
    )


def _watched(watch: Watch, block: Block, replayed: Callable[[], ReplayedBlock]) -> ReplayedBlock:
    """Return what filters make of the measurements of some runs, watched over as a block of a campaign is."""
    from threadpoolctl import get_cached_controller

    watch.began(block, HERE)
    began = time.monotonic()
    # As in a campaign: the last bits of what is learned depend on the number of BLAS threads.
    with get_cached_controller().limit(limits=1):
        found = replayed()
    reasons = [run.reason for one in found.filters.values() for run in one.failures]
    reasons += [why.reason for why in found.broken.values() for _ in block.runs]
    outcome = Outcome(len(reasons), {}, Counter(map(kind_of, reasons)), time.monotonic() - began, peak_memory())
    watch.ended(Ended(block, outcome), len(reasons))
    return found


def write_result(replay: Replay, out: Path) -> Path:
    """Write the scored estimates as a results file, which every command for results reads.

    Args:
        replay: A replay that is scored.
        out: The file; replaced as a whole.

    Raises:
        OSError: It can't be written.
    """
    runs = [one.run for one in replay.recorded]
    campaign, case = replay.campaign, replay.case
    header = replace(
        result_header(replace(campaign, runs=max(runs) + 1)),
        replay=ReplayHeader({file.path: file.sha256 for file in replay.files}, replay.truth, tuple(runs)),
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    shards = [unwritten_shard(out, result, campaign.seed, case.filter_ids) for result in replay.block.results]
    provenance = collect_provenance(replay.started, datetime.now(UTC), replay.wall_time_s)
    merge_pieces(map(bundle_piece, shards), header, provenance, out, complete=False)
    return out


def _chosen(case: Case, filters: Sequence[str]) -> Case:
    """Return the case with the filters asked for."""
    if not filters:
        return case
    known = list(case.config.filters)
    if unknown := [name for name in filters if name not in known]:
        raise ReplayError(no_such("filter", unknown[0], known))
    return with_filters(case, [name for name in known if name in filters])


def _of_runs(recorded: Sequence[Readings], runs: Sequence[int]) -> list[Readings]:
    """Return the recorded runs asked for."""
    known = {one.run: one for one in recorded}
    if missing := [run for run in runs if run not in known]:
        held = run_ranges(known, _RANGES_NAMED)
        raise ReplayError(f"the files hold no run {missing[0]}; they hold {held}; leave --run out to replay all")
    return [known[run] for run in sorted(set(runs) or known)]


def _truth(campaign: Campaign, case: Case, recorded: Sequence[Readings], choice: TruthChoice) -> tuple[str, str]:
    """Return what estimates are scored against, in words, empty: nothing; and why not, in a sentence."""
    if choice == "none":
        return "", ""
    if isinstance(case.config.truth, EphemerisTruthOptions):
        return "the orbits of the campaign's truth.ephemeris", ""
    if choice == "campaign":
        return "the truth that the campaign simulates, taken on trust", ""
    difference = difference_from_campaign(case.config, campaign.seed, recorded)
    if not difference:
        return "the truth that the campaign simulates, whose measurements these are", ""
    return "", (
        f"The measurements are not those that the campaign simulates with seed {campaign.seed}: {difference}. Another "
        "seed, run number, orbit or sensor than theirs does that; --truth campaign scores them all the same."
    )


def _errors_are_of_campaign(campaign: Campaign, case: Case, recorded: Sequence[Readings]) -> bool:
    """Return whether the measurements of a replay with a truth have the errors that the campaign draws.

    Along recorded orbits measurements of a flight are replayed as well as simulated ones; a simulated truth has its
    own.
    """
    config = case.config
    if not isinstance(config.truth, EphemerisTruthOptions) or not any(e.augment for e in config.filters.values()):
        return True
    return not difference_from_campaign(config, campaign.seed, recorded)


def _alone(campaign: Campaign, case: Case) -> Campaign:
    """Return the campaign with one case."""
    content = {**campaign.content, **case.config.model_dump(mode="json", exclude={"name"}), "grid": {}, "zip": {}}
    return replace(campaign, cases=(case,), content=content, hash=campaign_hash(content))
