"""Former name of `relnav_sim.dynamics.interface`."""

from relnav_sim.dynamics.interface import Dynamics, LinearDynamics, Step

__all__ = ["Dynamics", "LinearDynamics", "Step"]
