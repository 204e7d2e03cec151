"""A campaign under way, alone or one of several: what is left of it, what comes of that, and its results file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from relnav_sim import __version__
from relnav_sim.campaign import Campaign
from relnav_sim.results.block import ResultsError
from relnav_sim.results.campaign_header import CaseHeader, ResultHeader
from relnav_sim.results.merge import is_merged, merge_pieces, merged_from
from relnav_sim.results.pieces import bundle_piece
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.read import open_results
from relnav_sim.results.shard_files import MOST_LOOSE, held_bounds, held_shards, is_packed, pack
from relnav_sim.runner.bound_task import BoundTask, Task, bound_tasks, bounds_left, finished_bounds
from relnav_sim.runner.event_log import NAME
from relnav_sim.runner.executors.interface import Backend
from relnav_sim.runner.machines import machines_of
from relnav_sim.runner.pool import Done
from relnav_sim.runner.sessions import begin_session, end_session, other_versions, past_sessions, provenance_of
from relnav_sim.runner.shard_folder import START_OVER, check_same_campaign, working_folder, write_folder_header
from relnav_sim.runner.work import Block, Finished, blocks_left, finished_work
from relnav_sim.sensors import relative_sensors
from relnav_sim.simulation.memory import lacking_in_words

Say = Callable[[str], None]


@dataclass
class Job:
    """A campaign whose folder of shards is held for this process alone.

    Attributes:
        campaign: The campaign.
        out: Its results file.
        folder: The folder of its shards.
        header: What the results file will say of it.
        part: Which part of it is computed here.
        say: Told what a user should know, a sentence at a time.
        finished: Its shards.
        bounds: The bounds that are left.
        failures: Failed runs of filters, of those computed now.
        loose: Files that have come since some were packed.
        in_session: Whether something has been left to compute.
    """

    campaign: Campaign
    out: Path
    folder: Path
    header: ResultHeader
    part: tuple[int, int]
    say: Say
    finished: Finished = field(default_factory=Finished)
    bounds: list[BoundTask] = field(default_factory=list)
    failures: int = 0
    loose: int = 0
    in_session: bool = False

    def take_stock(self) -> None:
        """Find out what earlier commands have finished."""
        write_folder_header(self.folder, self.header)
        pack(self.folder)
        self.finished = finished_work(self.folder, self.campaign, self.say)
        self.bounds = bounds_left(bound_tasks(self.campaign, self.folder, self.part), self.say)
        if self.finished.shards and (others := other_versions(self.folder)):
            self.say(
                f"warning: some of the finished runs are of relnav {', '.join(others)}, and their numbers may differ "
                f"from those of {__version__}, see CHANGELOG.md; relnav run --fresh computes all anew"
            )

    def tasks(self, runs: int) -> list[Task]:
        """Return what is left of the first so many runs, and of the bounds."""
        blocks = list(blocks_left(replace(self.campaign, runs=runs), self.finished.runs, self.folder, self.part))
        if (blocks or self.bounds) and not self.in_session:
            self.in_session = True
            begin_session(self.folder)
        return [*blocks, *self.bounds]

    def accept(self, done: Done) -> None:
        """Count a block or a bound that is done."""
        if isinstance(done.block, Block):
            block = done.block
            self.finished.add(block.path.name, block.case.id, block.filter_ids, block.runs, done.figures)
            self.failures += done.failures
        else:
            self.bounds.remove(done.block)
        self.loose += 1
        if self.loose > MOST_LOOSE:
            pack(self.folder)
            self.loose = 0

    @property
    def found(self) -> int:
        """How many pairs of a run and a filter earlier commands have computed of the campaign."""
        wanted = {(case.id, *item) for case in self.campaign.cases for item in case.filter_ids.items()}
        runs = (runs for key, runs in self.finished.runs.items() if key in wanted)
        return sum(sum(run < self.campaign.runs for run in each) for each in runs)

    def about(self, tasks: Sequence[Task], workers: int, backend: Backend) -> dict[str, Any]:
        """Return what a log says of the campaign as its computation begins."""
        return {
            "campaign": self.campaign.name,
            "runs": self.campaign.runs,
            "cases": len(self.campaign.cases),
            "part": list(self.part),
            "backend": backend,
            "workers": workers,
            "blocks": len(tasks),
            "found": self.found,
        }

    def logs(self, log: Path | None = None) -> list[Path]:
        """Return the files to log to: that in the folder of shards, and another one if asked for."""
        return [self.folder / NAME, *([] if log is None else [log])]

    def figures(self) -> dict[tuple[str, str], dict[int, float]]:
        """Return the headline figures of the finished runs by case id and filter name."""
        ids = [(case.id, *item) for case in self.campaign.cases for item in case.filter_ids.items()]
        return {
            key[:2]: {run: f for run, f in self.finished.figures.get(key, {}).items() if run < self.campaign.runs}
            for key in ids
        }

    def write(self) -> bool:
        """Write the results file from all that is finished, and say what it lacks.

        Return whether there was memory for every run.
        """
        if self.in_session:
            end_session(self.folder)
            if is_packed(self.folder):
                pack(self.folder, most_loose=0)  # to open a file for each of the last takes longer than all the others
        self._say_what_is_left_out()
        tasks = bound_tasks(self.campaign, self.folder)
        shards, bounds = held_shards(self.folder)[0], held_bounds(self.folder)[0]
        pieces = [bundle_piece(shards[name]) for name in self.finished.shards]
        checksums = [bounds[task.name].checksum for task in tasks if task.name in bounds]
        if self.in_session or not is_merged(self.out, merged_from(self.header, pieces, checksums)):
            found = [bound for bound in finished_bounds(tasks, self.say) if bound is not None]
            merge_pieces(pieces, self.header, self._provenance(), self.out, complete=False, bounds=found, mark=True)
        for task in tasks:
            header = bounds[task.name].header if task.name in bounds else {}
            if reason := header.get("reason"):
                again = "; the same command tries again" if header.get("retry") else ""
                self.say(f"case {task.case.label} lacks a Cramér-Rao bound: {reason}{again}")
        if lacking := sum(len(piece.info.runs) for piece in pieces if piece.info.retry):
            self.say(f"{lacking_in_words(lacking)}, and fewer --workers leave more memory to each")
        return not lacking

    def _provenance(self) -> Provenance:
        """Return where the result came from; written anew with nothing new in it, the file keeps what it says."""
        if not self.in_session and (before := _result_before(self.out)) is not None:
            stored, provenance = before
            if (stored.runs, stored.cases) == (self.header.runs, self.header.cases):
                return provenance
        return provenance_of(past_sessions(self.folder), machines_of(self.folder))

    def _say_what_is_left_out(self) -> None:
        """Tell of runs, filters and cases that the file held and this campaign does not ask for; their shards stay."""
        before = _result_before(self.out)
        if before is None:
            return
        stored = before[0]
        wanted = {(case.id, name) for case in self.header.cases for name in case.filters}
        kept = {case.id for case in self.header.cases}
        stressed = sum(bool(case.stress) and case.id not in kept for case in stored.cases)
        held = [(case, name) for case in stored.cases if case.id in kept or not case.stress for name in case.filters]
        gone = [f"filter {name} of case {case.label}" for case, name in held if (case.id, name) not in wanted]
        left_out = [f"runs from {self.header.runs} on"] if stored.runs > self.header.runs else []
        left_out += [f"{stressed} stressed cases (--stress keeps them)"] if stressed else []
        left_out += gone if len(gone) <= 3 else [f"{len(gone)} filters of its cases"]
        if left_out:
            self.say(
                f"{self.out} held {', '.join(left_out)}, which this campaign does not ask for; they stay in the shards"
            )


@contextmanager
def job_of(
    campaign: Campaign, out: Path, say: Say, part: tuple[int, int] = (1, 1), remedy: str = START_OVER
) -> Iterator[Job]:
    """Give a campaign as a job. Its folder is held until the end: no other process works or writes there meanwhile.

    Args:
        campaign: The campaign.
        out: Its results file.
        say: Told what a user should know, a sentence at a time.
        part: (i, n): the i-th of n parts only.
        remedy: What the refusal of a result of other settings tells the user to do.

    Raises:
        RefusedError: Another process is at work there, or what stands there is of other settings.
        ResultsError: What stands there is damaged.
        OSError: The folder can't be made or written.
    """
    header = result_header(campaign)
    with working_folder(out) as folder:
        check_same_campaign(out, header, remedy)
        yield Job(campaign, out, folder, header, part, say)


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
            CaseHeader(
                case.id,
                case.label,
                case.variables,
                tuple(case.config.filters),
                case.filter_ids,
                {name: each.channels for name, each in relative_sensors(case.config.sensors).items()},
                case.stress,
                case.nominal,
            )
            for case in campaign.cases
        ),
        constants=campaign.cases[0].config.truth.constants.model_dump(),
    )


def _result_before(out: Path) -> tuple[ResultHeader, Provenance] | None:
    """Return what the file says now; None where there is none, or none that can be read: it is written anew."""
    if not out.exists():
        return None
    try:
        with open_results(out) as results:
            return results.header, results.provenance
    except ResultsError:
        return None
