"""The Cramér-Rao bound of a case: what a worker hands over, and the file that it is kept in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from relnav_sim.results.block import Array


@dataclass(frozen=True)
class BoundResult:
    """Bounds on the rms error of one case at its stored epochs.

    Attributes:
        case_index: Number of the case in the campaign, from 0.
        case_id: Hash of the case's content without its filters.
        perfect: Bound of a perfect model, (times, 8): components and norms in the order of `layout.QUANTITIES`.
        filters: Bound of each filter's own model, by its name.
    """

    case_index: int
    case_id: str
    perfect: Array
    filters: Mapping[str, Array]
