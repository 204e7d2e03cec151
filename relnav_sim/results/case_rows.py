"""Which rows the results of a case take, known before any number is read."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from relnav_sim.results import layout
from relnav_sim.results.block import RefusedError
from relnav_sim.results.bound import BoundResult, CaseLimits, case_limits
from relnav_sim.results.campaign_header import CaseHeader
from relnav_sim.results.pieces import Piece


@dataclass(frozen=True)
class CaseRows:
    """A case that is to be written.

    Attributes:
        index: Number of the case.
        case: The case.
        pieces: What there is of it; retries last.
        bounds: Its bounds.
        runs: Number of runs of the campaign; later ones are left out.
    """

    index: int
    case: CaseHeader
    pieces: Sequence[Piece]
    bounds: Sequence[BoundResult]
    runs: int

    @cached_property
    def filters(self) -> dict[str, list[int]]:
        """Runs of each filter, ascending; filters without any are left out."""
        held: dict[str, set[int]] = {name: set() for name in self.case.filters}
        for piece in self.pieces:
            for name in piece.info.filters if not piece.info.retry else ():
                held[name].update(piece.info.runs)
        kept = {name: sorted(run for run in runs if run < self.runs) for name, runs in held.items()}
        return {name: runs for name, runs in kept.items() if runs}

    @cached_property
    def columns(self) -> dict[str, layout.Columns]:
        """What each filter with runs holds beyond what all do."""
        return {
            name: united_columns([p.info.columns[name] for p in self.pieces if _computed(p, name)])
            for name in self.filters
        }

    @cached_property
    def trajectories(self) -> list[int]:
        """Runs that fly a truth of their own, ascending; [-1]: all share one.

        Raises:
            RefusedError: Some pieces say so and others don't.
        """
        shared = {piece.info.shared_truth for piece in self.pieces}
        if len(shared) > 1:
            raise RefusedError(f"case {self.case.label}: some shards share one truth between runs, others don't")
        if shared == {True}:
            return [-1]
        held = {run for piece in self.pieces if not piece.info.retry for run in piece.info.runs}
        return sorted(run for run in held if run < self.runs)

    @cached_property
    def epochs(self) -> tuple[int, str]:
        """How many epochs are stored, and a digest of them.

        Raises:
            RefusedError: Pieces differ in them.
        """
        first = self.pieces[0].info.epochs
        for piece in self.pieces:
            if piece.info.epochs != first:
                path = piece.info.path
                raise RefusedError(f"{path}: its epochs differ from those of the other shards of this case")
        return first

    @cached_property
    def limits(self) -> CaseLimits:
        """Its bounds and observability.

        Raises:
            RefusedError: They disagree.
        """
        return case_limits(self.case, self.bounds, self.epochs[0], self.filters)

    @property
    def kind(self) -> Hashable:
        """What must be the same in cases that share a stack."""
        states = tuple(sorted((name, one.states) for name, one in self.limits.observed.items()))
        return self.epochs, tuple(sorted((name, repr(own)) for name, own in self.columns.items())), states


def united_columns(parts: Sequence[layout.Columns]) -> layout.Columns:
    """Return what one filter holds beyond what all do, from the parts of its runs."""
    diagnostics = sorted({name for part in parts for name in part.diagnostics})
    augmented = next((part for part in parts if part.augmented), layout.NO_COLUMNS)
    sensors = next((part.sensors for part in parts if part.sensors), ())
    edited = next((part.edited for part in parts if part.edited), ())
    factor = next((part.factor for part in parts if part.factor), ())
    channels = next((part.channels for part in parts if part.channels), ())
    return replace(
        augmented, diagnostics=tuple(diagnostics), sensors=sensors, edited=edited, factor=factor, channels=channels
    )


def groups_alike(cases: Sequence[CaseRows]) -> list[list[CaseRows]]:
    """Return cases in groups of those alike, each in order, which share datasets in the file."""
    alike: dict[Hashable, list[CaseRows]] = {}
    for rows in cases:
        alike.setdefault(rows.kind, []).append(rows)
    return list(alike.values())


def offsets(lengths: Mapping[int, int]) -> dict[int, int]:
    """Return where the rows of each case begin, by its number."""
    first, found = 0, {}
    for index, length in lengths.items():
        found[index] = first
        first += length
    return found


def _computed(piece: Piece, name: str) -> bool:
    return name in piece.info.filters and not piece.info.retry
