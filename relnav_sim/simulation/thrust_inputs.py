"""What the filters of a block are told about thrust: the plan, or what accelerometers measure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.campaign.entries import FilterEntry, KnownThrust
from relnav_sim.campaign.manoeuvres import default_thrust
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.dynamics.known_thrust import kicks_of
from relnav_sim.sensors import hosts_of, own_sensor
from relnav_sim.sensors.interface import Craft
from relnav_sim.sensors.noise import noise_parts, white_variance
from relnav_sim.truth import AnyTruth
from relnav_sim.truth.manoeuvres import ExecutionErrors
from relnav_sim.truth.thrust import CRAFT, Thrust, planned, step_forces

if TYPE_CHECKING:
    from relnav_sim.simulation.chunks import Chunk


CERTAIN_THRUST = 5.0
"""In sigmas of a measurement's noise and bias: a larger measurement is thrust, and its scale-factor error adds up."""


def known_thrust(entry: FilterEntry, config: CaseConfig) -> KnownThrust:
    """Return what a filter is told: what it asks for, else what is measured where anything is, else the plan."""
    known = entry.known_thrust or default_thrust(config.sensors)
    return "none" if known == "planned" and not config.truth.manoeuvres else known


class ThrustInputs:
    """Forces and their uncertainty for the filters of a block, a chunk of epochs at a time.

    Args:
        config: The case.
    """

    def __init__(self, config: CaseConfig) -> None:
        self._config = config
        self._step_s = config.clock.step_s
        self._force = own_sensor(config.sensors, "force")
        common = config.truth.execution_errors
        self._plan = [(planned(each), each.errors or common) for each in config.truth.manoeuvres.values()]
        self._gained: dict[str, Array] = {}
        self._latest: Chunk | None = None
        self._inputs: dict[tuple[KnownThrust, bool], tuple[Array, Array | None]] = {}

    def of(self, chunk: Chunk, known: KnownThrust, carries_bias: bool = False) -> tuple[Array, Array | None]:
        """Return forces and the covariance to add to Q, as `KnownThrust.take` wants them, shared by all filters.

        Args:
            chunk: The epochs.
            known: What the filter is told.
            carries_bias: Whether it has the accelerometer's bias among its states: the covariance is then without it.
        """
        if chunk is not self._latest:
            # Chunks come in order, and what a burn has gained so far is carried on: each is measured just once.
            self._latest = chunk
            forces, noise = self._planned(chunk.truth.times_s)
            self._inputs = dict.fromkeys((("planned", False), ("planned", True)), (forces, noise))
            if self._force is not None:
                forces, *noises = self._measured(chunk.z, forces)
                self._inputs |= {("measured", without): (forces, noises[without]) for without in (False, True)}
        return self._inputs[known, carries_bias]

    def _planned(self, times_s: Array) -> tuple[Array, Array | None]:
        noise = np.zeros((len(times_s), 6, 6))
        for thrust, errors in self._plan:
            if errors.any:
                own = step_forces(thrust, times_s, self._step_s)
                noise += planned_noise(thrust, errors, own, times_s, self._step_s)
        return planned_forces(self._config.truth, times_s, self._step_s), noise if noise.any() else None

    def _measured(self, z: Mapping[str, Array], plan: Array) -> tuple[Array, Array, Array]:
        """Return what is measured; the plan stands in for a craft without accelerometer and for missing measurements.

        Two covariances go with it: with the share of the constant bias, and without.
        """
        assert self._force is not None  # or this is not called
        _, options = self._force
        forces, missing = measured_forces(self._config, z, plan)
        runs = len(forces)
        noise = np.zeros((2, runs, plan.shape[1], 6, 6))
        random = options.velocity_random_walk_m_s_sqrt_s**2 * self._step_s * white_variance(noise_parts(options.noise))
        doubt = CERTAIN_THRUST * (np.sqrt(random) + options.bias_sigma_m_s2 * self._step_s)
        scale, bias = np.square([options.scale_factor_sigma_percent / 100, options.bias_sigma_m_s2])
        for craft, lost in missing.items():
            own = forces[:, :, CRAFT.index(craft)]
            before, after = kicks_of(own, self._step_s)
            taken = (own != 0).any(axis=(2, 3)) if options.deadband_m_s2 else np.ones(lost.shape, dtype=bool)
            variances = np.where((taken & ~lost)[..., None], random, 0.0)
            both = np.stack([variances, variances])
            if scale or bias:
                gains = before + after
                burning = taken if options.deadband_m_s2 else np.sqrt(np.square(gains).sum(axis=2)) > doubt
                gained = self._squares_gained(craft, gains, burning & ~lost)
                both = both + np.stack([gained @ [scale, bias], gained @ [scale, 0.0]])
            noise += _spread(both[..., None] * np.eye(3), np.full(lost.shape, self._step_s / 2))
        return forces, noise[0], noise[1]

    def _squares_gained(self, craft: str, gains: Array, burning: Mask) -> Array:
        """Return by how much the squares of velocity gained and time spent in a burn grow in each step.

        A constant scale-factor error s and a constant bias b put the velocity off by s V + b t after a gain V in t
        seconds, so its variance grows by s^2 (V_k^2 - V_{k-1}^2) + b^2 (t_k^2 - t_{k-1}^2): more than the sum over the
        steps one by one.

        Args:
            craft: Whose accelerometer it is.
            gains: Changes of velocity (runs, K, 3), m/s.
            burning: Steps that belong to a burn, (runs, K).

        Returns:
            (runs, K, 3, 2) in m^2/s^2 and s^2, per axis.
        """
        amounts = np.stack([np.abs(gains), np.full(gains.shape, self._step_s)], axis=-1)
        total = self._gained.get(craft, np.zeros((len(gains), 3, 2)))
        growth = np.zeros(amounts.shape)
        for k in range(gains.shape[1]):
            before = np.where(burning[:, k, None, None], total, 0.0)
            total = np.where(burning[:, k, None, None], before + amounts[:, k], 0.0)
            growth[:, k] = total * total - before * before
        self._gained[craft] = total
        return growth


def measured_forces(config: CaseConfig, z: Mapping[str, Array], plan: Array) -> tuple[Array, dict[Craft, Mask]]:
    """Return the specific force that is measured, (runs, K, 2, 2, 3), and by craft where nothing was, (runs, K).

    The plan stands in for a craft without accelerometer and for missing measurements.

    Args:
        config: The case, with an accelerometer.
        z: Measurements by sensor, that of each craft by its own name.
        plan: `planned_forces` of the same epochs.
    """
    runs = len(next(iter(z.values())))
    forces = np.repeat(plan, runs, axis=0)
    carried = own_sensor(config.sensors, "force")
    assert carried is not None  # as the caller has made sure
    name, options = carried
    missing = {}
    for craft in hosts_of(config.sensors, options):
        reading = z[f"{craft}_{name}"].reshape(runs, -1, 2, 3)
        missing[craft] = np.asarray(np.isnan(reading).any(axis=(2, 3)))
        own = forces[:, :, CRAFT.index(craft)]
        own[...] = np.where(missing[craft][..., None, None], own, reading)
    return forces, missing


def planned_forces(truth: AnyTruth, times_s: Array, step_s: float) -> Array:
    """Return the specific force that is planned in the steps that end at some epochs, as `KnownThrust.take` wants it.

    Args:
        truth: The truth with its manoeuvres.
        times_s: Epochs (K,), s.
        step_s: Time between epochs, s.

    Returns:
        (1, K, 2, 2, 3) m/s^2.
    """
    forces = np.zeros((1, len(times_s), len(CRAFT), 2, 3))
    for manoeuvre in truth.manoeuvres.values():
        thrust = planned(manoeuvre)
        forces[:, :, thrust.craft] += step_forces(thrust, times_s, step_s)
    return forces


def planned_noise(thrust: Thrust, errors: ExecutionErrors, forces: Array, times_s: Array, step_s: float) -> Array:
    """Return the covariance that a manoeuvre's execution errors add in each step, (K, 6, 6).

    The error of a burn is the same all through it, so the variance of the velocity grows with the square of the part
    that is over. A start at the wrong time by d shifts what follows by dv d: at once after an impulse; through an error
    of acceleration times d in the velocity, from its first step on, in a burn.

    Args:
        thrust: The manoeuvre as planned.
        errors: How badly it is carried out.
        forces: Its `step_forces`, (1, K, 2, 3).
        times_s: Epochs (K,), s.
        step_s: Time between epochs, s.
    """
    dv = thrust.delta_v[0]
    along = np.outer(dv, dv)
    across = (dv @ dv) * np.eye(3) - along
    shape = (errors.magnitude_sigma_percent / 100) ** 2 * along + np.radians(errors.direction_sigma_deg) ** 2 * across
    begun = times_s - thrust.start_s[0]
    if thrust.duration_s:
        over, earlier = (np.clip(passed / thrust.duration_s, 0.0, 1.0) for passed in (begun, begun - step_s))
    else:
        over, earlier = (begun >= 0).astype(float), (begun >= step_s).astype(float)
    share = over**2 - earlier**2
    before, after = kicks_of(forces[0], step_s)
    total = (before + after) @ dv
    left_s = step_s * np.divide(before @ dv, total, out=np.zeros(len(times_s)), where=total > 0)
    noise = _spread(share[:, None, None] * shape, left_s)
    first = ((over > 0) & (earlier == 0))[:, None, None] * errors.timing_sigma_s**2
    if thrust.duration_s:
        noise[:, 3:, 3:] += first * along / thrust.duration_s**2
    else:
        noise[:, :3, :3] += first * along
    return noise


def _spread(velocity: Array, left_s: Array) -> Array:
    """Return the covariance (..., 6, 6) of a change of velocity with covariance (..., 3, 3) `left_s` before the end."""
    left = left_s[..., None, None]
    return np.concatenate(
        [
            np.concatenate([left * left * velocity, left * velocity], axis=-1),
            np.concatenate([left * velocity, velocity], axis=-1),
        ],
        axis=-2,
    )
