"""In which runs has a filter diverged? Three signs, any of which is enough.

A filter has diverged where its actual error no longer agrees with its formal covariance (Schlee, Standish and Toda
1967; Jazwinski 1970, section 8.8; "apparent divergence" in Fitzgerald 1971). An error that is large and told of, as
after an outage, is no divergence: the position RMS and the ratio to the bound have it.

- It failed: estimate or covariance not finite, or the covariance not positive definite.
- For more than 5 % of the last half of the run its error lies beyond the 0.9999 ellipsoid of its own covariance.
  Counted at full rate.
- For 50 s on end its error lies beyond that ellipsoid and its position error exceeds ten times the root-mean-square
  bound of a perfect model (posterior Cramér-Rao): a divergence from which it recovered. Seen at the stored epochs, and
  only where the result holds a bound.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.results import layout
from relnav_sim.results.afterwards import reads_from_s
from relnav_sim.statistics.consistency import chi_square_quantile

if TYPE_CHECKING:
    from relnav_sim.results.read import Results


LATE_SHARE = 0.05
TIMES_BOUND = 10.0
LONG_S = 50.0
ELLIPSOID = 0.9999
"""Probability of the ellipsoid of the filter's own covariance that an error is held against."""


def diverged_runs(results: Results, case: int | str, filter: str) -> Mask:
    """Return in which runs of a result a filter has diverged, by every sign that the result can show (runs,)."""
    failed = results.statistic(case, filter, "failed") == 1
    found = diverged(failed, results.statistic(case, filter, "outside_late"))
    bound = results.perfect_bound(case, filter)
    if bound is None:
        return found
    r, time_s = np.linalg.norm(results.error(case, filter)[..., :3], axis=-1), results.time_s(case)
    # While a filter waits for a start that is fitted to measurements, the bound has those measurements and the filter
    # has not.
    waits = time_s < reads_from_s(results, results.case_index(case), filter)
    limit = np.where(waits, np.nan, bound[:, layout.QUANTITIES.index("r")])
    return found | far_beyond_bound(r, results.nees(case, filter), time_s, limit)


def diverged(failed: Mask, outside_late: Array) -> Mask:
    """Return which runs have failed or are outside their 0.9999 ellipsoid for long, (runs,).

    Args:
        failed: Runs that failed (runs,).
        outside_late: Share of the last half outside the ellipsoid (runs,); NaN: nothing was counted.
    """
    with np.errstate(invalid="ignore"):
        return np.asarray(failed | (outside_late > LATE_SHARE))


def far_beyond_bound(r: Array, nees: Array, time_s: Array, bound_m: Array) -> Mask:
    """Return which runs stay beyond ten times the bound and beyond their 0.9999 ellipsoid for 50 s on end, (runs,).

    Args:
        r: Position error at the stored epochs (runs, K), m; NaN once a run has failed.
        nees: e^T P^-1 e of position and velocity there (runs, K).
        time_s: The stored epochs (K,), s.
        bound_m: Bound of the position error's root mean square (K,), m; an epoch without one (NaN) ends the 50 s.
    """
    found = np.zeros(len(r), dtype=bool)
    since = np.full(len(r), np.inf)
    with np.errstate(invalid="ignore"):
        beyond = (r > TIMES_BOUND * bound_m) & (nees > chi_square_quantile(ELLIPSOID, layout.BLOCK_SIZES[0]))
    for k, now in enumerate(time_s):
        since = np.where(beyond[:, k], np.minimum(since, now), np.inf)
        found |= now - since >= LONG_S
    return found
