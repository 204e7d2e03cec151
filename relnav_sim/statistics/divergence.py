"""Which runs has a filter lost? Three signs, any of which is enough.

- It failed: estimate or covariance not finite, or the covariance not positive definite.
- For more than 5 % of the last half of the run its error lies beyond the 0.9999 ellipsoid of its own covariance.
  Counted at full rate.
- Its position error exceeds ten times the root-mean-square bound (posterior Cramér-Rao) for 50 s on end. Seen at the
  stored epochs, and only where the result holds a bound.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.results import layout
from relnav_sim.results.afterwards import reads_from_s

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


LATE_SHARE = 0.05
TIMES_BOUND = 10.0
LONG_S = 50.0


def diverged_runs(results: Results, case: int | str, filter: str) -> Mask:
    """Return which runs of a result a filter has lost, by every sign that the result can show (runs,)."""
    failed = results.statistic(case, filter, "failed") == 1
    lost = diverged(failed, results.statistic(case, filter, "outside_late"))
    bound = results.perfect_bound(case, filter)
    if bound is None:
        return lost
    r, time_s = np.linalg.norm(results.error(case, filter)[..., :3], axis=-1), results.time_s(case)
    # While a filter waits for a start that is fitted to readings, the bound has those readings and the filter has not.
    waits = time_s < reads_from_s(results, results.case_index(case), filter)
    return lost | far_beyond_bound(r, time_s, np.where(waits, np.nan, bound[:, layout.QUANTITIES.index("r")]))


def diverged(failed: Mask, outside_late: Array) -> Mask:
    """Return which runs have failed or are outside their 0.9999 ellipsoid for long, (runs,).

    Args:
        failed: Runs that failed (runs,).
        outside_late: Share of the last half outside the ellipsoid (runs,); NaN: nothing was counted.
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(failed | (outside_late > LATE_SHARE))


def far_beyond_bound(r: Array, time_s: Array, bound_m: Array) -> Mask:
    """Return which runs stay beyond ten times the bound for 50 s on end, (runs,).

    Args:
        r: Position error at the stored epochs (runs, K), m; NaN once a run has failed.
        time_s: The stored epochs (K,), s.
        bound_m: Bound of its root mean square (K,), m; an epoch without one (NaN) ends a chunk.
    """
    lost = np.zeros(len(r), dtype=bool)
    since = np.full(len(r), np.inf)
    with np.errstate(invalid="ignore"):
        beyond = r > TIMES_BOUND * bound_m
    for k, now in enumerate(time_s):
        since = np.where(beyond[:, k], np.minimum(since, now), np.inf)
        lost |= now - since >= LONG_S
    return lost
