"""The line of sight from one craft to the other in the axes of a sensor, as a function of the relative state."""

from __future__ import annotations

from typing import Literal

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, Vector, rotate, rows
from relnav_sim.astro.nominal_motion import chief_motion
from relnav_sim.measurements.seen_from_deputy import (
    chief_from_deputy,
    chief_from_deputy_with_jacobian,
    deputy_from_chief,
)


class Sight:
    """Where a sensor that stands fixed in the LVLH frame of its host sees the other craft.

    Args:
        mounting: Rotation (3, 3) from the host's LVLH frame to the sensor's frame.
        host: ``chief``: the deputy seen from the chief. ``deputy``: the chief seen from the deputy, in the deputy's own
            orbit frame; needs `chief_orbit`.
        chief_orbit: The chief's nominal orbit, at epoch 0.
        step_s: Time between epochs, s; not needed on a circular orbit.

    Attributes:
        depends_on: The states on which it depends; None: any.
        sensor_from_rtn: Rotation (3, 3) from the host's RTN axes to the sensor's.

    Raises:
        ValueError: The host is the deputy and there is no chief orbit, or an elliptic one and no step.
    """

    def __init__(
        self,
        mounting: Array,
        host: Literal["chief", "deputy"],
        chief_orbit: ChiefOrbit | None,
        step_s: float | None = None,
    ) -> None:
        if host == "deputy" and chief_orbit is None:
            raise ValueError("a sensor on the deputy needs the chief's nominal orbit")
        if host == "deputy" and chief_orbit is not None and chief_orbit.eccentricity > 0 and step_s is None:
            raise ValueError("a sensor on the deputy of an elliptic orbit needs step_s, the time between epochs")
        self.sensor_from_rtn = mounting @ NADIR_FROM_RTN
        self._rtn_from_sensor = rows(self.sensor_from_rtn.T)
        self._orbit, self._step_s = chief_orbit if host == "deputy" else None, step_s or 0.0
        # In the deputy's own orbit frame the chief's bearing depends on the relative velocity as well.
        self.depends_on: tuple[int, ...] | None = (0, 1, 2) if self._orbit is None else None

    def positions(self, states: Array, epoch: int) -> Array:
        """Return where the other craft is seen from the host of states (runs, ..., n), (points, 3 or more) m.

        In the host's RTN axes, in C order for a kernel; columns behind the third are of no meaning.
        """
        points = np.ascontiguousarray(states.reshape(-1, states.shape[-1]), dtype=np.float64)
        if self._orbit is None:
            return points
        return chief_from_deputy(points, chief_motion(self._orbit, self._step_s, epoch))

    def positions_with_jacobian(self, states: Array, epoch: int) -> tuple[Array, Array | None]:
        """Return `positions` and their derivatives by the first six states, (points, 3, 6); None: they are states."""
        points = np.ascontiguousarray(states.reshape(-1, states.shape[-1]), dtype=np.float64)
        if self._orbit is None:
            return points, None
        return chief_from_deputy_with_jacobian(points, chief_motion(self._orbit, self._step_s, epoch))

    def position(self, sight: Vector, epoch: int) -> Array:
        """Return the relative position, RTN (..., 3) m, that has this line of sight; at rest where that matters."""
        seen = rotate(self._rtn_from_sensor, sight)
        if self._orbit is None:
            return np.stack(seen, axis=-1)
        return deputy_from_chief(seen, chief_motion(self._orbit, self._step_s, epoch))


def in_states(by_position: Array, by_state: Array | None, states: Array) -> Array:
    """Return the derivatives by states (runs, ..., n) of m numbers given by their derivatives by position.

    Args:
        by_position: (points, m, 3), or (points, m, n) with zeros behind the third column where positions are states.
        by_state: Derivatives of the positions, from `Sight.positions_with_jacobian`.
        states: The states.

    Returns:
        (runs, ..., m, n).
    """
    H = by_position
    if by_state is not None:
        further = np.zeros((1, by_position.shape[1], states.shape[-1] - 6))
        H = kernels.maps.chained(by_position, by_state, further)
    return H.reshape(*states.shape[:-1], *H.shape[1:])
