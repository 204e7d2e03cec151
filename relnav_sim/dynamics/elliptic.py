"""Linear relative motion about an elliptic orbit, in closed form."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.kepler import arc
from relnav_sim.dynamics.by_epoch import LinearByEpoch
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix, white_acceleration
from relnav_sim.dynamics.registry import register_dynamics

_PLACES = np.array([1, 2, 0, 4, 5, 3])
_SIGNS = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""Yamanaka and Ankersen's state (x along-track, y minus orbit normal, z nadir) is _SIGNS times RTN's at _PLACES."""
_IN_PLANE = np.array([0, 2, 3, 5])


@register_dynamics("yamanaka_ankersen")
class YamanakaAnkersenOptions(DynamicsOptions):
    """Yamanaka and Ankersen's transition matrix (J. Guidance 25(1), 2002): linear, elliptic chief, point mass.

    The nominal orbit gives the true anomaly; on a circular orbit it equals `cw`.
    """

    kind: Literal["yamanaka_ankersen"] = Field(
        default="yamanaka_ankersen", description="Linear dynamics about an elliptic orbit"
    )

    def build(self, context: DynamicsContext) -> LinearByEpoch:
        """Return the dynamics; epoch k is k steps after the nominal orbit's own epoch.

        Q is that of white acceleration about a circular orbit, right to leading order in the step's share of a turn.
        """
        orbit, step_s = context.orbit, context.step_s

        def transitions(epochs: Array) -> Array:
            return elliptic_transition(orbit, (epochs - 1) * step_s, step_s)

        Q = process_noise_matrix(context.process_noise, cw_system(orbit.mean_motion_rad_s), step_s)
        return LinearByEpoch(transitions, Q)


def yamanaka_ankersen(*, orbit: ChiefOrbit, step_s: float, acceleration_psd_m2_s3: float) -> LinearByEpoch:
    """Return Yamanaka and Ankersen's dynamics (J. Guidance 25(1), 2002): linear, elliptic chief for `create_filter`.

    The state is the deputy's position and velocity relative to the chief, (6,), m and m/s, in the chief's RTN frame
    (see `cw`). Epoch k is k steps
    after the nominal orbit's own epoch, at which it has its true anomaly.

    Args:
        orbit: The chief's nominal orbit.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3,
            discretised about a circular orbit.

    Raises:
        ValueError: The density is negative.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> orbit = dynamics.ChiefOrbit(7.0e6, 0.02, 0.9, 0.0, 0.0, 0.0)
        >>> motion = dynamics.yamanaka_ankersen(orbit=orbit, step_s=10.0, acceleration_psd_m2_s3=1e-8)
        >>> motion.propagate(np.array([[0.0, -1000.0, 0.0, 0.0, 0.0, 0.0]]), Step(0)).shape
        (1, 6)
    """
    return YamanakaAnkersenOptions().build(DynamicsContext(orbit, white_acceleration(acceleration_psd_m2_s3), step_s))


def elliptic_transition(orbit: ChiefOrbit, times_s: Array, duration_s: float) -> Array:
    """Return the transition matrices (K, 6, 6), RTN, over `duration_s` from each of the times (K,).

    Times are in s since the orbit's own epoch. Yamanaka and Ankersen 2002: with the true anomaly as the variable and
    positions scaled by rho = 1 + e cos theta the equations have a solution without singularities, in the elapsed time
    instead of Lawden's integral.
    """
    e = orbit.eccentricity
    parameter = orbit.semi_major_axis_m * (1 - e * e)
    k2 = np.sqrt(orbit.mu_m3_s2 / parameter**3)
    along = arc(orbit, times_s, np.array([duration_s]))
    sweep = along.sweep_rad[:, 0]
    start, end = along.true_anomaly_rad, along.true_anomaly_rad + sweep

    first = _scaled(start, e, k2)
    last = np.linalg.inv(_scaled(end, e, k2))
    F = np.zeros((len(sweep), 6, 6))
    F[:, 1, 1] = F[:, 4, 4] = np.cos(sweep)
    F[:, 1, 4] = np.sin(sweep)
    F[:, 4, 1] = -F[:, 1, 4]
    F[:, _IN_PLANE[:, None], _IN_PLANE] = _solution(end, e, k2 * duration_s) @ _constants(start, e)
    F = last @ F @ first
    rtn = np.empty_like(F)
    rtn[:, _PLACES[:, None], _PLACES] = _SIGNS[:, None] * F * _SIGNS
    return rtn


def _scaled(theta: Array, e: float, k2: float) -> Array:
    """Return the matrices (K, 6, 6) to rho r and its derivative by theta, -e sin theta r + v / (k^2 rho)."""
    rho = 1 + e * np.cos(theta)
    T = np.zeros((len(theta), 6, 6))
    for i in range(3):
        T[:, i, i] = rho
        T[:, 3 + i, i] = -e * np.sin(theta)
        T[:, 3 + i, 3 + i] = 1 / (k2 * rho)
    return T


def _solution(theta: Array, e: float, J: float) -> Array:
    """Return the fundamental solutions of x, z and their derivatives, (K, 4, 4); J = k^2 (t - t0)."""
    rho = 1 + e * np.cos(theta)
    s, c = rho * np.sin(theta), rho * np.cos(theta)
    ds, dc = np.cos(theta) + e * np.cos(2 * theta), -(np.sin(theta) + e * np.sin(2 * theta))
    one, zero = np.ones_like(rho), np.zeros_like(rho)
    rows = [
        [one, -c * (1 + 1 / rho), s * (1 + 1 / rho), 3 * rho**2 * J],
        [zero, s, c, 2 - 3 * e * s * J],
        [zero, 2 * s, 2 * c - e, 3 * (1 - 2 * e * s * J)],
        [zero, ds, dc, -3 * e * (ds * J + s / rho**2)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _constants(theta: Array, e: float) -> Array:
    """Return the inverse of `_solution` at J = 0, (K, 4, 4)."""
    rho = 1 + e * np.cos(theta)
    s, c = rho * np.sin(theta), rho * np.cos(theta)
    one, zero = np.ones_like(rho), np.zeros_like(rho)
    rows = [
        [(1 - e * e) * one, 3 * e * s / rho * (1 + 1 / rho), -e * s * (1 + 1 / rho), 2 - e * c],
        [zero, -3 * s / rho * (1 + e * e / rho), s * (1 + 1 / rho), c - 2 * e],
        [zero, -3 * (c / rho + e), c * (1 + 1 / rho) + e, -s],
        [zero, 3 * rho + e * e - 1, -(rho**2), e * s],
    ]
    return np.moveaxis(np.array(rows), -1, 0) / (1 - e * e)
