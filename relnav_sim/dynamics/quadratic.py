"""Relative motion about a circular orbit to second order in the separation: Clohessy-Wiltshire and curvature."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.clohessy_wiltshire import cw_system, cw_transition
from relnav_sim.dynamics.collocation import gauss_rule
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix, white_acceleration
from relnav_sim.dynamics.registry import register_dynamics

_NODES = 8
"""Gauss nodes over a step: rounding error for steps up to a tenth of a revolution."""


@register_dynamics("cw_second_order")
class CwSecondOrderOptions(DynamicsOptions):
    """Clohessy-Wiltshire with the quadratic terms of gravity (London, AIAA J. 1(7), 1963): circular chief, point mass.

    At 12 km separation the quadratic terms are 3.6e-5 m/s^2 and the neglected part of curvature is 6e-8 m/s^2.
    """

    kind: Literal["cw_second_order"] = Field(
        default="cw_second_order", description="Clohessy-Wiltshire dynamics with quadratic terms"
    )

    def build(self, context: DynamicsContext) -> CwSecondOrderDynamics:
        """Return the dynamics about a circle with the nominal semi-major axis."""
        Q = process_noise_matrix(context.process_noise, cw_system(context.orbit.mean_motion_rad_s), context.step_s)
        return CwSecondOrderDynamics(context.orbit, Q, context.step_s)


def cw_second_order(*, orbit: ChiefOrbit, step_s: float, acceleration_psd_m2_s3: float) -> CwSecondOrderDynamics:
    """Return Clohessy-Wiltshire with gravity's quadratic terms (London, AIAA J. 1(7), 1963) for `create_filter`.

    The state is the deputy's position and velocity relative to the chief, (6,), m and m/s, in the chief's RTN frame
    (see `cw`). The chief's orbit is taken as a circle.

    Args:
        orbit: The chief's nominal orbit; its semi-major axis counts.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3,
            discretised about a circular orbit.

    Raises:
        ValueError: The density is negative.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> orbit = dynamics.ChiefOrbit(7.0e6, 0.0, 0.9, 0.0, 0.0, 0.0)
        >>> motion = dynamics.cw_second_order(orbit=orbit, step_s=10.0, acceleration_psd_m2_s3=1e-8)
        >>> motion.propagate(np.array([[0.0, -1000.0, 0.0, 0.0, 0.0, 0.0]]), Step(0)).shape
        (1, 6)
    """
    return CwSecondOrderOptions().build(DynamicsContext(orbit, white_acceleration(acceleration_psd_m2_s3), step_s))


def quadratic_acceleration(n: float, radius_m: float) -> Array:
    """Return a2 (3, 6, 6), a2_k = x^T a2[k] x, the second-order part of the relative acceleration, RTN.

    (3 n^2 / 2 R) (y^2 + z^2 - 2 x^2, 2 x y, 2 x z): the third-order part of the potential mu / |R + r|.
    """
    a2 = np.zeros((3, 6, 6))
    a2[0, 0, 0], a2[0, 1, 1], a2[0, 2, 2] = -2.0, 1.0, 1.0
    for i in (1, 2):
        a2[i, 0, i] = a2[i, i, 0] = 1.0
    return 1.5 * n**2 / radius_m * a2


class CwSecondOrderDynamics:
    """The flow of one step as a quadratic map, x_k = F x + x^T D x + w, w ~ N(0, Q).

    F is the exact Clohessy-Wiltshire matrix and D the integral of the quadratic acceleration along F's motion, so the
    map is the Taylor series of the exact flow up to second order in the state, at the cost of one small product. A
    step's third-order error is below that of the equations themselves.

    Args:
        orbit: The chief's nominal orbit, taken as circular.
        process_noise: Q (6, 6).
        step_s: Time between epochs, s; the duration of a `Step` is not looked at.
    """

    dimension = 6
    linear = False
    leaves_arguments_alone = True

    def __init__(self, orbit: ChiefOrbit, process_noise: Array, step_s: float) -> None:
        n = orbit.mean_motion_rad_s
        a2 = quadratic_acceleration(n, orbit.semi_major_axis_m)
        F = cw_transition(n, step_s)
        rule = gauss_rule(_NODES, 1)
        D = np.zeros((6, 6, 6))
        for node, weight in zip(rule.nodes, rule.velocity, strict=True):
            before = cw_transition(n, float(node) * step_s)
            after = cw_transition(n, float(1 - node) * step_s)[:, 3:]
            D += weight * step_s * np.einsum("mk,kij,ia,jb->mab", after, a2, before, before)
        self._Q = process_noise
        self._F, self._D = F, D

    def propagate(self, states: Array, step: Step) -> Array:
        """Return F x + x^T D x for every state, (runs, ..., 6)."""
        points = np.ascontiguousarray(states, dtype=float).reshape(-1, 6)
        return kernels.maps.quadratic(self._F, self._D, points).reshape(states.shape)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian F + 2 D x at `mean` (runs, 6): (runs, 6, 6)."""
        return kernels.maps.quadratic_jacobians(self._F, self._D, np.ascontiguousarray(mean, dtype=float))

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (6, 6)."""
        return self._Q
