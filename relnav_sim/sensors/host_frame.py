"""What a craft knows of its own attitude and orbit: the way from its body to its orbit frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from relnav_sim.astro.attitude import body_to_inertial, from_axes, in_axes, nadir_axes
from relnav_sim.astro.line_of_sight import Vector

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HostFrame:
    """A craft's knowledge over a chunk of epochs. Without GNSS and star tracker it is perfect.

    Attributes:
        true_states: True ECI states of the craft, (runs or 1, K, 6); needed where one of the others is None alone.
        orbit: Its own estimate of them, (runs, K, 6); NaN where it has none. None: there is no receiver, and the orbit
            is known perfectly.
        attitude: Its measured attitude quaternion (x, y, z, w), (runs, K, 4); None: there is no star tracker, and the
            attitude is known perfectly.
    """

    true_states: Array | None = None
    orbit: Array | None = None
    attitude: Array | None = None

    @property
    def body_to_orbit(self) -> Callable[[Vector], Vector] | None:
        """The way from body to estimated nadir frame; None where both are the same.

        Raises:
            ValueError: The truth is needed and missing.
        """
        if self.orbit is None and self.attitude is None:
            return None
        if self.orbit is not None and self.attitude is not None:
            orbit_axes = body_axes = nadir_axes(self.orbit)
        elif self.true_states is None:
            raise ValueError("with GNSS or star tracker alone the other link of the chain needs the truth")
        else:
            body_axes = nadir_axes(self.true_states)
            orbit_axes = body_axes if self.orbit is None else nadir_axes(self.orbit)
        if self.attitude is None:
            return lambda body: in_axes(orbit_axes, from_axes(body_axes, body))
        x, y, z, w = np.moveaxis(self.attitude, -1, 0)
        return lambda body: in_axes(orbit_axes, body_to_inertial((x, y, z, w), body))
