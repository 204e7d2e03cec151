"""What the campaigns found, from their extracts: figures per run by campaign, case and filter, and curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from relnav_sim.arrays import Array
from replication.extract import Extract
from replication.kept import CurveKind


class Measured:
    """The extracts of the replication's campaigns.

    Args:
        extracts: Extract by name of the campaign; campaigns that have not been run are left out.
    """

    def __init__(self, extracts: Mapping[str, Extract]) -> None:
        self.extracts = dict(extracts)

    def has(self, campaign: str, filters: Sequence[str] = ()) -> bool:
        """Return whether a campaign has been run with these filters."""
        extract = self.extracts.get(campaign)
        return extract is not None and set(filters) <= set(extract.content["filters"])

    def case(self, campaign: str, wanted: Mapping[str, Any]) -> int:
        """Return the number of the first case whose swept variables are those wanted.

        Raises:
            KeyError: The campaign has not been run, or has no such case.
        """
        return case_with([case["variables"] for case in self.extracts[campaign].cases], wanted)

    def values(self, campaign: str, case: int, filter: str, column: str, runs: Sequence[int] | None = None) -> Array:
        """Return one figure per run (runs,), in run order; NaN where the filter failed or the run is not there.

        Args:
            campaign: Name of the campaign.
            case: Number of the case.
            filter: Name of the filter.
            column: A column of `kept.COLUMNS`.
            runs: The runs; default: all of the campaign.

        Raises:
            KeyError: There is no such campaign, filter or column.
        """
        extract = self.extracts[campaign]
        figures = np.array(extract.cases[case]["columns"][filter][column], dtype=np.float64)
        if runs is None:
            return figures
        found = dict(zip(extract.runs, figures.tolist(), strict=True))
        return np.array([found.get(run, np.nan) for run in runs])

    def runs(self, campaign: str) -> tuple[int, ...]:
        """Return the numbers of a campaign's runs, ascending."""
        return self.extracts[campaign].runs

    def runs_in_words(self, campaign: str, *others: str) -> str:
        """Return how many runs of each case a campaign has: ``100 runs``, and of others where they have fewer or more.

        Args:
            campaign: Name of the campaign.
            others: Names of further ones, which need not have been run.
        """
        number = len(self.runs(campaign))
        held = {name: len(self.runs(name)) for name in others if self.has(name)}
        differing = ", ".join(f"{name}: {runs}" for name, runs in held.items() if runs != number)
        return f"{number} runs ({differing})" if differing else f"{number} runs"

    def window(self, campaign: str, case: int, whole: bool = False) -> str:
        """Return the span that a campaign's figures are of: ``500-6000 s``.

        Args:
            campaign: Name of the campaign.
            case: Number of the case.
            whole: From the start on, not from the steady state.
        """
        extract = self.extracts[campaign]
        start = 0.0 if whole else extract.content["settle_s"]
        return f"{start:.0f}–{extract.cases[case]['end_s']:.0f} s"

    def curves(self, campaign: str, case: int, kind: CurveKind) -> tuple[Array, Mapping[str, Mapping[str, Array]]]:
        """Return the stored epochs (K,) and the curves by filter, as `replication.curves` describes them.

        Raises:
            KeyError: The campaign has not been run, or keeps no such curves.
        """
        for entry in self.extracts[campaign].cases[case]["curves"]:
            if entry["kind"] == kind:
                filters = {
                    name: {key: np.array(values, dtype=np.float64) for key, values in kept.items()}
                    for name, kept in entry["filters"].items()
                }
                return np.array(entry["time_s"], dtype=np.float64), filters
        raise KeyError(f"{campaign}, case {case}: no curves {kind}")

    def bound(self, campaign: str, case: int) -> tuple[float, float] | None:
        """Return the RMS of the posterior Cramér-Rao bound of a perfect model over the steady state, m and m/s.

        None where the campaign stores none.
        """
        bound = self.extracts[campaign].cases[case]["bound"]
        return None if bound is None else (bound[0], bound[1])


def case_with(variables: Sequence[Mapping[str, Any]], wanted: Mapping[str, Any]) -> int:
    """Return the number of the first case whose swept variables are those wanted.

    Raises:
        KeyError: There is none.
    """
    for index, held in enumerate(variables):
        if all(path in held and _agrees(held[path], value) for path, value in wanted.items()):
            return index
    raise KeyError(f"no case with {dict(wanted)}")


def _agrees(value: Any, wanted: Any) -> bool:
    """Return whether a validated value, defaults filled in, is what was asked for."""
    if isinstance(wanted, Mapping):
        return isinstance(value, Mapping) and all(key in value and _agrees(value[key], wanted[key]) for key in wanted)
    if isinstance(wanted, (list, tuple)):
        return isinstance(value, (list, tuple)) and len(value) == len(wanted) and all(map(_agrees, value, wanted))
    if isinstance(value, (list, tuple)):
        return all(_agrees(item, wanted) for item in value)  # one number for all three axes
    return bool(value == wanted)
