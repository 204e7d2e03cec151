"""Drag in air of exponential layers, over lanes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, number, record, written
from relnav_sim.kernels.elementary import exp
from relnav_sim.kernels.lanes import LANES, load_vectors, store_vectors


class Layers(NamedTuple):
    """Air whose density falls exponentially within each layer.

    Attributes:
        bases: Altitudes (k,) at which layers begin, increasing, m. The first goes on below, the last above.
        densities: Density at the bases (k,), kg/m^3; (0,) where there is no air.
        scale_heights: Altitude over which it falls by the factor e, (k,), m.
    """

    bases: Array
    densities: Array
    scale_heights: Array


LAYERS = record(Layers, written(1), written(1), written(1))


@inner
def add_layered_drag(
    y: Array, layers: Layers, radius: float, rotation: float, ballistic: Array, used: int, a: Array
) -> None:
    """Add -1/2 Cd A/m rho |u| u, u being the velocity past air that turns with the body (Vallado, section 8.6).

    Args:
        y: Position and velocity (6,), m and m/s.
        layers: The air, by the altitude |r| - radius.
        radius: Of the body, m.
        rotation: Of the body and its air about z, rad/s.
        ballistic: Cd A / m of each lane, m^2/kg.
        used: How many lanes count.
        a: Accelerations (3,), m/s^2.
    """
    for b in range(used):
        x, y_, vx, vy, vz = y[0, b], y[1, b], y[3, b], y[4, b], y[5, b]
        altitude = math.sqrt(x * x + y_ * y_ + y[2, b] * y[2, b]) - radius
        layer = 0
        for k in range(1, len(layers.bases)):
            layer += 1 if altitude >= layers.bases[k] else 0
        density = layers.densities[layer] * exp((layers.bases[layer] - altitude) / layers.scale_heights[layer])
        ux, uy = vx + rotation * y_, vy - rotation * x
        factor = -0.5 * ballistic[b] * density * math.sqrt(ux * ux + uy * uy + vz * vz)
        a[0, b] += factor * ux
        a[1, b] += factor * uy
        a[2, b] += factor * vz


@kernel(LAYERS, number, number, given(2), given(1))
def drag(layers: Layers, radius: float, rotation: float, states: Array, ballistic: Array) -> Array:
    """Return the acceleration (n, 3) by drag, m/s^2, from states (n, 6) and Cd A / m (n,); the rest as above."""
    n = len(states)
    out, y, a, of_lanes = np.empty((n, 3)), np.empty((6, LANES)), np.empty((3, LANES)), np.empty(LANES)
    for first in range(0, n, LANES):
        used = min(LANES, n - first)
        load_vectors(states, first, used, y)
        for b in range(used):
            of_lanes[b] = ballistic[first + b]
            for i in range(3):
                a[i, b] = 0.0
        add_layered_drag(y, layers, radius, rotation, of_lanes, used, a)
        store_vectors(a, first, used, out)
    return out
