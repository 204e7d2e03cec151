"""Free fall over a short time, to second order."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.constants import MU_M3_S2
from relnav_sim.astro.line_of_sight import components, dot


def coasted(states: Array, late_s: Array | float) -> Array:
    """Return states (..., 6), ECI, m and m/s, a little later, (..., 1) or one, s; a negative time is earlier.

    What is left out is the third order: 1.5 mm after one second in low orbit.
    """
    position, velocity = states[..., :3], states[..., 3:]
    late = np.asarray(late_s)[..., None]
    squared = dot(components(states), components(states))
    fall = (-MU_M3_S2 / (squared * np.sqrt(squared)))[..., None] * position
    return np.concatenate([position + late * (velocity + late / 2 * fall), velocity + late * fall], axis=-1)
