"""What is known at the start: the covariance that a bound begins with."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.models import FirstFixStart, StartOptions
from relnav_sim.dynamics.augmentation.extension import Extension


def start_covariance(start: StartOptions, fix: Array | None, extra: Extension | None) -> Array:
    """Return the covariance (n, n) of the error with which filters start at best.

    Args:
        start: Where they start.
        fix: Information (n, n) of the measurement that a first fix is made from; None: the start is no first fix.
        extra: The states behind the six.
    """
    behind = np.zeros(0) if extra is None else extra.sigma
    if isinstance(start, FirstFixStart):
        assert fix is not None  # or there is no start
        J = fix.copy()
        J[3:, 3:] += np.diag(1 / np.square([*start.velocity_sigma_m_s, *behind]))
        return np.asarray(np.linalg.inv(J))
    return np.diag(np.square([*start.position_sigma_m, *start.velocity_sigma_m_s, *behind]))
