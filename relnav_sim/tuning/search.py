"""A deterministic search of the unit cube in rounds: the first axis by itself, then all axes together.

Rounds, because all points of a round are tried on the same simulated measurements at once. A line of points along the
first axis comes first; each further round takes the minimum of a surrogate (cubic radial basis functions through the
points so far; Gutmann, J. Global Optimization 19, 2001) near the best point, and the points one reach away from the
best on every axis. The reach halves whenever no axis point gained.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
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
SMALLEST_REACH = 1e-3
"""The search ends here, whatever is left of the budget."""
_PLACES = 4
_CANDIDATES = 9  # log2 of the surrogate's trial points


def search(start: Point, budget: int) -> Search:
    """Yield rounds of points in [0, 1]^d, the start first; take their values, infinite where a point failed.

    Args:
        start: Where to begin; the first axis gets a line of points from end to end.
        budget: Most points in all.
    """
    known: dict[Point, float] = {}
    d = len(start)
    line = LINE_ALONE if d == 1 else LINE
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


def _close_in(known: dict[Point, float], reach: Array, axes: range, budget: int) -> Search:
    """Ask for points ever closer about the best, until so many are known."""
    while len(known) < budget and reach.max() >= SMALLEST_REACH:
        centre = min(known, key=known.__getitem__)
        yield from _ask(
            [*_surrogate_minimum(known, centre, reach, axes), *_axis_points(centre, reach, axes)], known, budget
        )
        best = min(known, key=known.__getitem__)
        # On one axis the neighbours of the best bracket it now; on more, a gain along one of them may go on.
        gained = best != centre and sum(a != b for a, b in zip(best, centre, strict=True)) == 1
        if len(axes) == 1 or not gained:
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
    """Return where the surrogate is least within twice the reach of the best; nothing where it says nothing new."""
    from scipy.interpolate import RBFInterpolator
    from scipy.stats import qmc

    d = len(axes)
    finite = {p: value for p, value in known.items() if np.isfinite(value) and p[d:] == centre[d:]}
    tried, middle = np.array([point[:d] for point in finite]), np.array(centre[:d])
    if len(finite) < d + 2 or np.linalg.matrix_rank((tried - middle) / reach[:d], tol=1e-6) < d:
        return []
    # High values far away only make the surface wave; cut at their median (Regis and Shoemaker 2007).
    values = np.array(list(finite.values()))
    surface = RBFInterpolator((tried - middle) / reach[:d], np.minimum(values, np.median(values)), kernel="cubic")
    trial = 4 * qmc.Sobol(d, scramble=False).random_base2(_CANDIDATES) - 2
    inside = np.clip(middle + trial * reach[:d], 0.0, 1.0)
    best = inside[np.argmin(surface((inside - middle) / reach[:d]))]
    if (np.abs(best - tried) / reach[:d]).max(axis=1).min() < 1 / 16:
        return []
    return [(*map(float, best), *centre[d:])]
