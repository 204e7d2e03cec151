"""Known thrust: what a filter does with manoeuvres that it is told of or measures.

The force of a step is taken as two kicks, one where the step begins and one where it ends, and in between the craft
coast by any dynamics. The kicks give the step's change of velocity, and the change of position that a force spread over
the step or an impulse anywhere in it makes, so an impulse at an epoch is exact; else the error is of second order in
the angle that the orbit turns in a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.astro.attitude import from_axes, nadir_axes
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.kepler import arc
from relnav_sim.dynamics.by_epoch import PerChunk
from relnav_sim.dynamics.interface import Dynamics, Step


def kicks_of(forces: Array, step_s: float) -> tuple[Array, Array]:
    """Return the changes of velocity before and after a step, (..., 3) m/s, from its two mean forces.

    Args:
        forces: (..., 2, 3) m/s^2: the mean over the step, and the one weighted with the time that is left.
        step_s: Length of the step, s.
    """
    before = step_s / 2 * forces[..., 1, :]
    return before, step_s * forces[..., 0, :] - before


class KnownThrust:
    """Dynamics of two craft whose thrust is known: kick, coast by the base, kick.

    A craft's thrust is given in the RTN axes of its own orbit. The deputy's are turned into the chief's by the state.
    The chief's changes the frame as well: along the normal it tilts the orbit plane, along-track it changes the rate.
    The chief's nominal orbit gives its radius and speed. Until `take` there is no thrust.

    Args:
        base: Dynamics without thrust; six states.
        orbit: The chief's nominal orbit.
        step_s: Time between epochs, s.
    """

    linear = False

    def __init__(self, base: Dynamics, orbit: ChiefOrbit, step_s: float) -> None:
        self.base = base
        self.dimension = base.dimension
        self._step_s = step_s
        self._chief = PerChunk(lambda epochs: _motion(orbit, epochs * step_s))
        self.take(np.zeros((1, 0, 2, 2, 3)), 0)

    def take(self, forces: Array, first_epoch: int, noise: Array | None = None) -> None:
        """Take the forces in the next steps; a step is named by the epoch at which it ends.

        Args:
            forces: Specific force on chief and deputy, (runs or 1, K, 2, 2, 3), m/s^2, RTN axes of each: the mean over
                the step, and the mean weighted with the time that is left, 2 / step^2 times the integral of
                (end - t) f, which for a constant force is the same.
            first_epoch: Epoch at which the first of the steps ends.
            noise: Covariance to add to Q for what is not known of them, (K, 6, 6) or (runs, K, 6, 6), SI units.
        """
        self._before, self._after = kicks_of(forces, self._step_s)
        self._chief_thrusts, self._deputy_thrusts = (forces != 0).any(axis=(0, 3, 4)).T
        self._first_epoch = first_epoch
        self._noise = noise

    def propagate(self, states: Array, step: Step) -> Array:
        """Return the states (runs, ..., 6) after the step."""
        moved = self.base.propagate(self._kicked(states, step, self._before, step.epoch - 1), step)
        return self._kicked(moved, step, self._after, step.epoch)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian of `propagate` at `mean` (runs, 6).

        The turn from the deputy's axes to the chief's is held fixed: its derivative is dv over the orbit's radius.
        """
        F = self.base.transition(self._kicked(mean, step, self._before, step.epoch - 1), step)
        place = self._place(step)
        if place is None or not self._chief_thrusts[place]:
            return F
        before, after = (
            _frame_change(kicks[:, place, 0], self._motion(epoch))
            for kicks, epoch in ((self._before, step.epoch - 1), (self._after, step.epoch))
        )
        return after.jacobian() @ F @ before.jacobian()

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return the base's Q and that of the thrust, (6, 6) or (runs, ..., 6, 6).

        Where only the thrust's differs between runs it is (runs, 6, 6) whatever the states.
        """
        Q = self.base.process_noise(states, step)
        place = self._place(step)
        if place is None or self._noise is None:
            return Q
        # Its shape is that of all epochs, whatever happens in this one and to other runs.
        extra = self._noise[..., place, :, :]
        if Q.ndim > extra.ndim > 2:
            extra = extra.reshape(len(extra), *[1] * (Q.ndim - 3), 6, 6)
        return Q + extra

    def input_matrix(self, mean: Array, step: Step) -> Array:
        """Return the derivative of `propagate` by a constant acceleration of the deputy, (6, 3) or (runs, 6, 3)."""
        F = self.base.transition(self._kicked(mean, step, self._before, step.epoch - 1), step)
        return self._step_s / 2 * (F[..., 3:] + np.eye(6)[:, 3:])

    def pushed(self, step: Step) -> Mask:
        """Return in which runs there is a force in a step, (runs,), or (1,) where all have the same."""
        place = self._place(step)
        if place is None:
            return np.zeros(1, dtype=bool)
        found: Mask = ((self._before[:, place] != 0) | (self._after[:, place] != 0)).any(axis=(1, 2))
        return found

    def _place(self, step: Step) -> int | None:
        """Return the step's place among the known forces, None before there are any."""
        place = step.epoch - self._first_epoch
        known = self._before.shape[1]
        if not known:
            return None
        if not 0 <= place < known:
            raise ValueError(
                f"the thrust of the step to epoch {step.epoch} is not known; "
                f"there is that of epochs {self._first_epoch} to {self._first_epoch + known - 1}"
            )
        return place

    def _motion(self, epoch: int) -> _Motion:
        (radius, rate, climb), place = self._chief.at(epoch)
        return _Motion(radius[place], rate[place], climb[place])

    def _kicked(self, states: Array, step: Step, kicks: Array, epoch: int) -> Array:
        """Return states (runs, ..., 6) after the kicks (runs or 1, K, 2, 3) of the step at one of its ends."""
        place = self._place(step)
        if place is None or not (self._chief_thrusts[place] or self._deputy_thrusts[place]):
            return states
        spread = (slice(None), *[None] * (states.ndim - 2))
        chief, deputy = (kicks[:, place, craft][spread] for craft in (0, 1))
        motion = self._motion(epoch)
        if self._chief_thrusts[place]:
            # A run without thrust keeps its bits, whatever the others of its block do.
            kicked = (chief != 0).any(axis=-1, keepdims=True)
            states = np.where(kicked, _frame_change(chief, motion)(states), states)
        if self._deputy_thrusts[place]:
            radial, along, normal = np.moveaxis(deputy, -1, 0)
            kick = from_axes(nadir_axes(motion.inertial(states)), (along, -normal, -radial))
            states = states.copy()
            for i in range(3):
                states[..., 3 + i] += kick[i]
        return states


@dataclass(frozen=True)
class _Motion:
    """The chief's nominal motion at an instant: distance from the centre, angular rate, radial velocity."""

    radius_m: float
    rate_rad_s: float
    climb_m_s: float

    def inertial(self, states: Array) -> Array:
        """Return the deputy's position from the centre and its inertial velocity (..., 6), along the chief's axes."""
        x, y, z, vx, vy, vz = np.moveaxis(states, -1, 0)
        r, n = self.radius_m + x, self.rate_rad_s
        return np.stack([r, y, z, self.climb_m_s + vx - n * y, vy + n * r, vz], axis=-1)


def _motion(orbit: ChiefOrbit, times_s: Array) -> tuple[Array, Array, Array]:
    there = arc(orbit, times_s, np.zeros(1))
    momentum = sqrt(orbit.mu_m3_s2 * orbit.semi_major_axis_m * (1 - orbit.eccentricity**2))
    climb = orbit.mu_m3_s2 / momentum * orbit.eccentricity * np.sin(there.true_anomaly_rad)
    return there.start_radius_m, momentum / np.square(there.start_radius_m), climb


@dataclass(frozen=True)
class _FrameChange:
    """What a kick of the chief does to relative states: x -> K x - [0, dv], in the frame of its new orbit.

    The plane turns about the radius by an angle with the given cosine and sine; the rate about the normal changes.
    Arrays broadcast against the leading axes of the states.
    """

    cosine: Array
    sine: Array
    old_rate: float
    new_rate: Array
    kick: tuple[Array, Array, Array]

    def __call__(self, states: Array) -> Array:
        """Return the states in the new frame."""
        moved = self.linear(states)
        for i in range(3):
            moved[..., 3 + i] -= self.kick[i]
        return moved

    def linear(self, states: Array) -> Array:
        """Return K x."""
        x, y, z, vx, vy, vz = np.moveaxis(states, -1, 0)
        c, s = self.cosine, self.sine
        # In axes that do not turn, the deputy moves with u; tilted, the new frame sees it move with v'.
        ux, uy = vx - self.old_rate * y, vy + self.old_rate * x
        across, normal = c * y + s * z, c * z - s * y
        return np.stack(
            [
                x + 0 * c,
                across,
                normal,
                ux + self.new_rate * across,
                c * uy + s * vz - self.new_rate * x,
                c * vz - s * uy,
            ],
            axis=-1,
        )

    def jacobian(self) -> Array:
        """Return K, (runs or 1, 6, 6); for a kick (runs or 1, 3)."""
        spread = _FrameChange(
            self.cosine[:, None], self.sine[:, None], self.old_rate, self.new_rate[:, None], self.kick
        )
        # Row j of the result of the unit vectors is column j of K.
        return np.ascontiguousarray(spread.linear(np.eye(6)[None]).swapaxes(-1, -2))


def _frame_change(kick: Array, motion: _Motion) -> _FrameChange:
    """Return what a kick (..., 3) of the chief, in its RTN axes before it, does."""
    radial, along, normal = np.moveaxis(kick, -1, 0)
    forward = motion.radius_m * motion.rate_rad_s + along
    speed = np.sqrt(forward * forward + normal * normal)
    c, s, new_rate = forward / speed, normal / speed, speed / motion.radius_m
    still = (kick == 0).all(axis=-1)
    new_rate = np.where(still, motion.rate_rad_s, new_rate)
    return _FrameChange(c, s, motion.rate_rad_s, new_rate, (radial, c * along + s * normal, c * normal - s * along))
