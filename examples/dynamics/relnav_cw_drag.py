"""Relative dynamics for relnav in a package of their own: copy them, rename them, and change how they move."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relnav_sim import Step, register_dynamics
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix, van_loan

Array = NDArray[np.float64]


@register_dynamics("cw_drag")
class CwDragOptions(DynamicsOptions):
    """Clohessy-Wiltshire dynamics with a constant differential drag: circular chief, point mass.

    The along-track acceleration is known beforehand, from ballistic coefficients and density; unlike `augment:
    differential_drag`, which estimates it, it costs no state and can't follow changes. Carter and Humi, J. Guidance
    25(6), 2002, treat drag that varies with speed.
    """

    kind: Literal["cw_drag"] = Field(
        default="cw_drag", description="Clohessy-Wiltshire with constant differential drag"
    )
    along_track_m_s2: float = Field(
        default=-1e-6,
        description="d, m/s^2: along-track acceleration of the deputy less the chief's, negative where the deputy has "
        "more drag; default -1e-6, as of 0.01 m^2/kg at 400 km",
    )

    def build(self, context: DynamicsContext) -> "CwDragDynamics":
        """Return the dynamics about the chief's nominal orbit."""
        A = cw_system(context.orbit.mean_motion_rad_s)
        drag = np.array([0.0, 0.0, 0.0, 0.0, self.along_track_m_s2, 0.0])
        return CwDragDynamics(A, drag, process_noise_matrix(context.process_noise, A, context.step_s), context.step_s)


class CwDragDynamics:
    """x_k = F x_{k-1} + g + w, w ~ N(0, Q): the exact solution of dx/dt = A x + drag over one step.

    The step's system matrix with the drag as a seventh, constant state has F and g in its exponential.
    """

    dimension = 6
    linear = False  # g is added

    def __init__(self, A: Array, drag: Array, process_noise: Array, step_s: float) -> None:
        system = np.zeros((7, 7))
        system[:6, :6], system[:6, 6] = A, drag
        whole, _ = van_loan(system, np.zeros((7, 1)), np.zeros((1, 1)), step_s)
        self._F, self._g, self._Q = whole[:6, :6], whole[:6, 6], process_noise

    def propagate(self, states: Array, step: Step) -> Array:
        """Return F x + g for every state, (runs, ..., 6)."""
        return np.einsum("ij,...j->...i", self._F, states) + self._g

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F, (6, 6)."""
        return self._F

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (6, 6)."""
        return self._Q
