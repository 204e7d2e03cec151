"""Attitudes and orbit frames along the epochs: small turns of a body, and the way from a body to its orbit frame.

A quaternion (x, y, z, w) turns ECI into body components, as in `relnav_sim.astro.attitude`. What all runs share has a
leading axis of 1.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inlined, kernel


@kernel(given(3), given(3))
def turned(quaternions: Array, angles: Array) -> Array:
    """Return the attitudes (runs, K, 4) after the body turns by rotation vectors in body axes, C(e) C(q).

    e = (sin(t/2)/t angles, cos(t/2)) with the angle t (Markley and Crassidis 2014, section 2.9).

    Args:
        quaternions: (runs or 1, K, 4).
        angles: (runs, K, 3), rad.
    """
    runs, K, _ = angles.shape
    shared = len(quaternions) == 1
    out = np.empty((runs, K, 4))
    for run in range(runs):
        own = 0 if shared else run
        for k in range(K):
            x, y, z = quaternions[own, k, 0], quaternions[own, k, 1], quaternions[own, k, 2]
            w = quaternions[own, k, 3]
            a, b, c = angles[run, k, 0], angles[run, k, 1], angles[run, k, 2]
            squared = (a * a + b * b + c * c) / 4
            if squared < _SMALL:
                half, d = _series(squared)
            else:
                t = math.sqrt(squared)
                half, d = math.sin(t) / t / 2, math.cos(t)
            a, b, c = a * half, b * half, c * half
            out[run, k, 0] = d * x + w * a - (b * z - c * y)
            out[run, k, 1] = d * y + w * b - (c * x - a * z)
            out[run, k, 2] = d * z + w * c - (a * y - b * x)
            out[run, k, 3] = d * w - (a * x + b * y + c * z)
    return out


_SMALL = 1e-2
"""Squared angle, rad^2, up to which the series give every digit."""


@inlined
def _series(s: float) -> tuple[float, float]:
    """Return sin(t) / (2 t) and cos(t) for s = t^2."""
    sine = 1 + s * (-1 / 6 + s * (1 / 120 + s * (-1 / 5040 + s * (1 / 362880 - s / 39916800))))
    cosine = 1 + s * (-1 / 2 + s * (1 / 24 + s * (-1 / 720 + s * (1 / 40320 - s / 3628800))))
    return sine / 2, cosine


@kernel(given(3), given(3), given(2), given(2), given(2))
def orbit_from_body(states: Array, quaternions: Array, x: Array, y: Array, z: Array) -> Array:
    """Return body vectors in the nadir frames of orbits, (3, runs, K): A C(q)^T v, the rows of A along the axes.

    The axes are along-track, minus the orbit normal, and nadir.

    Args:
        states: Position and velocity, ECI, (runs or 1, K, 6).
        quaternions: Attitudes (runs or 1, K, 4).
        x: Component of the vectors (runs, K).
        y: The second.
        z: The third.
    """
    runs, K = x.shape
    one_orbit, one_attitude = len(states) == 1, len(quaternions) == 1
    out = np.empty((3, runs, K))
    for run in range(runs):
        orbit, attitude = 0 if one_orbit else run, 0 if one_attitude else run
        for k in range(K):
            r0, r1, r2 = states[orbit, k, 0], states[orbit, k, 1], states[orbit, k, 2]
            v0, v1, v2 = states[orbit, k, 3], states[orbit, k, 4], states[orbit, k, 5]
            n0, n1, n2 = r1 * v2 - r2 * v1, r2 * v0 - r0 * v2, r0 * v1 - r1 * v0
            inward, down = -1 / math.sqrt(_dot(r0, r1, r2, r0, r1, r2)), -1 / math.sqrt(_dot(n0, n1, n2, n0, n1, n2))
            r0, r1, r2 = r0 * inward, r1 * inward, r2 * inward
            n0, n1, n2 = n0 * down, n1 * down, n2 * down
            e0, e1, e2 = quaternions[attitude, k, 0], quaternions[attitude, k, 1], quaternions[attitude, k, 2]
            w = quaternions[attitude, k, 3]
            b0, b1, b2 = x[run, k], y[run, k], z[run, k]
            # C^T v = v + w t + e x t with t = 2 e x v.
            t0, t1, t2 = 2 * (e1 * b2 - e2 * b1), 2 * (e2 * b0 - e0 * b2), 2 * (e0 * b1 - e1 * b0)
            i0 = b0 + w * t0 + (e1 * t2 - e2 * t1)
            i1 = b1 + w * t1 + (e2 * t0 - e0 * t2)
            i2 = b2 + w * t2 + (e0 * t1 - e1 * t0)
            out[0, run, k] = _dot(n1 * r2 - n2 * r1, n2 * r0 - n0 * r2, n0 * r1 - n1 * r0, i0, i1, i2)
            out[1, run, k] = _dot(n0, n1, n2, i0, i1, i2)
            out[2, run, k] = _dot(r0, r1, r2, i0, i1, i2)
    return out


@inlined
def _dot(a0: float, a1: float, a2: float, b0: float, b1: float, b2: float) -> float:
    return a0 * b0 + a1 * b1 + a2 * b2
