"""What claims of Shi et al. (2025) are about that print no number: outliers, a slow wave and the formal covariance."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from relnav_sim.arrays import Array
from replication.derived import outlier_share, wave_bases
from replication.inverse.alpha_kf_flight import ALPHAS, QUICK, Flown
from replication.inverse.alpha_kf_numbers import FILTERS

STEADY_S, FORMAL_S = 500.0, 100.0
"""From when outliers and waves are looked for, and when the formal covariance is compared with that at the start."""
OUTCOMES = (
    *(f"share of outliers of {quantity}, alpha={alpha:g}" for quantity in "rv" for alpha in ALPHAS),
    *(f"period of the wave, {name}" for name in FILTERS),
    *(f"formal sigma after 100 s over the first, {name}" for name in FILTERS),
)
RADIAL_VELOCITY = 3


def outcomes(flown: Mapping[int, Flown]) -> Array:
    """Return `OUTCOMES` of each run, (runs, outcomes), with the definitions of replication/derived.py.

    Epochs of the steady state count alike, though a few per cent of them are 3 s apart and the others 5 s.
    """
    steady = _ends() > STEADY_S
    late = flown[4].errors[:, :, steady]
    sizes = (np.linalg.norm(late[..., part], axis=-1) for part in (slice(0, 3), slice(3, 6)))
    outliers = [outlier_share(each) for size in sizes for each in size]
    periods, bases = _waves()
    waves = [_period(each, periods, bases) for each in flown[2].errors[:, :, steady, RADIAL_VELOCITY]]
    at = int(np.searchsorted(_ends(), FORMAL_S - 1e-6))
    ratio = flown[2].formal_m[:, at] / flown[2].formal_m[:, 0]
    runs = late.shape[1]
    return np.stack([*outliers, *waves, *np.repeat(ratio[:, None], runs, axis=1)], axis=1)


def _period(values: Array, periods: Array, bases: Array) -> Array:
    """Return the period of the wave that explains most of each series (runs, K)."""
    explained = ((values @ bases).reshape(len(values), len(periods), -1) ** 2).sum(axis=2)
    return np.asarray(periods[np.argmax(explained, axis=1)])


def _ends() -> Array:
    return np.cumsum(QUICK.steps_s)


@cache
def _waves() -> tuple[Array, Array]:
    """Return the periods that are tried, and what they span side by side, (K, 4 periods)."""
    ends = _ends()
    periods, bases = zip(*wave_bases(ends[ends > STEADY_S]), strict=True)
    return np.array(periods), np.concatenate(bases, axis=1)
