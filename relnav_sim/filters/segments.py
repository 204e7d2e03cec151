"""What a smoother goes back over: a filter's estimates, and the linear steps by which it predicted them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Gaussian


@dataclass(frozen=True)
class Segment:
    """A filter's estimates over K successive epochs, with the step to each from the epoch before; epochs lead.

    Attributes:
        before: Mean (runs, n) and covariance (runs, n, n) one epoch before the first.
        mean: Filtered, (K, runs, n).
        covariance: (K, runs, n, n).
        image: The predicted means, (K, runs, n).
        F: Transition matrices of the steps, (K, runs, n, n).
        Q: Their process noise, (K, runs, n, n): the prediction's covariance is F P F^T + Q.
    """

    before: Gaussian
    mean: Array
    covariance: Array
    image: Array
    F: Array
    Q: Array


class Segments(Protocol):
    """Successive segments, in memory or not. Nothing is known of the step to the first epoch of the first of them."""

    @property
    def lengths(self) -> Sequence[int]:
        """How many epochs each has."""
        ...

    def __getitem__(self, place: int) -> Segment:
        """Return one of them."""
        ...
