"""One run of one filter over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from relnav_sim.arrays import Array


@dataclass(frozen=True)
class Series:
    """One run of one filter at the stored epochs.

    Attributes:
        case: Label of the case.
        filter: Name of the filter.
        run: Number of the run.
        time_s: Stored epochs (K,), s.
        error: Estimate minus truth, RTN, (K, 6), m and m/s; NaN once the filter failed.
        sigma: Standard deviations that the filter states, (K, 6).
        nis: Normalised innovation squared (K,); NaN without a measurement.
        nees: Normalised estimation error squared (K,).
        truth: True relative state, RTN, (K, 6).
        covariance: Formal covariance of position and velocity, RTN, (K, 6, 6); None where the file holds none.
        nis_by: NIS of each sensor's measurements (K,), by its name; empty where the file does not tell them apart.
        dof_by: Its degrees of freedom (K,); 0 without a measurement.
    """

    case: str
    filter: str
    run: int
    time_s: Array
    error: Array
    sigma: Array
    nis: Array
    nees: Array
    truth: Array
    nis_by: Mapping[str, Array] = field(default_factory=dict)
    dof_by: Mapping[str, Array] = field(default_factory=dict)
    covariance: Array | None = None
