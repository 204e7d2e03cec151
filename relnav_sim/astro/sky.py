"""The sky of a span of time, as kernels take it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Integers
from relnav_sim.astro.earth_orientation import EarthOrientation
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.sky_table import sky_table
from relnav_sim.kernels.sky import DAY_S, POWERS, ROWS

if TYPE_CHECKING:
    from relnav_sim.kernels.sky import Sky


def sky_between(epoch: Epoch, first_s: float, last_s: float, orientation: EarthOrientation | None = None) -> Sky:
    """Return the sky from a time to another and at least a day beyond both, for steps that go too far.

    Its bits at a time do not depend on the span. A day takes 1 ms when it is asked for first.

    Args:
        epoch: When times count from.
        first_s: The first time, SI seconds from the epoch.
        last_s: The last time.
        orientation: UT1 - UTC and polar motion; zero if not given.
    """
    orientation = orientation or EarthOrientation()
    days = _days(first_s, last_s)
    angle = orientation.rotation_angle(epoch)
    return kernels.sky.Sky(float(days[0]), sky_table(epoch, days), angle, np.ascontiguousarray(orientation.pole()))


def about_eci_z(sky: Sky) -> Sky:
    """Return the same sky over an Earth whose axis is ECI z, as that of zonal bodies is."""
    days = sky.days.copy()
    days[:, : kernels.sky.SUN] = 0.0
    return sky._replace(days=days, pole=np.eye(3))


def still_sky(first_s: float, last_s: float) -> Sky:
    """Return a sky without Sun and Moon over an Earth that turns evenly about ECI z, for spans as in `sky_between`.

    The Earth's rotation angle is 0 at time 0.
    """
    days = _days(first_s, last_s)
    return kernels.sky.Sky(float(days[0]), np.zeros((len(days), ROWS, POWERS)), 0.0, np.eye(3))


def _days(first_s: float, last_s: float) -> Integers:
    return np.arange(np.floor(first_s / DAY_S) - 1, np.floor(last_s / DAY_S) + 2, dtype=np.int64)
