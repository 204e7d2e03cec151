"""Tuning of a campaign's filters: every filter with the same budget, all candidates of a round on the same runs."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from relnav_sim.arrays import Mask
from relnav_sim.campaign import Campaign, Case
from relnav_sim.campaign.models import LARGEST_SEED, TuneObjective, TuneOptions
from relnav_sim.campaign.problems import Path as ValuePath
from relnav_sim.runner.executors.interface import Backend
from relnav_sim.runner.pool import Pool
from relnav_sim.runner.session_log import session_of
from relnav_sim.runner.watch import Watch
from relnav_sim.runner.work import Block, with_filters
from relnav_sim.statistics.intervals import paired_difference
from relnav_sim.tuning.bench import Bench, Candidate, filter_of
from relnav_sim.tuning.objective import Figures, Score, objective
from relnav_sim.tuning.progress import progress_of
from relnav_sim.tuning.result import Check, Evaluation, FilterTuning, Tuning
from relnav_sim.tuning.scalars import Scalar, TuningError, alike, free_scalars, value_of, with_values
from relnav_sim.tuning.search import Point, Search, rounded, search

SEARCH_WORD = "tune"
CHECK_WORD = "tune.check"


def derived_seed(seed: int, word: str) -> int:
    """Return a seed of its own for a purpose: a campaign's seed and the hash of a word, mixed; never the campaign's."""
    mixed = np.random.SeedSequence(seed, spawn_key=(zlib.crc32(word.encode()),)).generate_state(1, np.uint64)
    found = int(mixed[0]) % LARGEST_SEED
    return found if found != seed else found + 1


def tune_campaign(
    campaign: Campaign,
    options: TuneOptions | None = None,
    filters: Sequence[str] = (),
    cases: Sequence[int] = (),
    workers: int = 2,
    progress: bool = False,
    say: Callable[[str], None] = lambda sentence: None,
    backend: Backend = "loky",
    scheduler: str | None = None,
    log: Path | None = None,
    timeout_s: float | None = None,
) -> Tuning:
    """Return the tuned free numbers of a campaign's filters, with everything that was tried.

    Args:
        campaign: From `load_campaign`.
        options: How to search; default: the campaign's `tune:` section, or its defaults.
        filters: Names of the filters to tune; none given: those of the options, or all that have a free number.
        cases: Numbers of the cases to tune on; none given: all of them.
        workers: Processes; the result does not depend on it.
        progress: Show a progress bar, or plain lines where there is no terminal.
        say: Told what a user should know, a sentence at a time.
        backend: Where the work is done; the result does not depend on it.
        scheduler: With ``dask``, the scheduler's address; None: a cluster of so many workers on this machine.
        log: A file to add a line of JSON to for everything that happens, see docs/overnight.md.
        timeout_s: Most seconds for a block of runs, as in `run_campaign`; a candidate fails in runs that take longer.

    Raises:
        TuningError: The campaign cannot be tuned as asked.
        OSError: The log can't be written, or as in `run_campaign`.
    """
    options = options or campaign.tune or TuneOptions()
    chosen = [campaign.cases[number] for number in cases] or list(campaign.cases)
    filters = filters or options.filters
    free = free_scalars(campaign, tuple(filters), options.free, options.objective)
    for name in campaign.cases[0].config.filters:
        if name not in free and not filters:
            say(f"{name} has no free number and stays as it is")
    plans = [_Plan(name, scalars, chosen, options) for name, scalars in free.items()]
    seed, check_seed = derived_seed(campaign.seed, SEARCH_WORD), derived_seed(campaign.seed, CHECK_WORD)
    planned = len(plans) * len(chosen) * (options.budget * options.runs + 2 * options.check_runs)
    for_tuning = [with_filters(case, list(free)) for case in chosen]
    watch = Watch(say, like=filter_of)
    if backend == "loky" and workers == 1 and timeout_s is None:
        backend = "sequential"  # one worker is this process: a second one would only cost its start
    with (
        TemporaryDirectory(prefix="relnav_tune_") as name,
        session_of(folder := Path(name), watch, [] if log is None else [log]) as session,
        Pool(workers, backend, timeout_s, scheduler, watch.message, watch) as pool,
        progress_of(planned, progress, lambda: watch.left_s) as tell,
    ):

        def bench(seed: int, runs: int) -> Bench:
            return Bench(chosen, seed, runs, options.span, pool, workers, folder, tell)

        searching, checking = bench(seed, options.runs), bench(check_seed, options.check_runs)
        first = {plan.name: plan.candidate(plan.own) for plan in plans}
        tasks = searching.blocks([*first.values()] * options.budget) + checking.blocks([*first.values()] * 2)
        session.expect(
            tasks,
            campaign=campaign.name,
            runs=options.runs,
            cases=len(chosen),
            backend=backend,
            workers=workers,
            found=0,
        )
        pool.make_ready([Block(seed, place, case, (0,), Path()) for place, case in enumerate(for_tuning)], say)
        lost = _search_all(plans, searching)
        unused = [first[plan.name] for plan in plans for _ in range(options.budget - len(plan.evaluations))]
        if unused:
            watch.spare(searching.blocks(unused))
            tell(len(unused) * options.runs * len(chosen))
        found = {plan.name: FilterTuning(plan.name, plan.scalars, tuple(plan.evaluations)) for plan in plans}
        if options.check_runs:
            found = _checked(found, plans, options, checking)
    return Tuning(campaign, options, seed, check_seed, lost, found)


@dataclass
class _Plan:
    """A filter on its way through the search."""

    name: str
    scalars: tuple[Scalar, ...]
    cases: Sequence[Case]
    options: TuneOptions

    def __post_init__(self) -> None:
        entry = self.cases[0].config.filters[self.name]
        own = [value_of(entry, scalar.path) for scalar in self.scalars]
        self.own = tuple(
            scalar.low if value is None else value for scalar, value in zip(self.scalars, own, strict=True)
        )
        self.evaluations: list[Evaluation] = []
        places = (scalar.place(value) for scalar, value in zip(self.scalars, self.own, strict=True))
        self._places = rounded(tuple(places))
        self._search: Search = search(self._places, self.options.budget, alike(self.scalars))
        self.waiting = self._values(next(self._search))

    def candidate(self, values: Sequence[float]) -> Candidate:
        """Return the filter with other numbers."""
        changed: Mapping[ValuePath, float] = {s.path: v for s, v in zip(self.scalars, values, strict=True)}
        return Candidate(self.name, [with_values(case.config.filters[self.name], changed) for case in self.cases])

    def take(self, round: int, figures: Sequence[Figures]) -> None:
        """Take what the waiting candidates gave, and ask the search for more."""
        options = self.options
        scores = [objective(f, options.objective, options.weight, options.anees_band) for f in figures]
        self.evaluations += [
            Evaluation(round, values, f, score) for values, f, score in zip(self.waiting, figures, scores, strict=True)
        ]
        try:
            self.waiting = self._values(self._search.send([score.value for score in scores]))
        except StopIteration:
            self.waiting = []

    def _values(self, points: Sequence[Point]) -> list[tuple[float, ...]]:
        """Return the numbers at points of the search; at the start's place the campaign's own, to the last digit."""
        return [
            tuple(
                own if u == at else scalar.value(u)
                for scalar, u, at, own in zip(self.scalars, point, self._places, self.own, strict=True)
            )
            for point in points
        ]


def _search_all(plans: Sequence[_Plan], bench: Bench) -> tuple[int, ...]:
    """Search for all filters side by side; return the runs that none of the first candidates got through."""
    counted: Mask | None = None
    round = 0
    while active := [plan for plan in plans if plan.waiting]:
        found = bench.figures([plan.candidate(values) for plan in active for values in plan.waiting])
        if counted is None:
            counted = ~np.all([figures.broken for figures in found], axis=0)
            if counted.sum() < 2:
                raise TuningError(
                    "no filter gets through the tuning runs whatever its numbers; run the campaign to see why"
                )
        results = iter(found)
        for plan in active:
            plan.take(round, [next(results).of(counted) for _ in plan.waiting])
        round += 1
    return () if counted is None else tuple(map(int, np.flatnonzero(~counted)))


def _checked(
    found: Mapping[str, FilterTuning], plans: Sequence[_Plan], options: TuneOptions, bench: Bench
) -> dict[str, FilterTuning]:
    """Return the results with start and tuned filter compared on runs that the search has not seen."""
    pairs = [(plan.candidate(plan.own), plan.candidate(found[plan.name].best.values)) for plan in plans]
    figures = bench.figures([candidate for pair in pairs for candidate in pair])
    return {
        plan.name: replace(found[plan.name], check=_check(start, tuned, options))
        for plan, start, tuned in zip(plans, figures[::2], figures[1::2], strict=True)
    }


def _check(start: Figures, tuned: Figures, options: TuneOptions) -> Check:
    both = ~(start.broken | tuned.broken)

    # Within a band it is the position that is compared: how far the start is outside is not a gain.
    kind: TuneObjective = "position" if options.objective == "in_band" else options.objective

    def score(figures: Figures) -> Score:
        return objective(figures.of(both), kind, options.weight)

    if both.sum() < 2:
        return Check(start, tuned, None)
    return Check(start, tuned, paired_difference(score(tuned).per_run, score(start).per_run))
