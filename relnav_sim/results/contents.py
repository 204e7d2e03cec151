"""What a result holds, without its numbers: runs by case and filter, failures, and where it came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from relnav_sim.results.block import Failure
from relnav_sim.results.campaign_header import ResultHeader
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.read import Results


@dataclass(frozen=True)
class Contents:
    """What a result holds.

    Attributes:
        header: Its campaign.
        provenance: How it came about.
        sealed: As in `Results`.
        held: Numbers of its runs by number of the case and name of the filter.
        failures: Its failures as (case label, failure).
    """

    header: ResultHeader
    provenance: Provenance
    sealed: bool
    held: Mapping[tuple[int, str], Sequence[int]]
    failures: tuple[tuple[str, Failure], ...]

    @property
    def runs(self) -> set[int]:
        """Numbers of the runs that any case and filter holds."""
        return {run for runs in self.held.values() for run in runs}

    @cached_property
    def missing(self) -> dict[tuple[str, str], frozenset[int]]:
        """The planned runs that it does not hold, by case label and filter."""
        planned = frozenset(self.header.planned)  # one for all that holds nothing
        absent = {
            (self.header.cases[index].label, name): planned.difference(runs) if runs else planned
            for (index, name), runs in self.held.items()
        }
        return {key: runs for key, runs in absent.items() if runs}

    @property
    def lacking(self) -> int:
        """Number of failures whose run is missing: for want of memory or a worker, and no failure of the filter."""
        return sum(f.run in self.missing.get((case, f.filter), ()) for case, f in self.failures)


def contents_of(results: Results) -> Contents:
    """Return what an opened results file holds."""
    held = {
        (index, name): results.case_runs(index, name).tolist()
        for index, case in enumerate(results.headers)
        for name in case.filters
    }
    return Contents(results.header, results.provenance, results.sealed, held, results.failures())
