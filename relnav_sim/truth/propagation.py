"""Orbits of any number of spacecraft at any times: the public face of the integrator."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.truth.forces import ForceModel
from relnav_sim.truth.stepping import Batch, Ending
from relnav_sim.truth.thrust import Schedule

# Steps kept of all orbits together: two revolutions of 100 runs, in 8 MB.
KEPT_STEPS = 20_000
# Below this the rounding of the error estimate itself comes near the tolerance.
SMALLEST_RTOL = 1e-14
RTOL = 1e-12


def propagate(
    state0: ArrayLike,
    times_s: ArrayLike,
    force: ForceModel,
    ballistic_m2_kg: ArrayLike = 0.0,
    rtol: float = 1e-12,
    radiation_m2_kg: ArrayLike = 0.0,
) -> Array:
    """Return the states (B, T, 6) in m and m/s, ECI, of B orbits at T times.

    Dormand-Prince 8(5,3) with dense output of order 7. After a day in low orbit at the default tolerance, positions are
    within 2e-5 m, and so are differences between neighbours (docs/accuracy.md). Through the Earth's shadow that takes
    short steps: with sunlight up to twice as many in all. An orbit's bits depend neither on the others in the batch nor
    on the other times asked for.

    Args:
        state0: Position and velocity (B, 6) in m and m/s, ECI, at time 0, the force model's epoch if it has one.
        times_s: Times (T,) in s after `state0`; increasing, not negative, on any grid.
        force: The force model.
        ballistic_m2_kg: Cd A / m in m^2/kg, a number or (B,); only the atmosphere uses it.
        rtol: Tolerated error per radian of orbit, relative to the orbit's size and speed.
        radiation_m2_kg: Cr A / m in m^2/kg, a number or (B,); only the pressure of sunlight uses it.

    Raises:
        ValueError: An argument has the wrong shape or a value that makes no sense; the message says which.

    Warns:
        RuntimeWarning: An orbit could not be continued; its states are NaN from the named time on. Either it fell into
            the centre, or (with an atmosphere) it started or went below the surface, |r| < `force.radius_m`, between
            whatever times. Without an atmosphere there is no surface, as about a point mass.

    Examples:
        >>> from relnav_sim import ForceModel, propagate
        >>> point_mass = ForceModel(3.986004418e14, 6378137.0, zonals=())
        >>> period_s = 2 * 3.141592653589793 * (7e6**3 / 3.986004418e14) ** 0.5
        >>> circle = [[7e6, 0.0, 0.0, 0.0, (3.986004418e14 / 7e6) ** 0.5, 0.0]]
        >>> states = propagate(circle, [0.0, period_s], point_mass)
        >>> bool(abs(states[0, 1] - states[0, 0]).max() < 1e-3)  # back after a revolution
        True
    """
    surface_m = force.radius_m if force.atmosphere is not None else None
    trajectory = DenseTrajectory(
        state0, force, ballistic_m2_kg, rtol, surface_m=surface_m, radiation_m2_kg=radiation_m2_kg
    )
    states = trajectory.at(times_s)
    for row, (time_s, why) in sorted(trajectory.failures.items()):
        if np.isnan(states[row]).any():  # or it ends later than anyone asked
            warnings.warn(f"orbit {row} ends at t = {time_s:.6g} s: it {why}", RuntimeWarning, stacklevel=2)
    return states


class DenseTrajectory:
    """Orbits that can be evaluated at any time, chunk by chunk; arguments as in `propagate`.

    A `schedule` says when the orbits' thrust changes; the state at that instant is the one after the change. An orbit
    ends where it goes below `surface_m`, m from the centre; None for no surface.

    Integration goes as far as the latest time asked for. The newest interpolants are kept, up to a fixed amount of
    memory; a time before those is integrated again from the start and gives the same bits.

    Attributes:
        failures: Where an orbit could not be continued, by its row in the batch.
    """

    def __init__(
        self,
        state0: ArrayLike,
        force: ForceModel,
        ballistic_m2_kg: ArrayLike = 0.0,
        rtol: float = RTOL,
        schedule: Schedule | None = None,
        surface_m: float | None = None,
        radiation_m2_kg: ArrayLike = 0.0,
    ) -> None:
        states = np.array(state0, dtype=float)
        if states.ndim != 2 or states.shape[1] != 6:
            raise ValueError(f"state0 has shape {states.shape}; it must be (B, 6)")
        if not np.isfinite(states).all():
            raise ValueError("state0 must hold finite numbers")
        if not (states[:, :3] != 0).any(axis=1).all():
            raise ValueError("a position in state0 is at the centre of attraction")
        areas = {"ballistic_m2_kg": ballistic_m2_kg, "radiation_m2_kg": radiation_m2_kg}
        ballistic, radiation = (_of_each(name, given, len(states)) for name, given in areas.items())
        if not SMALLEST_RTOL <= rtol <= 1e-3:
            raise ValueError(f"rtol is {rtol}; it must be between {SMALLEST_RTOL} and 1e-3")
        self._rows = len(states)
        kept = max(KEPT_STEPS // max(self._rows, 1), 2)
        self._batch = Batch(states, force, ballistic, radiation, rtol, kept, schedule, surface_m)

    @property
    def failures(self) -> dict[int, Ending]:
        """Where an orbit could not be continued, by its row in the batch."""
        return self._batch.failures

    def at(self, times_s: ArrayLike) -> Array:
        """Return the states (B, T, 6) at times (T,), increasing and not negative.

        Raises:
            ValueError: The times are not one-dimensional, not finite, negative or decreasing.
        """
        times = np.asarray(times_s, dtype=float)
        if times.ndim != 1:
            raise ValueError(f"times_s has shape {times.shape}; it must be (T,)")
        if not np.isfinite(times).all():
            raise ValueError("times_s must hold finite numbers")
        if len(times) and times[0] < 0:
            raise ValueError(f"times_s starts at {times[0]}; times count from state0 and cannot be negative")
        if (np.diff(times) < 0).any():
            raise ValueError("times_s must increase")
        states = np.empty((self._rows, len(times), 6))
        if states.size:
            self._batch.write(np.ascontiguousarray(times), states)
        return states


def _of_each(name: str, given: ArrayLike, rows: int) -> Array:
    """Return a number of each craft (rows,), given so or as one for all."""
    values = np.asarray(given, dtype=float)
    if values.shape not in ((), (rows,)):
        raise ValueError(f"{name} has shape {values.shape}; it must be a number or ({rows},)")
    if not (np.isfinite(values) & (values >= 0)).all():
        raise ValueError(f"{name} must hold finite numbers of at least 0")
    return np.broadcast_to(values, rows)
