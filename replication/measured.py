"""What the campaigns found: figures per run by campaign, case and filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array
from relnav_sim.results.block import ResultsError
from relnav_sim.results.read import Results, open_results


class Measured:
    """The results of the replication's campaigns, opened as they are asked for; use it in a ``with`` statement.

    Args:
        paths: Results file by name of the campaign.
    """

    def __init__(self, paths: Mapping[str, Path]) -> None:
        self._paths = dict(paths)
        self._open = ExitStack()
        self._results: dict[str, Results] = {}
        self._columns: dict[str, dict[str, NDArray[Any]]] = {}

    def __enter__(self) -> Measured:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

    @property
    def campaigns(self) -> tuple[str, ...]:
        """Names of the campaigns that have been run, in order."""
        return tuple(self._paths)

    def results(self, campaign: str) -> Results:
        """Return a campaign's open results.

        Raises:
            KeyError: It has not been run.
            ResultsError: Its file can't be read.
        """
        if campaign not in self._results:
            self._results[campaign] = self._open.enter_context(open_results(self._paths[campaign]))
        return self._results[campaign]

    def has(self, campaign: str, filters: Sequence[str] = ()) -> bool:
        """Return whether a campaign has been run with these filters."""
        return campaign in self._paths and set(filters) <= set(self.results(campaign).filters)

    def case(self, campaign: str, wanted: Mapping[str, Any]) -> int:
        """Return the number of the first case whose swept variables are those wanted.

        Raises:
            ResultsError: There is none.
        """
        results = self.results(campaign)
        for index in range(len(results.cases)):
            variables = results.variables(index)
            if all(path in variables and _agrees(variables[path], value) for path, value in wanted.items()):
                return index
        raise ResultsError(f"{results.path}: no case with {dict(wanted)}")

    def values(self, campaign: str, case: int, filter: str, column: str, runs: Sequence[int] | None = None) -> Array:
        """Return one figure per run (runs,), in run order; NaN where the filter failed or the run is not there.

        Args:
            campaign: Name of the campaign.
            case: Number of the case.
            filter: Name of the filter.
            column: Column of `Results.summary`.
            runs: The runs; default: all the filter has.

        Raises:
            ResultsError: There is no such filter.
        """
        columns = self._summary(campaign)
        if filter not in self.results(campaign).filters:
            raise ResultsError(f"{self.results(campaign).path}: no filter {filter!r}")
        rows = np.flatnonzero((columns["case"] == case) & (columns["filter"] == filter))
        figures = np.where(columns["failed"][rows], np.nan, columns[column][rows].astype(np.float64))
        held = columns["run"][rows]
        if runs is None:
            return figures[np.argsort(held)]
        found = dict(zip(held.tolist(), figures.tolist(), strict=True))
        return np.array([found.get(run, np.nan) for run in runs])

    def runs(self, campaign: str, case: int, filter: str) -> tuple[int, ...]:
        """Return the numbers of a filter's runs, ascending."""
        return tuple(sorted(self.results(campaign).case_runs(case, filter).tolist()))

    def runs_in_words(self, campaign: str, *others: str) -> str:
        """Return how many runs of each case a campaign has: ``100 runs``, and of others where they have fewer or more.

        Args:
            campaign: Name of the campaign.
            others: Names of further ones, which need not have been run.
        """
        number = len(self.results(campaign).runs)
        held = {name: len(self.results(name).runs) for name in others if self.has(name)}
        differing = ", ".join(f"{name}: {runs}" for name, runs in held.items() if runs != number)
        return f"{number} runs ({differing})" if differing else f"{number} runs"

    def _summary(self, campaign: str) -> dict[str, NDArray[Any]]:
        if campaign not in self._columns:
            self._columns[campaign] = self.results(campaign).summary()
        return self._columns[campaign]


def _agrees(value: Any, wanted: Any) -> bool:
    """Return whether a validated value, defaults filled in, is what was asked for."""
    if isinstance(wanted, Mapping):
        return isinstance(value, Mapping) and all(key in value and _agrees(value[key], wanted[key]) for key in wanted)
    if isinstance(wanted, (list, tuple)):
        return isinstance(value, (list, tuple)) and len(value) == len(wanted) and all(map(_agrees, value, wanted))
    if isinstance(value, (list, tuple)):
        return all(_agrees(item, wanted) for item in value)  # one number for all three axes
    return bool(value == wanted)
