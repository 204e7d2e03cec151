"""Angles in differences of readings."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.kernels.compiling import given, integer, kernel, written

_TWO_PI = 2 * math.pi


@kernel(written(2), given(1, integer))
def wrap(difference: Array, angles: Indices) -> None:
    """Bring angles into [-pi, pi], in place; one that is there already keeps its bits.

    Args:
        difference: (points, m).
        angles: Which of the m components are angles, rad.
    """
    for point in range(len(difference)):
        for i in angles:
            angle = difference[point, i]
            difference[point, i] = angle - _TWO_PI * np.rint(angle / _TWO_PI)
