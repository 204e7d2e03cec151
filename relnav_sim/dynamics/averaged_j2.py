"""Linear relative motion about a circular orbit under J2, averaged over the orbit."""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.by_epoch import LinearByEpoch
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.context import DynamicsContext
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix, white_acceleration
from relnav_sim.dynamics.registry import register_dynamics

_IN_PLANE, _ACROSS = np.array([0, 1, 3, 4]), np.array([2, 5])


@register_dynamics("schweighart_sedwick")
class SchweighartSedwickOptions(DynamicsOptions):
    """Schweighart and Sedwick's dynamics (J. Guidance 25(6), 2002): linear, circular chief, J2's gradient averaged.

    It has the secular effects of differential J2; what varies twice a revolution, of the same size, is neglected.
    """

    kind: Literal["schweighart_sedwick"] = Field(
        default="schweighart_sedwick", description="Linear dynamics about a circular orbit with averaged J2"
    )

    def build(self, context: DynamicsContext) -> LinearByEpoch:
        """Return the dynamics; epoch k is k steps after the nominal orbit's own epoch."""
        orbit, step_s = context.orbit, context.step_s
        motion = AveragedJ2(orbit)

        def transitions(epochs: Array) -> Array:
            return motion.transition((epochs - 1) * step_s, step_s)

        Q = process_noise_matrix(context.process_noise, cw_system(orbit.mean_motion_rad_s), step_s)
        return LinearByEpoch(transitions, Q)


def schweighart_sedwick(*, orbit: ChiefOrbit, step_s: float, acceleration_psd_m2_s3: float) -> LinearByEpoch:
    """Return Schweighart and Sedwick's dynamics (J. Guidance 25(6), 2002): linear, averaged J2 for `create_filter`.

    The state is the deputy's position and velocity relative to the chief, (6,), m and m/s, in the chief's RTN frame
    (see `cw`). Epoch k is k steps
    after the nominal orbit's own epoch, at which it has its true anomaly.

    Args:
        orbit: The chief's nominal orbit, taken as a circle.
        step_s: Time between epochs, s; give `run_filter` the same.
        acceleration_psd_m2_s3: Process noise: power spectral density of a white acceleration on each axis, m^2/s^3,
            discretised about a circular orbit.

    Raises:
        ValueError: The density is negative.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import Step, dynamics
        >>> orbit = dynamics.ChiefOrbit(7.0e6, 0.0, 0.9, 0.0, 0.0, 0.0)
        >>> motion = dynamics.schweighart_sedwick(orbit=orbit, step_s=10.0, acceleration_psd_m2_s3=1e-8)
        >>> motion.propagate(np.array([[0.0, -1000.0, 0.0, 0.0, 0.0, 0.0]]), Step(0)).shape
        (1, 6)
    """
    return SchweighartSedwickOptions().build(DynamicsContext(orbit, white_acceleration(acceleration_psd_m2_s3), step_s))


class AveragedJ2:
    """The differential form of Schweighart and Sedwick's equations, RTN.

        x'' = 2 n c y' + (5 c^2 - 2) n^2 x,  y'' = -2 n c x',  z'' = -q^2 z + 2 l q cos(q t + phi)

    with s = 3 J2 Re^2 (1 + 3 cos 2i) / (8 r^2), c = sqrt(1 + s): the forcing of each orbit about their common
    reference cancels between two craft. Across the orbit the paper follows amplitude and phase of
    z = (l t + m) sin(q t + phi), the angle between two planes whose nodes drift apart, from rates taken at the start.
    Here the same geometry is kept linear in the state: z = r (di sin u - sin i dO cos u) with the argument of latitude
    u turning at q = n c + 3 n J2 Re^2 cos^2 i / (2 r^2) and the difference in node drifting at
    dO' = 3 n J2 Re^2 sin i di / (2 r^2). That gives l and phi at every instant, with u from the nominal orbit.

    Attributes:
        in_plane: System matrix of x, y and their rates, (4, 4).
        latitude_rate: q, rad/s.
        drift: sin i times the node's drift per inclination, rad/s.
    """

    def __init__(self, orbit: ChiefOrbit) -> None:
        n, i = orbit.mean_motion_rad_s, orbit.inclination_rad
        oblate = orbit.j2 * (orbit.equatorial_radius_m / orbit.semi_major_axis_m) ** 2
        c = sqrt(1 + 3 / 8 * oblate * (1 + 3 * cos(2 * i)))
        self.in_plane = np.zeros((4, 4))
        self.in_plane[:2, 2:] = np.eye(2)
        self.in_plane[2, 0] = (5 * c**2 - 2) * n**2
        self.in_plane[2, 3], self.in_plane[3, 2] = 2 * n * c, -2 * n * c
        self.latitude_rate = n * c + 1.5 * n * oblate * cos(i) ** 2
        self.drift = 1.5 * n * oblate * sin(i) ** 2
        self._initial_latitude = orbit.argument_of_perigee_rad + orbit.true_anomaly_rad

    def transition(self, times_s: Array, duration_s: float) -> Array:
        """Return the matrices (K, 6, 6) over `duration_s` from each of the times (K,), s since the orbit's epoch."""
        from scipy.linalg import expm

        u = self._initial_latitude + self.latitude_rate * times_s
        F = np.zeros((len(u), 6, 6))
        F[:, _IN_PLANE[:, None], _IN_PLANE] = expm(self.in_plane * duration_s)
        across = self._planes(u + self.latitude_rate * duration_s)
        across = across @ np.array([[1.0, 0.0], [self.drift * duration_s, 1.0]]) @ np.linalg.inv(self._planes(u))
        F[:, _ACROSS[:, None], _ACROSS] = across
        return F

    def _planes(self, u: Array) -> Array:
        """Return z and z' over r (di, sin i dO), (K, 2, 2)."""
        q, s, c = self.latitude_rate, np.sin(u), np.cos(u)
        return np.moveaxis(np.array([[s, -c], [(q - self.drift) * c, q * s]]), -1, 0)
