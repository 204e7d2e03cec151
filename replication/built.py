"""Tables, figures and experiments of which the campaigns are there: a replication may be complete in part."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from replication.measured import Measured

T = TypeVar("T")


def built(measured: Measured, *makers: tuple[Sequence[str], Callable[[], T]]) -> tuple[T, ...]:
    """Return what can be made, in order.

    Args:
        measured: What the campaigns found.
        makers: Names of the campaigns that are needed, and what makes one item of them.
    """
    return tuple(make() for campaigns, make in makers if all(map(measured.has, campaigns)))
