"""Filters whose numbers coincide: lines over one another, which a figure draws once and names ``kf = ekf``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.plots.filter_facts import FilterFacts
from relnav_sim.plots.style import shown_name

_SAME = 1e-6  # relative: the same to six digits
_COMPARED = ("rms", "anees", "nis_mean")


def coinciding(items: Sequence[FilterFacts]) -> tuple[tuple[FilterFacts, ...], ...]:
    """Return filters in groups, in their order; those of a group have the same numbers in every run.

    Compared are the RMS errors, the ANEES and the mean NIS of each completed run, to six digits. A linear problem makes
    the ekf a kf, and noise of a single component makes an imm an ekf.

    Args:
        items: The filters.
    """
    groups: list[list[FilterFacts]] = []
    for item in items:
        group = next((each for each in groups if _coincide(each[0], item)), None)
        if group is None:
            groups.append([item])
        else:
            group.append(item)
    return tuple(map(tuple, groups))


def shared_name(group: Sequence[FilterFacts]) -> str:
    """Return the name of a group of filters in a legend, ``kf = ekf``."""
    return " = ".join(shown_name(item.name) for item in group)


def _coincide(one: FilterFacts, other: FilterFacts) -> bool:
    if not one.completed or not np.array_equal(one.runs[one.ok], other.runs[other.ok]):
        return False
    return all(
        np.allclose(one.per_run(name), other.per_run(name), rtol=_SAME, atol=0.0, equal_nan=True) for name in _COMPARED
    )
