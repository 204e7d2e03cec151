"""What a craft has read of itself between two epochs, carried on to the next one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.sensors import known_orbits, own_sensor
from relnav_sim.sensors.campaign_sensors import reading_names
from relnav_sim.simulation.host_orbits import believed_gravity
from relnav_sim.truth import nominal_chief

_LONGEST_STEP_S = 10.0


class ReplayError(ValueError):
    """Recorded measurements can't be replayed with a campaign; the message is one sentence that names the remedy."""


def at_epochs(name: str, z: Mapping[str, Array], late_s: Array, config: CaseConfig) -> Array:
    """Return what a craft reads of itself at the epochs, (runs, T, m), from measurements up to a step before them.

    A fix, or an orbit that is known, goes on in the gravity that the craft believe in. A body keeps its attitude in the
    LVLH frame, which turns with the orbit: about the normal, at the rate of the host's orbit at the epoch.

    Args:
        name: The measurement's name.
        z: All measurements of craft of themselves by name, as they were read, at the epochs that they count at.
        late_s: By how much earlier those of this name were taken, (runs, T), s.
        config: The case.

    Raises:
        ReplayError: It is an accelerometer's, a mean over the step that ends at the epoch.
    """
    names = reading_names(config.sensors)
    if name not in names:
        return _fallen(z[name], late_s, config)
    sensor, host = names[name]
    role = config.sensors[sensor].role
    if role == "orbit":
        return _fallen(z[name], late_s, config)
    if role == "attitude":
        receiver = own_sensor(config.sensors, "orbit", host)
        orbit = receiver[0] if receiver is not None else known_orbits(config.sensors).get(host)
        rate = np.full(late_s.shape, nominal_chief(config.truth).mean_motion_rad_s)
        if orbit is not None:
            position, velocity = z[orbit][..., :3], z[orbit][..., 3:]
            own = np.linalg.norm(np.cross(position, velocity), axis=-1) / np.square(position).sum(axis=-1)
            rate = np.where(np.isfinite(own), own, rate)
        return _turned(z[name], rate * late_s)
    raise ReplayError(
        f"measurements of {name} lie between the epochs, and each is a mean over the step that ends at one; choose a "
        "clock.step_s that their times are multiples of"
    )


def _fallen(states: Array, late_s: Array, config: CaseConfig) -> Array:
    """Return states (runs, T, 6), ECI, by the times (runs, T), s, later, in free fall.

    By classical Runge-Kutta steps of at most 10 s, in which the error is 1e-5 m in a low orbit.
    """
    gravity = believed_gravity(config)

    def rates(at: Array) -> Array:
        return np.concatenate([at[:, 3:], gravity.acceleration(at[:, :3])], axis=1)

    chosen = late_s > 0
    x, left_s = states[chosen], late_s[chosen][:, None]
    parts = int(np.ceil(left_s.max() / _LONGEST_STEP_S))
    h = left_s / parts
    for _ in range(parts):
        k1 = rates(x)
        k2 = rates(x + h / 2 * k1)
        k3 = rates(x + h / 2 * k2)
        k4 = rates(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    fallen = states.copy()
    fallen[chosen] = x
    return fallen


def _turned(attitudes: Array, angle: Array) -> Array:
    """Return attitudes (runs, T, 4) of bodies that have turned on about the orbit normal by angles (runs, T), rad.

    The normal is minus y of the body. C(q) of `astro.attitude` becomes C(d) C(q), whose quaternion is
    d_w q_v + q_w d_v - d_v x q_v, d_w q_w - d_v . q_v (Markley and Crassidis 2014, eq. 2.82).
    """
    s, c = -np.sin(angle / 2), np.cos(angle / 2)
    x, y, z, w = np.moveaxis(attitudes, -1, 0)
    return np.stack([c * x - s * z, c * y + s * w, c * z + s * x, c * w - s * y], axis=-1)
