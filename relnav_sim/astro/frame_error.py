"""How errors of position and velocity turn the orbit frame that is computed from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array


def frame_errors(errors: ArrayLike, radius_m: ArrayLike, speed_m_s: ArrayLike) -> Array:
    """Return turn and rate error of the orbit frame for errors of the orbit, (..., 6) to first order.

    The frame computed from a position that is off by d (m) and a velocity off by w (m/s) is the true one turned by
    theta = (w_N / v, -d_N / r, d_T / r), rad: the position leads the radius, the velocity the plane. Its computed rate
    is off too: a relative state in it is r + r x theta, v + v x theta + r x phi with
    phi = delta omega + theta x omega = (-d_N n / r, -w_N / r, (w_T - n d_R) / r), rad/s, n = v / r. On a near-circular
    orbit; the tilt of the plane's own turning by the harmonics, a thousand times slower, is left out.

    Args:
        errors: d and w, RTN, (..., 6).
        radius_m: r, broadcast against the leading axes.
        speed_m_s: v, the same.

    Returns:
        theta and phi, RTN.
    """
    d_R, d_T, d_N, _, w_T, w_N = np.moveaxis(np.asarray(errors, dtype=float), -1, 0)
    r, v = np.asarray(radius_m, dtype=float), np.asarray(speed_m_s, dtype=float)
    n = v / r
    return np.stack([w_N / v, -d_N / r, d_T / r, -n * d_N / r, -w_N / r, (w_T - n * d_R) / r], axis=-1)


def frame_covariance(root: ArrayLike, radius_m: ArrayLike, speed_m_s: ArrayLike) -> Array:
    """Return the covariance (..., 6, 6) of theta (rad) and phi (rad/s), RTN, of a frame from an uncertain orbit.

    Args:
        root: L (..., 6, 6) with L L^T the covariance of the orbit's error, RTN, m and m/s.
        radius_m: Distance from the centre, broadcast against the leading axes.
        speed_m_s: Speed, the same.
    """
    columns = np.asarray(root, dtype=float).swapaxes(-1, -2)
    E = frame_errors(columns, np.asarray(radius_m)[..., None], np.asarray(speed_m_s)[..., None])
    return np.asarray(E.swapaxes(-1, -2) @ E)
