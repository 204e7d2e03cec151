"""Extra states of a campaign's filters: what they are and where they start."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.filters.belief import Gaussian
from relnav_sim.linalg import transpose
from relnav_sim.models.extra_states import Extension, extension
from relnav_sim.runner.start import radar_model

Array = NDArray[np.float64]


def mounting_of(config: CaseConfig) -> Array:
    """Return the rotation (3, 3) from the nadir frame of the radar's carrier to the radar frame."""
    assert config.sensors.radar is not None, "the campaign's checks ask for a radar"
    return config.sensors.radar.mounting


def extension_of(entry: FilterEntry, config: CaseConfig) -> Extension | None:
    """Return the extra states of a filter, None where it has none."""
    if not entry.augment:
        return None
    return extension(entry.augment, mounting_of(config), config.clock.step_s)


def extended_prior(prior: Gaussian, extra: Extension, config: CaseConfig) -> Gaussian:
    """Return the prior of [x; b] from that of x, mean (runs, 6 + e) and covariance (runs, 6 + e, 6 + e).

    b starts at 0 with its sigmas. A position that is the first fix holds the radar's errors: z = h(r) + H_b b makes it
    wrong by J H_b b, J = (dh/dr)^-1, which is the opposite of the error in b = 0 that it goes with.
    """
    runs, n = prior.mean.shape
    P_b = np.diag(np.square(extra.sigma))
    mean = np.concatenate([prior.mean, np.zeros((runs, len(extra.names)))], axis=1)
    covariance = np.zeros((runs, n + len(P_b), n + len(P_b)))
    covariance[:, :n, :n] = prior.covariance
    covariance[:, n:, n:] = P_b
    radar = radar_model(config)
    if isinstance(config.start, FirstFixStart) and radar is not None:
        H = extra.measurement(radar, mounting_of(config)).jacobian(mean, 0)
        # Stacked solve: a run without a fix is NaN and stays so.
        moved = np.asarray(np.linalg.solve(H[:, :, :3], H[:, :, n:]), dtype=np.float64)
        covariance[:, :3, :3] += moved @ P_b @ transpose(moved)
        covariance[:, :3, n:] = -moved @ P_b
        covariance[:, n:, :3] = transpose(covariance[:, :3, n:])
    return Gaussian(mean, covariance)
