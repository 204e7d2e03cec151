"""Moves of single unknowns across their whole range: where steps downhill can't lead.

Some unknowns act on a group of numbers alone, as a filter's process noise on its columns: they are moved together, and
each group keeps its own best. What has choices, or one value with a probability, has no slope that would lead from one
to another.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from replication.inverse.misfit import Place, Sought
from replication.inverse.prior import Unknown
from replication.inverse.scoring import common_unknowns, own_unknowns

OWN_PLACES, PLACES = 8, 4
"""How many values are tried of an unknown that acts on one group alone, and of another."""
COMBINED = 5
"""How many of the best moves are tried together."""


def own_moved(sought: Sought, here: Place) -> Place:
    """Return a place where each group has the best values of the unknowns that act on it alone, one after the other."""
    paper = sought.paper
    for own in own_unknowns(paper).T:
        u, misfit = here.u.copy(), here.misfit.copy()
        grid = (np.arange(OWN_PLACES) + 0.5) / OWN_PLACES
        tried = np.repeat(u[None], OWN_PLACES, axis=0)
        tried[:, own] = grid[:, None]
        found = sought.look(tried).misfit
        for place, (numbers, _) in zip(own, paper.groups, strict=True):
            best = int(np.argmin(found[:, numbers].sum(axis=1)))
            if found[best, numbers].sum() < misfit[numbers].sum():
                u[place], misfit[numbers] = grid[best], found[best, numbers]
        here = Place(u, misfit)
    return here


def common_moved(sought: Sought, here: Place) -> Place:
    """Return the best place found by moving single common unknowns to another kind of value, and the best together."""
    paper = sought.paper
    moves = []
    for place in common_unknowns(paper):
        unknown = paper.unknowns[place]
        now = unknown.law(here.u[place])
        moves += [(place, value) for value in representatives(unknown) if unknown.law(value) != now]
    chosen: dict[int, float] = {}
    if moves:
        tried = np.repeat(here.u[None], len(moves), axis=0)
        for row, (place, value) in enumerate(moves):
            tried[row, place] = value
        total = sought.look(tried).misfit.sum(axis=1)
        for row in np.argsort(total, kind="stable"):
            if total[row] < here.total and len(chosen) < COMBINED:
                chosen.setdefault(*moves[row])
    if not chosen:
        return here
    together = np.repeat(here.u[None], len(chosen), axis=0)
    for row, (place, value) in enumerate(chosen.items()):
        together[row:, place] = value
    return min([here, *sought.places(together)], key=lambda place: place.total)


def representatives(unknown: Unknown) -> Array:
    """Return uniform numbers that give each kind of value that an unknown has; none if there is one kind alone.

    Each choice is a kind; one value that has a probability is, and the others are represented by some over their range.
    """
    grid = (np.arange(60) + 0.5) / 60
    first = np.sort(np.unique(unknown.law(grid), return_index=True)[1])
    if len(first) == len(grid):
        return np.empty(0)
    return np.asarray(grid[first[np.unique(np.linspace(0, len(first) - 1, PLACES).round().astype(int))]])
