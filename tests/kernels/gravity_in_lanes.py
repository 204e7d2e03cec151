"""What kernels make of gravity, for arrays with the components second, (s, 3, ...)."""

import numpy as np

from relnav_sim.kernels import relative_gravity
from relnav_sim.kernels.lanes import LANES


def columns(vectors):
    """Yield vectors (s, 3, ...) in groups of up to LANES side by side, and the slice that each group is."""
    flat = np.moveaxis(np.asarray(vectors, dtype=float), 1, 0).reshape(3, -1)
    for first in range(0, flat.shape[1], LANES):
        lanes = np.zeros((3, LANES))
        used = min(LANES, flat.shape[1] - first)
        lanes[:, :used] = flat[:, first : first + used]
        yield slice(first, first + used), used, lanes


def gathered(shape, results):
    """Return results (..., n) of n vectors (s, 3, ...) in the order (..., s, ...)."""
    s, _, *rest = shape
    return results.reshape(*results.shape[:-1], s, *rest)


def harmonics(gravity, position):
    position = np.asarray(position)
    found = np.empty((3, position.size // 3))
    for place, used, r in columns(position):
        a = np.empty((3, LANES))
        relative_gravity.harmonics(gravity.field, r, used, a)
        found[:, place] = a[:, :used]
    return np.moveaxis(gathered(position.shape, found), 0, 1)


def acceleration(gravity, position):
    position = np.asarray(position)
    found = np.empty((3, position.size // 3))
    for place, used, r in columns(position):
        a = np.empty((3, LANES))
        relative_gravity.acceleration(gravity.field, r, used, a)
        found[:, place] = a[:, :used]
    return np.moveaxis(gathered(position.shape, found), 0, 1)


def difference(gravity, chief, offset):
    chief, offset = np.broadcast_arrays(chief, offset)
    found = np.empty((3, offset.size // 3))
    for (place, used, c), (_, _, x) in zip(columns(chief), columns(offset), strict=True):
        bulge, room, a = np.empty((3, LANES)), np.empty((3, LANES)), np.empty((3, LANES))
        relative_gravity.harmonics(gravity.field, c, used, bulge)
        relative_gravity.difference(gravity.field, c, bulge, x, used, room, a)
        found[:, place] = a[:, :used]
    return np.moveaxis(gathered(offset.shape, found), 0, 1)


def gradient(gravity, position):
    """Return (3, 3, s, ...)."""
    position = np.asarray(position)
    found = np.empty((3, 3, position.size // 3))
    for place, used, r in columns(position):
        G = np.empty((3, 3, LANES))
        relative_gravity.gradient(gravity.field, r, used, G)
        found[..., place] = G[..., :used]
    return gathered(position.shape, found)
