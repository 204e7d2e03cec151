"""Relative motion of two point masses under J2, about the chief's orbit as the filter itself knows it."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from relnav_sim.linalg import runs_last
from relnav_sim.models.chief_orbit import ChiefOrbit
from relnav_sim.models.cw import cw_system
from relnav_sim.models.dynamics import Step
from relnav_sim.models.gravity import Gravity
from relnav_sim.models.kepler import initial_state
from relnav_sim.models.orbit_filter import OrbitFilter, OrbitFilterOptions
from relnav_sim.models.orbit_flow import advance_orbit, orbit_frame
from relnav_sim.models.process_noise import ProcessNoiseOptions, process_noise_matrix
from relnav_sim.models.relative_flow import Division, Leg, divide, flow, flow_jacobian, turning_frame
from relnav_sim.models.stretches import EPOCHS, PerStretch
from relnav_sim.options import Options

Array = NDArray[np.float64]


class NonlinearJ2Options(Options):
    """Exact relative motion under a point mass and J2, about the chief's orbit estimated from its own GNSS fixes.

    Without GNSS fixes of the chief, the nominal orbit takes their place, propagated under J2.
    """

    step_cost_us: ClassVar[float] = 12.0
    """Rough CPU time that a filter's step takes longer than with `cw`, us; for the plan of a campaign."""
    step_overhead_us: ClassVar[float] = 1000.0
    """Rough CPU time of a step however few the runs, us; it keeps such filters of small blocks apart."""

    kind: Literal["nonlinear_j2"] = Field(
        default="nonlinear_j2", description="Exact relative motion with J2 about the chief's estimated orbit"
    )
    chief_orbit: OrbitFilterOptions = Field(
        default=OrbitFilterOptions(), description="How the chief's orbit is estimated from its GNSS fixes"
    )

    def build(self, orbit: ChiefOrbit, noise: ProcessNoiseOptions, step_s: float) -> NonlinearJ2Dynamics:
        """Return the dynamics about the nominal orbit; `NonlinearJ2Dynamics.with_chief` puts the estimated one in."""
        Q = process_noise_matrix(noise, cw_system(orbit.mean_motion_rad_s), step_s)
        return NonlinearJ2Dynamics(orbit, Q, step_s)

    def follower(
        self, dynamics: NonlinearJ2Dynamics, orbit: ChiefOrbit, fix_sigmas: Array, step_s: float, runs: int
    ) -> ChiefFollower:
        """Return what supplies the dynamics with the chief's orbit from its fixes; arguments as of `OrbitFilter`."""
        return ChiefFollower(dynamics, OrbitFilter(self.chief_orbit, orbit, fix_sigmas, step_s, runs))


class NonlinearJ2Dynamics:
    """The difference of two orbits under a point mass and J2 in the chief's RTN frame, integrated to rounding error.

    It goes by the nominal orbit under J2 until it is given the chief's states.

    A step starts from the chief's state at its first epoch and carries the chief along, so that the frame at its end
    is the one that state leads to. The frame's rate includes J2's tilt of the orbit plane. The duration of a `Step` is
    not looked at.

    Args:
        orbit: The chief's nominal orbit.
        process_noise: Q (6, 6).
        step_s: Time between epochs, s.
    """

    dimension = 6
    linear = False

    def __init__(self, orbit: ChiefOrbit, process_noise: Array, step_s: float) -> None:
        self._orbit = orbit
        self._Q = process_noise
        self._step_s = step_s
        self._chief: Array | None = None
        self._first_epoch = 0
        self._division = divide(orbit, step_s)
        self._gravity = Gravity(orbit.mu_m3_s2, orbit.equatorial_radius_m, orbit.j2)
        self._nominal = NominalChief(orbit, step_s)
        self._latest: tuple[int, Leg] | None = None

    def with_chief(self, chief: Array, first_epoch: int) -> NonlinearJ2Dynamics:
        """Return the same dynamics about the chief's states at some epochs.

        Args:
            chief: The filter's own estimates, ECI, (runs, K, 6), m and m/s. The step to epoch k takes that of k - 1.
            first_epoch: Epoch of the first of them.
        """
        bound = NonlinearJ2Dynamics(self._orbit, self._Q, self._step_s)
        bound.follow_chief(chief, first_epoch)
        return bound

    def follow_chief(self, chief: Array, first_epoch: int) -> None:
        """Take the chief's states from here on, as in `with_chief`; for a filter fed a stretch of epochs at a time."""
        self._chief, self._first_epoch, self._latest = chief, first_epoch, None

    def propagate(self, states: Array, step: Step) -> Array:
        """Return states (runs, ..., 6) after the step that ends at its epoch."""
        return flow(states, self._leg(step.epoch), self._division, self._gravity)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian (runs, 6, 6) of `propagate` at `mean` (runs, 6), by the variational equations."""
        return flow_jacobian(mean, self._leg(step.epoch), self._division, self._gravity)

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (6, 6)."""
        return self._Q

    def _leg(self, epoch: int) -> Leg:
        # A filter asks for the mean and the Jacobian of the same step.
        if self._latest is None or self._latest[0] != epoch:
            leg, _ = chief_leg(runs_last(self._start(epoch - 1)), self._division, self._gravity)
            self._latest = epoch, leg
        return self._latest[1]

    def _start(self, epoch: int) -> Array:
        """Return the chief's states at an epoch, (runs or 1, 6)."""
        if self._chief is None:
            return self._nominal.at(epoch)
        place = epoch - self._first_epoch
        if not 0 <= place < self._chief.shape[1]:
            last = self._first_epoch + self._chief.shape[1] - 1
            raise ValueError(
                f"the step to epoch {epoch + 1} needs the chief's state at epoch {epoch}; "
                f"there are those of epochs {self._first_epoch} to {last}"
            )
        return self._chief[:, place]


def chief_leg(chief: Array, division: Division, gravity: Gravity) -> tuple[Leg, Array]:
    """Return what the chief does over one step from its state (6, b), ECI, and its state at the end (6, b)."""
    enter, _ = turning_frame(*orbit_frame(chief, gravity))
    end, nodes = advance_orbit(chief, division, gravity)
    _, leave = turning_frame(*orbit_frame(end, gravity))
    return Leg(enter, leave, nodes), end


class ChiefFollower:
    """Keeps dynamics supplied with the chief's estimated orbit, a stretch of epochs at a time.

    Args:
        dynamics: What to supply.
        filter: Estimates the chief's orbit; fresh.
    """

    def __init__(self, dynamics: NonlinearJ2Dynamics, filter: OrbitFilter) -> None:
        self._dynamics = dynamics
        self._filter = filter
        self._before: Array | None = None

    def take(self, fixes: Array, first_epoch: int, forces: Array | None = None) -> None:
        """Take the chief's GNSS fixes of the next stretch, (runs, K, 6), ECI, NaN = none; the first is at epoch 0.

        Args:
            fixes: The fixes.
            first_epoch: Epoch of the first of them.
            forces: Known thrust in the steps that end there, as `KnownThrust.take` has it; the chief's is used.
        """
        estimates = self._filter.advance(fixes, None if forces is None else forces[:, :, 0])
        # The first step of a stretch begins at the last epoch of the one before.
        known = estimates if self._before is None else np.concatenate([self._before, estimates], axis=1)
        self._dynamics.follow_chief(known, first_epoch + estimates.shape[1] - known.shape[1])
        self._before = estimates[:, -1:]


class NominalChief:
    """The nominal orbit under J2, epoch by epoch: what a filter knows without any fix.

    Args:
        orbit: The nominal orbit; epoch 0 is its own.
        step_s: Time between epochs, s.
    """

    def __init__(self, orbit: ChiefOrbit, step_s: float) -> None:
        self._division = divide(orbit, step_s)
        self._gravity = Gravity(orbit.mu_m3_s2, orbit.equatorial_radius_m, orbit.j2)
        self._stretches = PerStretch(self._states)
        self._starts = [initial_state(orbit)[:, None]]

    def at(self, epoch: int) -> Array:
        """Return the state at an epoch from 0 on; at -1 it is one step before, ECI, (1, 6)."""
        if epoch < 0:
            backwards = Division(self._division.rule, self._division.parts, -self._division.part_s)
            return advance_orbit(self._starts[0], backwards, self._gravity)[0].T
        states, place = self._stretches.at(epoch)
        return states[place]

    def _states(self, epochs: Array) -> Array:
        stretch = int(epochs[0]) // EPOCHS
        while len(self._starts) <= stretch:
            self._starts.append(self._walk(self._starts[-1])[1])
        return self._walk(self._starts[stretch])[0]

    def _walk(self, state: Array) -> tuple[Array, Array]:
        """Return the states of a stretch from its first one (6, 1), (512, 1, 6), and the first one after it."""
        states = np.empty((EPOCHS, 1, 6))
        for place in states:
            place[:] = state.T
            state, _ = advance_orbit(state, self._division, self._gravity)
        return states, state
