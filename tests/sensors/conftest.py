"""A small truth for sensor tests: two craft on circular orbits, in inertial coordinates."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.campaign.file_model import sensors_from
from relnav_sim.sensors import SensorOptions
from relnav_sim.streams import RandomSource

Array = NDArray[np.float64]

ORBIT = ChiefOrbit(7.137e6, 0.0, 0.7, 0.0, 0.0, 0.0, 3.986004418e14, 6378137.0, 1.08263e-3)
TURN = Rotation.from_euler("zxz", [20, 42, 130], degrees=True).as_matrix()
STEP_S = 0.2
RADAR = {"range_sigma_m": 4.0, "angle_sigma_deg": 0.0667}
GNSS = {"position_sigma_m": 30.0, "velocity_sigma_m_s": 0.15}
STAR_TRACKER = {"cross_boresight_sigma_arcsec": 10.0, "about_boresight_sigma_arcsec": 33.3}


@dataclass(frozen=True)
class Truth:
    """Epochs (K,) and ECI states (b, K, 6)."""

    times_s: Array
    chief: Array
    deputy: Array


def truth(relative: Any, epochs: int = 64, first: int = 0) -> Truth:
    """The deputy at fixed RTN positions (b, 3) of a chief on a circular orbit, moving along with its frame."""
    relative = np.atleast_2d(np.asarray(relative, dtype=float))
    times = (first + np.arange(epochs)) * STEP_S
    n, radius = ORBIT.mean_motion_rad_s, ORBIT.semi_major_axis_m
    c, s = np.cos(n * times), np.sin(n * times)
    zero = np.zeros_like(times)
    axes = np.stack([[c, s, zero], [-s, c, zero], [zero, zero, zero + 1]])
    axes = np.einsum("ij,ajk->aki", TURN, axes)
    chief = np.concatenate([radius * axes[0], n * radius * axes[1]], axis=-1)
    offset = np.einsum("ba,aki->bki", relative, axes)
    spin = n * np.stack([-relative[:, 1], relative[:, 0], 0 * relative[:, 0]], axis=-1)
    drift = np.einsum("ba,aki->bki", spin, axes)
    shape = (len(relative), epochs, 6)
    return Truth(
        times,
        np.broadcast_to(chief, shape).copy(),
        np.concatenate([chief[:, :3] + offset, chief[:, 3:] + drift], -1),
    )


def sensors(**sections: Any) -> dict[str, SensorOptions]:
    """Options as a campaign file would give them; the radar's defaults are filled in."""
    sections = {"radar": {}, **sections}
    if sections["radar"] is not None:
        sections["radar"] = {**RADAR, **sections["radar"]}
    return sensors_from(json.loads(json.dumps(sections)))


def source(runs: int | tuple[int, ...], seed: int = 11) -> RandomSource:
    """Random numbers for some runs."""
    return RandomSource(seed, tuple(range(runs)) if isinstance(runs, int) else runs)


@pytest.fixture
def scene() -> ModuleType:
    """This module: its functions and constants."""
    return sys.modules[__name__]
