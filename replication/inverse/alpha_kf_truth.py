"""Two spacecraft 12 km apart for a revolution of any orbit, and what Clohessy-Wiltshire leaves out of their motion.

The craft fly with J2 to J4, without drag. They differ by an offset along the track that may drift, an ellipse in the
plane and an oscillation across it (D'Amico, PhD thesis, TU Delft, 2010, section 2.2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relnav_sim import ForceModel, propagate, rtn_from_eci
from relnav_sim.arrays import Array
from relnav_sim.astro.constants import MU_M3_S2, RADIUS_M
from relnav_sim.astro.orbits import Elements, state_from_elements
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition

DISTANCE_M = 12_000.0
DURATION_S, NODE_S = 6000.0, 60.0
NODES_S = np.arange(0.0, DURATION_S + NODE_S / 2, NODE_S)
FORCE = ForceModel(MU_M3_S2, RADIUS_M)


@dataclass(frozen=True)
class Motion:
    """Relative motion in many settings.

    Attributes:
        mean_motion_rad_s: The chief's, (n,).
        nodes: States of the deputy relative to the chief at `NODES_S`, (n, nodes, 6), RTN, m and m/s.
        left_out: Acceleration that Clohessy-Wiltshire leaves out, (n, nodes - 1, 2, 3), m/s^2: in the middle of each
            interval, and how much it grows over it. With it the equations meet every node.
    """

    mean_motion_rad_s: Array
    nodes: Array
    left_out: Array


def motion(setting: Mapping[str, Array]) -> Motion:
    """Return the relative motion of settings, each value (n,)."""
    mean_motion = 2 * np.pi / setting["period_s"]
    chief, deputy = _start(setting, (MU_M3_S2 / mean_motion**2) ** (1 / 3))
    count = len(chief)
    flown = propagate(np.concatenate([chief, deputy]), NODES_S, FORCE, rtol=1e-11)
    nodes = rtn_from_eci(flown[:count], flown[count:], FORCE.normal_acceleration(flown[:count]))
    left_out = np.stack([_left_out(n, states) for n, states in zip(mean_motion, nodes, strict=True)])
    return Motion(mean_motion, nodes, left_out)


def _start(setting: Mapping[str, Array], a: Array) -> tuple[Array, Array]:
    """Return the states of both craft at the start, each (n, 6), ECI."""
    e, i = setting["eccentricity"], np.radians(setting["inclination_deg"])
    nu = np.radians(setting["true_anomaly_deg"])
    argp = np.radians(setting["latitude_argument_deg"]) - nu
    zero = np.zeros_like(e)
    chief = state_from_elements(Elements(a, e, i, zero, argp, nu), MU_M3_S2)
    in_plane, cross = setting["in_plane_share"], setting["cross_share"]
    along = (2 * setting["ahead"] - 1) * (1 - in_plane) * (1 - cross)
    sizes = np.stack([along, in_plane, cross])
    scale = DISTANCE_M / np.linalg.norm(sizes, axis=0) / a
    for _ in range(4):  # the distance is proportional to the differences, nearly
        deputy = _deputy(setting, a, argp, nu, scale * sizes)
        scale *= DISTANCE_M / np.linalg.norm(deputy[:, :3] - chief[:, :3], axis=1)
    return chief, deputy


def _deputy(setting: Mapping[str, Array], a: Array, argp: Array, nu: Array, sizes: Array) -> Array:
    """Return the deputy's state from the sizes of its three motions over a, (3, n)."""
    e, i = setting["eccentricity"], np.radians(setting["inclination_deg"])
    phase, cross_phase = np.radians(setting["in_plane_phase_deg"]), np.radians(setting["cross_phase_deg"])
    node = sizes[2] * np.sin(cross_phase) / np.maximum(np.sin(i), 0.05)
    E = 2 * np.arctan(np.sqrt((1 - e) / (1 + e)) * np.tan(nu / 2))
    latitude = argp + E - e * np.sin(E) + sizes[0] - np.cos(i) * node
    ex, ey = e * np.cos(argp) + sizes[1] * np.cos(phase), e * np.sin(argp) + sizes[1] * np.sin(phase)
    e2, argp2 = np.hypot(ex, ey), np.arctan2(ey, ex)
    M = latitude - argp2
    E2 = M.copy()
    for _ in range(12):  # Newton's method; e < 0.04
        E2 -= (E2 - e2 * np.sin(E2) - M) / (1 - e2 * np.cos(E2))
    nu2 = 2 * np.arctan2(np.sqrt(1 + e2) * np.sin(E2 / 2), np.sqrt(1 - e2) * np.cos(E2 / 2))
    a2 = a - setting["drift_m"] / (3 * np.pi)  # a lower orbit gains 3 pi of the difference in a revolution
    return state_from_elements(Elements(a2, e2, i + sizes[2] * np.cos(cross_phase), node, argp2, nu2), MU_M3_S2)


_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def _left_out(n: float, states: Array) -> Array:
    """Return the acceleration of `Motion.left_out` from the states at the nodes, (nodes, 6)."""
    missed = states[1:] - states[:-1] @ cw_transition(n, NODE_S).T
    effect = np.zeros((6, 2, 3))
    for point, weight in zip(_POINTS, _WEIGHTS, strict=True):
        impulse = cw_transition(n, NODE_S * (1 - point) / 2)[:, 3:] * NODE_S * weight / 2
        effect[:, 0] += impulse
        effect[:, 1] += impulse * point / 2
    return np.asarray(np.linalg.solve(effect.reshape(6, 6), missed.T).T.reshape(-1, 2, 3), dtype=float)


def steps_left_out(left_out: Array, ends_s: Array, spans_s: Array) -> Array:
    """Return what Clohessy-Wiltshire misses in steps that end at these times, (K, 6), of one setting's `left_out`.

    Over a step of h the acceleration a counts as constant: h^2 a / 2 and h a; the rest is of the order n h^3 a.
    """
    middle = ends_s - spans_s / 2
    interval = np.minimum((middle / NODE_S).astype(int), len(left_out) - 1)
    place = middle / NODE_S - interval - 0.5
    acceleration = left_out[interval, 0] + place[:, None] * left_out[interval, 1]
    h = spans_s[:, None]
    return np.concatenate([h**2 / 2 * acceleration, h * acceleration], axis=1)


def positions(nodes: Array, times_s: Array) -> Array:
    """Return positions (T, 3) between the nodes of one setting (nodes, 6), by cubic Hermite interpolation."""
    interval = np.minimum((times_s / NODE_S).astype(int), len(nodes) - 2)
    s = (times_s / NODE_S - interval)[:, None]
    before, after = nodes[interval], nodes[interval + 1]
    ends = (1 + 2 * s) * (1 - s) ** 2 * before[:, :3] + s**2 * (3 - 2 * s) * after[:, :3]
    return ends + NODE_S * (s * (1 - s) ** 2 * before[:, 3:] - s**2 * (1 - s) * after[:, 3:])
