"""Differences of measurements, with their angles."""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.kernels.compiling import given, integer, kernel

_TWO_PI = 2 * math.pi


@kernel(given(3), given(3), given(1, integer))
def difference(z: Array, predicted: Array, angles: Indices) -> Array:
    """Return z - predicted, (runs, points, m), with the angles in [-pi, pi]; one that is there anyway keeps its bits.

    Args:
        z: Measurements (runs, points or 1, m).
        predicted: Those that were expected, (runs, points or 1, m).
        angles: Which of the m components are angles, rad.
    """
    runs, points, m = len(z), max(z.shape[1], predicted.shape[1]), z.shape[2]
    found = np.empty((runs, points, m))
    for run in range(runs):
        for point in range(points):
            of, to = min(point, z.shape[1] - 1), min(point, predicted.shape[1] - 1)
            for i in range(m):
                found[run, point, i] = z[run, of, i] - predicted[run, to, i]
    for run in range(runs):
        for point in range(points):
            for i in angles:
                angle = found[run, point, i]
                found[run, point, i] = angle - _TWO_PI * np.rint(angle / _TWO_PI)
    return found
