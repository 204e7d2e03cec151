"""How a case is named wherever relnav prints or takes one: its number from 0, with its label beside it."""

from __future__ import annotations

from collections.abc import Sequence

from relnav_sim.results.layout import case_group
from relnav_sim.wording import short_labels


def case_in_words(index: int, label: str) -> str:
    """Return a case as sentences name it: ``case 2 (radar.range_sigma_m=4)``."""
    return f"case {index} ({label})"


def case_in_tables(index: int, label: str) -> str:
    """Return a case as tables name it: ``2: radar.range_sigma_m=4``."""
    return f"{index}: {label}"


def place_of_case(case: int | str, labels: Sequence[str], ids: Sequence[str]) -> int | None:
    """Return the number of the case that is named, None where no case or more than one has the name.

    Args:
        case: Its number, also as text; its id; its label, in full or short; or both as `case_in_words` and
            `case_in_tables` print them; ``case_002`` as in the file.
        labels: The labels of the cases, in full.
        ids: Their ids.
    """
    for index, (label, name) in enumerate(zip(labels, ids, strict=True)):
        if case in (index, str(index), case_group(index), label, name):
            return index
    found = set()
    for index, label in enumerate(labels):
        for shown in {label, *short_labels([label])}:
            if case in (shown, f"case {shown}", case_in_words(index, shown), case_in_tables(index, shown)):
                found.add(index)
    return found.pop() if len(found) == 1 else None
