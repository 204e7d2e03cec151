"""An open results file: what it says of its campaign, and which runs of which cases and filters it holds."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Integers
from relnav_sim.results import layout, store
from relnav_sim.results.block import Failure, RefusedError, ResultsError
from relnav_sim.results.case_names import place_of_case
from relnav_sim.results.header import read_header
from relnav_sim.results.stored_cases import StoredCases, StoredPart
from relnav_sim.wording import first_of


class HeldResult:
    """An open results file: what it says of its campaign, and which runs it holds.

    Wherever a case is asked for, its number, its label or its id will do.

    Attributes:
        path: The file.
        header: What the file says of its campaign, in one piece; the attributes below are its parts.
        campaign_name: Name of the campaign.
        campaign_text: The campaign file, word for word.
        campaign_content: Its validated content with all defaults.
        campaign_hash: Hash of the content.
        seed: Seed of the campaign.
        planned_runs: Number of runs the campaign asked for.
        planned: Their numbers: 0, 1, 2, ...; a single one in a file of ``relnav run --only``; of recorded measurements
            those of the recorded runs.
        replay: Where the measurements were recorded: their ``files`` with SHA-256, and the ``truth`` that estimates are
            scored against; None: they were simulated.
        stopping: The rule of adaptive stopping (``metric``, ``half_width``, ``at``, ``filter``) with the number of
            runs ``reached`` and whether the rule was ``met``; empty without one.
        headers: The cases with id, label, swept variables and filter names.
        cases: Labels of the cases, in order.
        filters: Names of all filters, in order.
        constants: Constants of the models by name.
        provenance: Versions, source revision, machine, times, command.
        sealed: Whether the file has a checksum over all its bytes, which then agrees; files of relnav before 0.1.1
            have none.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = store.open_checked(path, layout.FORMAT, whole=True)
        try:
            header, self.provenance = read_header(self._file)
            self.sealed = store.is_sealed(self._file)
            self._stored = StoredCases(self._file)
        except ResultsError:
            self._file.close()
            raise
        self.header = header
        self.campaign_name = header.campaign_name
        self.campaign_text = header.text
        self.campaign_content = dict(header.content)
        self.campaign_hash = header.hash
        self.seed = header.seed
        self.planned_runs = len(header.planned)
        self.planned = header.planned
        self.stopping = dict(header.stopping)
        self.replay = header.replay
        self.constants = dict(header.constants)
        self.headers = header.cases
        self.cases = tuple(case.label for case in header.cases)
        self._places: dict[int | str, int] = {index: index for index in range(len(self.headers))}
        for index, one in enumerate(self.headers):
            self._places.setdefault(one.label, index)
            self._places.setdefault(one.id, index)
        self.filters = tuple(dict.fromkeys(name for case in header.cases for name in case.filters))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the runs that any case and filter holds."""
        held = {run for i, case in enumerate(self.headers) for name in case.filters for run in self.case_runs(i, name)}
        return tuple(sorted(held))

    @cached_property
    def holds_covariances(self) -> bool:
        """Whether `covariance` returns any: the campaign asked for them (``clock.store_covariance``)."""
        return any(
            bool(self._filter_part(index, name).columns().factor)
            for index, case in enumerate(self.headers)
            for name in case.filters
            if len(self.case_runs(index, name))
        )

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the sensors that any filter's statistics are told by, in order; none in files of relnav 0.1."""
        found: dict[str, None] = {}
        for index, case in enumerate(self.headers):
            for name in case.filters:
                if len(self.case_runs(index, name)):
                    found |= dict.fromkeys(self._filter_part(index, name).columns().sensors)
        return tuple(found)

    @cached_property
    def nominal(self) -> tuple[int, ...]:
        """Numbers of the cases without a stress; all where no other is held, as by a single run of a stressed case."""
        everything = range(len(self.headers))
        return tuple(index for index in everything if not self.headers[index].stress) or tuple(everything)

    def stressed(self, case: int | str) -> dict[str, int]:
        """Return the numbers of the stressed cases of a case, by the name of the stress."""
        return dict(self._stressed.get(self.headers[self.case_index(case)].id, {}))

    @cached_property
    def _stressed(self) -> dict[str, dict[str, int]]:
        """Numbers of the stressed cases by id of the nominal case and name of the stress."""
        found: dict[str, dict[str, int]] = {}
        for index, header in enumerate(self.headers):
            if header.nominal:
                found.setdefault(header.nominal, {})[header.stress] = index
        return found

    def variables(self, case: int | str) -> dict[str, Any]:
        """Return the swept values of a case, by their path in the campaign."""
        return dict(self.headers[self.case_index(case)].variables)

    def case_index(self, case: int | str) -> int:
        """Return the number of the case with this number, id or label, in full or as reports print it.

        Raises:
            RefusedError: There is none.
        """
        if case not in self._places:
            found = place_of_case(case, self.cases, [header.id for header in self.headers])
            if found is None:
                raise RefusedError(
                    f"{self.path}: no case {case!r}; there are {first_of([repr(label) for label in self.cases])}"
                )
            self._places[case] = found
        return self._places[case]

    def case_runs(self, case: int | str, filter: str) -> Integers:
        """Return the numbers of the runs of a case and filter; empty where none has been computed yet."""
        index = self._check(case, filter)
        own, case_part, axis = self._stored.filter(index, filter), self._stored.case(index), layout.DIMENSIONS["time"]
        if own is None or case_part is None:
            return np.empty(0, dtype=np.int64)
        runs = own.read(layout.DIMENSIONS["run"])
        # Other programs read a filter's series against its own axis.
        if not np.array_equal(own.read(axis), case_part.read(axis)):
            here, there = own.group.name, case_part.group.name
            raise ResultsError(f"{self.path}: {here}/time differs from {there}/time; the file is damaged")
        if len(runs) and runs[-1] > self.planned[-1]:
            raise ResultsError(f"{self.path}: {own.group.name} has run {runs[-1]} of {self.header.runs}")
        return runs

    def missing(self) -> dict[tuple[str, str], tuple[int, ...]]:
        """Return the planned runs that the file does not hold, by case label and filter; empty when finished."""
        missing = {}
        everything = tuple(self.planned)  # once: of a file that holds nothing it is said of every filter
        for index, case in enumerate(self.headers):
            for name in case.filters:
                held = set(self.case_runs(index, name).tolist())
                absent = tuple(run for run in everything if run not in held) if held else everything
                if absent:
                    missing[case.label, name] = absent
        return missing

    def failures(self, case: int | str | None = None) -> tuple[tuple[str, Failure], ...]:
        """Return the failures as (case label, failure), of one case or of all."""
        found: list[tuple[str, Failure]] = []
        for index in range(len(self.headers)) if case is None else [self.case_index(case)]:
            found += [(self.cases[index], failure) for failure in self._stored.failures(index)]
        return tuple(found)

    def lacked_memory(self) -> tuple[tuple[str, Failure], ...]:
        """Return those of the failures whose run is missing: for want of memory, and no failure of the filter."""
        missing = self.missing()
        return tuple((case, f) for case, f in self.failures() if f.run in missing.get((case, f.filter), ()))

    def _shared(self, index: int, spec: layout.Dataset | layout.Dimension, rows: Any = ...) -> NDArray[Any]:
        part = self._stored.case(index)
        if part is None:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r} has no results yet")
        return part.read(spec, rows)

    def _check(self, case: int | str, filter: str) -> int:
        index = self.case_index(case)
        names = self.headers[index].filters
        if filter not in names:
            raise ResultsError(f"{self.path}: no filter {filter!r} in case {self.cases[index]!r}: {first_of(names)}")
        return index

    def _held(self, case: int | str, filter: str) -> StoredPart | None:
        """Return what is held of a filter; None where none of its runs has been computed yet."""
        return self._stored.filter(self._check(case, filter), filter)

    def _filter_part(self, index: int, filter: str) -> StoredPart:
        part = self._stored.filter(index, filter)
        if part is None:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r}, filter {filter!r} has no run yet")
        return part

    def _filter_data(self, index: int, filter: str, spec: layout.Dataset, rows: Any = ...) -> NDArray[Any]:
        return self._filter_part(index, filter).read(spec, rows)
