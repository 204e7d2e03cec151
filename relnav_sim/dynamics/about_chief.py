"""Exact relative motion about the chief's orbit as the filter itself knows it, by the gravity that it believes in."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.chief_segments import ChiefFollower, ChiefSegments, NominalChief
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import Arrival, DynamicsContext
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.motion import Motion
from relnav_sim.dynamics.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix
from relnav_sim.given_arrays import finite, numbers


class AboutChiefDynamics:
    """The difference of two orbits in the chief's RTN frame.

    It is integrated to rounding error, about the nominal orbit until it is given the chief's states.

    A step starts from the chief's state at its first epoch and carries the chief along, so that the frame at its end
    is the one that state leads to. The frame's rate includes the tilt of the orbit plane by the gravity. The duration
    of a `Step` is not looked at.

    Args:
        motion: How craft move.
        process_noise: Q (6, 6).
        chief: What the chief does until fixes are fed.
        follower: What estimates the chief's orbit from the fixes that are fed; default: they are not looked at.
    """

    dimension = 6
    linear = False
    leaves_arguments_alone = True

    def __init__(
        self,
        motion: Motion,
        process_noise: Array,
        chief: ChiefSegments | NominalChief,
        follower: ChiefFollower | None = None,
    ) -> None:
        self._motion = motion
        self._Q = process_noise
        self._chief = chief
        self._follower = follower
        self._latest: tuple[int, bytes, Array] | None = None

    def with_chief(self, chief: Array, first_epoch: int) -> AboutChiefDynamics:
        """Return the same dynamics about the chief's states at some epochs.

        Args:
            chief: The filter's own estimates, ECI, (runs, K, 6), m and m/s. The step to epoch k takes that of k - 1.
            first_epoch: Epoch of the first of them.
        """
        return AboutChiefDynamics(self._motion, self._Q, ChiefSegments(chief, first_epoch, self._motion))

    def feed(self, arrival: Arrival) -> None:
        """Take the chief's fixes at the next epochs, and the forces on it."""
        if self._follower is not None and arrival.chief_fixes is not None:
            chief_forces = None if arrival.forces is None else arrival.forces[:, :, 0]
            self._chief = self._follower.take(arrival.chief_fixes, arrival.first_epoch, chief_forces)
            self._latest = None

    def linearised_chief(self, arrival: Arrival) -> tuple[Array, Array, Array] | None:
        """Return what the chief's next estimates are and depend on, see `ChiefInFirstOrder`; nothing is taken."""
        if self._follower is None or arrival.chief_fixes is None:
            return None
        return self._follower.linearised(
            arrival.chief_fixes, None if arrival.forces is None else arrival.forces[:, :, 0]
        )

    def propagate(self, states: Array, step: Step) -> Array:
        """Return states (runs, ..., 6) after the step that ends at its epoch."""
        # A filter asks for the Jacobian and then for the mean of the same step.
        if self._latest is not None and self._latest[:2] == (step.epoch, states.tobytes()) and states.ndim == 2:
            return self._latest[2].copy()
        return self._motion.flow(states, self._chief.segment(step.epoch))

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian (runs, 6, 6) of `propagate` at `mean` (runs, 6), by the variational equations."""
        end, F = self._motion.linear_flow(mean, self._chief.segment(step.epoch))
        self._latest = step.epoch, mean.tobytes(), end
        return F

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (6, 6)."""
        return self._Q


def about_chief(
    motion: Motion, orbit: ChiefOrbit, context: DynamicsContext, chief_orbit: OrbitFilterOptions
) -> AboutChiefDynamics:
    """Return the dynamics about the nominal orbit until they are fed with fixes of the chief.

    Args:
        motion: How craft move.
        orbit: The nominal orbit, with the constants of the body that the filter believes in.
        context: What the dynamics are built from.
        chief_orbit: How the chief's orbit is estimated.
    """
    fixes, step_s = context.chief_fixes, context.step_s
    Q = process_noise_matrix(context.process_noise, cw_system(orbit.mean_motion_rad_s), step_s)
    if fixes is None:
        nominal = context.share("nominal chief", lambda: NominalChief(orbit, step_s, motion))
        return AboutChiefDynamics(motion, Q, nominal)

    def follower() -> ChiefFollower:
        return ChiefFollower(OrbitFilter(chief_orbit, orbit, fixes.sigmas, step_s, fixes.runs, motion), motion)

    return AboutChiefDynamics(motion, Q, NominalChief(orbit, step_s, motion), context.share("chief", follower))


def about_given(dynamics: AboutChiefDynamics, chief: ArrayLike | None) -> AboutChiefDynamics:
    """Return dynamics about the chief's states at the start of each step, as a user gives them; None: as they are.

    Args:
        dynamics: The dynamics.
        chief: ECI (J2000 axes), (T, 6) or (runs, T, 6), m and m/s; the first is one step before the first measurement.

    Raises:
        ValueError: The states have another shape or are not finite.
    """
    if chief is None:
        return dynamics
    states = finite(numbers(chief, "chief"), "chief", ("run", "epoch", "component")[-np.ndim(chief) :])
    if states.ndim not in (2, 3) or states.shape[-1] != 6:
        raise ValueError(f"chief has shape {states.shape}; it must be (T, 6) or (runs, T, 6)")
    return dynamics.with_chief(states.reshape(-1, *states.shape[-2:]).copy(), first_epoch=-1)
