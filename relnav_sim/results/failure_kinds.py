"""What kind a failure is: the reason without what is of one run alone, so that a night's failures can be counted."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from relnav_sim.results.block import Failure

KILLED = "killed"
TIMEOUT = "took too long"
NO_MEMORY = "not enough memory"
LONGEST_KIND = 120

_OF_OUTSIDE = {"the worker process died": KILLED, "took longer than": TIMEOUT, "not enough memory": NO_MEMORY}
"""How the reasons begin that are no exception of a filter or sensor, and what they are called."""
_EXCEPTION = re.compile(r"^(?P<type>[A-Za-z_][\w.]*)(?:: .*)? \((?P<place>[^()\s]+:\d+)\)$", re.DOTALL)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


@dataclass(frozen=True)
class FailureGroup:
    """Failures of one kind.

    Attributes:
        kind: The kind, see `kind_of`.
        count: How many runs of filters.
        case: Label of the case of the first.
        first: The first of them.
    """

    kind: str
    count: int
    case: str
    first: Failure


def kind_of(reason: str) -> str:
    """Return the kind of a failure: the type and the place of an exception, else the reason with its numbers left out.

    Examples:
        >>> kind_of("LinAlgError: Matrix is singular at row 3 (belief.py:41)")
        'LinAlgError in belief.py:41'
        >>> kind_of("took longer than 20 s")
        'took too long'
        >>> kind_of("no component explains the reading: log p = -812.4")
        'no component explains the reading: log p = #'
    """
    for beginning, kind in _OF_OUTSIDE.items():
        if reason.startswith(beginning):
            return kind
    if found := _EXCEPTION.match(reason):
        return f"{found['type']} in {found['place']}"
    return _NUMBER.sub("#", reason)[:LONGEST_KIND] or "no reason told"


def grouped(failures: Iterable[tuple[str, Failure]]) -> list[FailureGroup]:
    """Return failures by kind, the most frequent first.

    Args:
        failures: Label of the case and failure, as `Results.failures` gives them.
    """
    groups: dict[str, list[tuple[str, Failure]]] = {}
    for case, failure in failures:
        groups.setdefault(kind_of(failure.reason), []).append((case, failure))
    found = [FailureGroup(kind, len(members), *members[0]) for kind, members in groups.items()]
    return sorted(found, key=lambda group: (-group.count, group.kind))
