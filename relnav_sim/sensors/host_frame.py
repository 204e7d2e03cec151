"""What a craft knows of its own attitude and orbit: the way from its body to its orbit frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.attitude import from_axes, in_axes, nadir_axes
from relnav_sim.astro.coast import coasted
from relnav_sim.astro.frames import rtn_from_eci
from relnav_sim.astro.gravity import Gravity
from relnav_sim.astro.line_of_sight import Vector, components, dot


@dataclass(frozen=True)
class HostOrbit:
    """A craft's own knowledge of its orbit over a chunk of epochs, between its fixes too.

    Attributes:
        states: Its fixes, and where there is none its estimate, ECI, (runs, K, 6), m and m/s; NaN before the first fix.
        frame: Covariance (runs, K, 6, 6) of the error of the orbit frame that follows, as `astro.frame_error` has it.
    """

    states: Array
    frame: Array


@dataclass(frozen=True)
class HostFrame:
    """A craft's knowledge over a chunk of epochs. Without GNSS and star tracker it is perfect.

    Attributes:
        true_states: True ECI states of the craft, (runs or 1, K, 6); needed where one of the others is None alone.
        orbit: Its own estimate of them, (runs, K, 6); NaN where it has none. None: there is no receiver, and the orbit
            is known perfectly.
        attitude: Its measured attitude quaternion (x, y, z, w), (runs, K, 4); None: there is no star tracker, and the
            attitude is known perfectly.
        gravity: What it knows of gravity, which turns the plane of its orbit; None: a point mass.
        late_s: How long before its epoch each measurement was taken, on top of the sensor's latency, (runs, K), s;
            None: at the epoch.
    """

    true_states: Array | None = None
    orbit: Array | None = None
    attitude: Array | None = None
    gravity: Gravity | None = None
    late_s: Array | None = None

    def in_rtn(self, relative: Array, latency_s: float = 0.0) -> Array:
        """Return a position (m), or position and velocity (m/s), relative to the craft, ECI, in its own orbit frame.

        The orbit frame is that of its own estimate, or the true one without a receiver, when the measurement was taken.
        NaN where it does not know its orbit.

        Args:
            relative: (runs, K, 3 or 6), ECI.
            latency_s: How long ago that was.

        Raises:
            ValueError: The truth is needed and missing.
        """
        states = self.true_states if self.orbit is None else self.orbit
        if states is None:
            raise ValueError("without a receiver the orbit frame is the true one, which needs the truth")
        ago_s = latency_s if self.late_s is None else latency_s + self.late_s
        host = coasted(states, -ago_s) if np.any(ago_s) else states
        other = np.array(np.broadcast_to(host, (*relative.shape[:-1], 6)))
        other[..., : relative.shape[-1]] += relative
        return rtn_from_eci(host, other, self._normal_acceleration(host))[..., : relative.shape[-1]]

    def _normal_acceleration(self, states: Array) -> Array | float:
        """Return gravity's component along the orbit normal at states (runs or 1, K, 6), m/s^2."""
        if self.gravity is None or self.gravity.is_central:
            return 0.0
        _, minus_normal, _ = nadir_axes(states)
        return -dot(components(self.gravity.acceleration(states[..., :3])), minus_normal)

    @property
    def body_to_orbit(self) -> Callable[[Vector], Vector] | None:
        """The way from body to estimated LVLH frame; None where both are the same.

        Raises:
            ValueError: The truth is needed and missing.
        """
        if self.orbit is None and self.attitude is None:
            return None
        if self.true_states is None and (self.orbit is None or self.attitude is None):
            raise ValueError("with GNSS or star tracker alone the other link of the chain needs the truth")
        orbit = self.true_states if self.orbit is None else self.orbit
        assert orbit is not None
        if self.attitude is None:
            assert self.true_states is not None
            orbit_axes, body_axes = nadir_axes(orbit), nadir_axes(self.true_states)
            return lambda body: in_axes(orbit_axes, from_axes(body_axes, body))
        states, attitude = np.ascontiguousarray(orbit), np.ascontiguousarray(self.attitude)

        def to_orbit(body: Vector) -> Vector:
            x, y, z = kernels.frames.orbit_from_body(states, attitude, *map(np.ascontiguousarray, body))
            return x, y, z

        return to_orbit
