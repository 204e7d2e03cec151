"""Clohessy-Wiltshire relative motion about a circular orbit, in the chief's RTN frame."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import LinearDynamics
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions, process_noise_matrix, white_acceleration
from relnav_sim.dynamics.registry import register_dynamics

Discretisation = Literal["exact", "euler"]


@register_dynamics("cw")
class CwOptions(DynamicsOptions):
    """Clohessy-Wiltshire dynamics (J. Aerospace Sciences 27(9), 1960): linear, circular chief, point mass.

    At 12 km separation it neglects 3.6e-5 m/s^2 of curvature and about as much of differential J2.
    """

    kind: Literal["cw"] = Field(default="cw", description="Clohessy-Wiltshire dynamics")
    discretisation: Discretisation = Field(
        default="exact",
        description="exact: the closed-form transition matrix; euler: I + A dt, as Shi et al. (2025) write it, "
        "good to a dt^2 / 2 only",
    )
    mean_motion_rad_s: float | None = Field(
        default=None, gt=0, description="Mean motion n, rad/s; default: that of the chief's nominal orbit"
    )

    def build(self, context: DynamicsContext) -> LinearDynamics:
        """Return the dynamics about the nominal chief orbit."""
        n = self.mean_motion_rad_s or context.orbit.mean_motion_rad_s
        return _dynamics(n, context.process_noise, context.step_s, self.discretisation)


def cw(
    *,
    mean_motion_rad_s: float,
    step_s: float,
    acceleration_psd_m2_s3: float,
    discretisation: Discretisation = "exact",
) -> LinearDynamics:
    """Return Clohessy-Wiltshire dynamics (J. Aerospace Sciences 27(9), 1960) for `create_filter`.

    The state is the deputy's position and velocity relative to a chief in a circular orbit, (6,), m and m/s, in the
    chief's RTN frame: x radial out, y along-track, z orbit normal; velocity is the derivative of these components.

    Args:
        mean_motion_rad_s: The chief's mean motion n = sqrt(mu / a^3), rad/s.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3.
        discretisation: ``exact`` (closed form) or ``euler`` (I + A dt).

    Raises:
        ValueError: Mean motion or step is not positive, or the density is negative.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> motion = dynamics.cw(mean_motion_rad_s=1.1e-3, step_s=10.0, acceleration_psd_m2_s3=1e-8)
        >>> motion.transition(np.zeros((1, 6)), Step(0)).shape
        (6, 6)
    """
    noise = white_acceleration(acceleration_psd_m2_s3)
    if not (mean_motion_rad_s > 0 and step_s > 0):
        raise ValueError(f"mean_motion_rad_s {mean_motion_rad_s:g} and step_s {step_s:g} must be positive")
    return _dynamics(mean_motion_rad_s, noise, step_s, discretisation)


def _dynamics(n: float, noise: ProcessNoiseOptions, step_s: float, discretisation: Discretisation) -> LinearDynamics:
    A = cw_system(n)
    F = cw_transition(n, step_s) if discretisation == "exact" else np.eye(6) + A * step_s
    return LinearDynamics(F, process_noise_matrix(noise, A, step_s))


def cw_system(n: float) -> Array:
    """Return A (6, 6) of dx/dt = A x; RTN, x radial, y along-track, z orbit normal; n in rad/s."""
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3, 0], A[3, 4] = 3 * n**2, 2 * n
    A[4, 3] = -2 * n
    A[5, 2] = -(n**2)
    return A


def cw_transition(n: float, duration_s: float) -> Array:
    """Return the exact transition matrix (6, 6) over `duration_s`; n is the mean motion in rad/s."""
    angle = n * duration_s
    s, c = np.sin(angle), np.cos(angle)
    # 1 - cos and angle - sin lose all digits at short steps; these forms do not.
    versine = 2 * np.sin(angle / 2) ** 2
    lag = angle - s if angle > 0.1 else angle**3 / 6 * (1 - angle**2 / 20 * (1 - angle**2 / 42))
    return np.array(
        [
            [1 + 3 * versine, 0, 0, s / n, 2 * versine / n, 0],
            [-6 * lag, 1, 0, -2 * versine / n, (s - 3 * lag) / n, 0],
            [0, 0, c, 0, 0, s / n],
            [3 * n * s, 0, 0, c, 2 * s, 0],
            [-6 * n * versine, 0, 0, -2 * s, 4 * c - 3, 0],
            [0, 0, -n * s, 0, 0, c],
        ]
    )
