"""A deterministic search of the unit cube in rounds: the first axis by itself, then all axes together.

Axes at the front that are the same thing, three densities say, move as one at first: alone, none would show much.

Rounds, because all points of a round are tried on the same simulated measurements at once. A line of points along the
first axis comes first; each further round takes the minimum of a surrogate (a quadratic and cubic radial basis
functions through the nearest points; Gutmann, J. Global Optimization 19, 2001), and the points one reach away from the
best on every axis. The reach halves, on several axes only once the best stays about where it was.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from itertools import combinations_with_replacement

import numpy as np

from relnav_sim.arrays import Array

Point = tuple[float, ...]
Search = Generator[list[Point], list[float], None]

LINE_ALONE = 9
"""Points of the line where there is but one axis: 1.5 decades apart over twelve."""
LINE = 7
"""The same where other axes need points too."""
FIRST_SHARE = 0.55
"""Share of the budget for the first axis, where there are others."""
FIRST_REACH = 0.25
"""Distance of the first points on the other axes, in units of their range."""
FIRST_REACH_AGAIN = 1 / 12
"""The same on the first axis, once it has been searched by itself."""
GOES_ON = 0.5
"""The reach stays as it is where the best has moved by more than this part of it."""
SMALLEST_REACH = 1e-3
"""The search ends here, whatever is left of the budget."""
_PLACES = 4
_CANDIDATES = 10  # log2 of the surrogate's trial points
_BOX = 2.0  # they lie within so many reaches of the best
_NEIGHBOURS = 2  # points that the surrogate goes through, in units of what a quadratic needs


def search(start: Point, budget: int, together: int = 1) -> Search:
    """Yield rounds of points in [0, 1]^d, the start first; take their values, infinite where a point failed.

    Args:
        start: Where to begin; the first axis gets a line of points from end to end.
        budget: Most points in all, at least 3.
        together: So many axes at the front keep their distances from the first while it is searched by itself.
    """
    known: dict[Point, float] = {}
    if together > 1:
        share = min(budget, max(LINE, round(FIRST_SHARE * budget)))
        yield from _lifted(search((start[0],), share), start, together, known)
        reach = np.full(len(start), FIRST_REACH)
        reach[:together] = FIRST_REACH_AGAIN
        yield from _close_in(known, reach, range(len(start)), budget)
        return
    d = len(start)
    line = min(LINE_ALONE if d == 1 else LINE, budget - 1)
    along = [(i / (line - 1), *start[1:]) for i in range(line)]
    yield from _ask([start, *along], known, budget)
    alone = budget if d == 1 else max(len(known), round(FIRST_SHARE * budget))
    reach = np.zeros(d)
    reach[0] = 1 / (line - 1) / 2
    yield from _close_in(known, reach, range(1), alone)
    if d > 1:
        reach = np.full(d, FIRST_REACH)
        reach[0] = FIRST_REACH_AGAIN
        yield from _close_in(known, reach, range(d), budget)


def _lifted(line: Search, start: Point, together: int, known: dict[Point, float]) -> Search:
    """Ask for what a search of one axis asks for, with the other axes moved along."""
    points = next(line)
    while True:
        moved = [rounded((*(u + place - start[0] for u in start[:together]), *start[together:])) for (place,) in points]
        values = yield moved
        known.update(zip(moved, values, strict=True))
        try:
            points = line.send(values)
        except StopIteration:
            return


def _close_in(known: dict[Point, float], reach: Array, axes: range, budget: int) -> Search:
    """Ask for points ever closer about the best, until so many are known."""
    while len(known) < budget and reach.max() >= SMALLEST_REACH:
        centre = min(known, key=known.__getitem__)
        yield from _ask(
            [*_surrogate_minimum(known, centre, reach, axes), *_axis_points(centre, reach, axes)], known, budget
        )
        best = min(known, key=known.__getitem__)
        # On one axis the neighbours of the best bracket it now; on more, a valley that bends may go on.
        moved = np.abs(np.subtract(best, centre)[: len(axes)] / reach[: len(axes)]).max()
        if len(axes) == 1 or moved < GOES_ON:
            reach = reach / 2


def _ask(points: Sequence[Point], known: dict[Point, float], budget: int) -> Search:
    """Ask for the points that are new, as far as the budget goes."""
    new = [point for point in dict.fromkeys(map(rounded, points)) if point not in known][: budget - len(known)]
    if new:
        values = yield new
        known.update(zip(new, values, strict=True))


def rounded(point: Point) -> Point:
    """Return the point inside the cube on the grid on which points are told apart."""
    return tuple(round(min(max(u, 0.0), 1.0), _PLACES) + 0.0 for u in point)


def _axis_points(centre: Point, reach: Array, axes: range) -> list[Point]:
    return [
        tuple(u + sign * float(reach[axis]) if i == axis else u for i, u in enumerate(centre))
        for axis in axes
        for sign in (-1, 1)
    ]


def _surrogate_minimum(known: dict[Point, float], centre: Point, reach: Array, axes: range) -> list[Point]:
    """Return where the surrogate is least near the best; nothing where it says nothing new."""
    from scipy.interpolate import RBFInterpolator
    from scipy.stats import qmc

    d = len(axes)
    finite = {p: value for p, value in known.items() if np.isfinite(value) and p[d:] == centre[d:]}
    if len(finite) < d + 2:
        return []
    middle = np.array(centre[:d])
    tried = (np.array([point[:d] for point in finite]) - middle) / reach[:d]
    values = np.array(list(finite.values()))
    # The nearest points only: high values far away would make the surface wave.
    near = np.argsort(np.abs(tried).max(axis=1), kind="stable")[: _NEIGHBOURS * (d + 1) * (d + 2) // 2]
    degree = next((degree for degree in (2, 1) if _settles(tried[near], degree)), None)
    if degree is None:
        return []
    surface = RBFInterpolator(tried[near], values[near], kernel="cubic", degree=degree)
    trial = _BOX * (2 * qmc.Sobol(d, scramble=False).random_base2(_CANDIDATES) - 1)
    inside = (np.clip(middle + trial * reach[:d], 0.0, 1.0) - middle) / reach[:d]
    best = inside[np.argmin(surface(inside))]
    if np.abs(best - tried).max(axis=1).min() < 1 / 16:
        return []
    return [(*map(float, middle + best * reach[:d]), *centre[d:])]


def _settles(points: Array, degree: int) -> bool:
    """Return whether values at the points settle a polynomial of a degree."""
    columns = [np.ones(len(points)), *points.T]
    if degree == 2:
        columns += [a * b for a, b in combinations_with_replacement(points.T, 2)]
    return len(points) >= len(columns) and np.linalg.matrix_rank(np.array(columns), tol=1e-6) == len(columns)
