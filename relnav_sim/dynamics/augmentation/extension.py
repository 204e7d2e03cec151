"""A filter's augmented states together: what they are at the start, how they move, and what they act on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics
from relnav_sim.dynamics.augmentation.kinds import AugmentedStateOptions
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.correlated_acceleration import CorrelatedAcceleration
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.dynamics.known_thrust import KnownThrust
from relnav_sim.dynamics.process_noise import ACTS_ON_VELOCITY, van_loan


@dataclass(frozen=True)
class Extension:
    """What a filter believes of its e augmented states: with mean 0 at the start, and independent then.

    Attributes:
        names: Their names.
        units: Their SI units.
        sigma: Standard deviations at the start, (e,).
        decay: D in b_k = D b_{k-1} + u over one step, (e, e).
        noise: Covariance of u, (e, e).
        considered: Numbers of those that are accounted for but not estimated.
        channels: What they add to the channels of sensors: by sensor and channel, (e,).
        turns: The turn of the host's body that each is, by sensor, about the LVLH frame's axes, (3, e), rad.
        acceleration: Their share in the relative acceleration, held over a step, RTN, (3, e).
        correlated: By their number, those that are accelerations which vary within a step.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    sigma: Array
    decay: Array
    noise: Array
    considered: tuple[int, ...]
    channels: Mapping[str, Mapping[str, Array]]
    turns: Mapping[str, Array]
    acceleration: Array
    correlated: Mapping[int, CorrelatedAcceleration] = field(default_factory=dict)

    def dynamics(
        self, base: Dynamics, orbit: ChiefOrbit, step_s: float, thrust: KnownThrust | None = None
    ) -> AugmentedDynamics:
        """Return the dynamics of [x; b]; an acceleration acts as on a circular orbit over one step.

        Args:
            base: How x moves.
            orbit: The chief's nominal orbit.
            step_s: Time between epochs, s.
            thrust: What is told of forces: an accelerometer's bias acts in steps with a force; None: in all.
        """
        inputs: Array | Callable[[Step], Array] | None = None
        within: Array | None = None
        if self.acceleration.any() or self.correlated:
            G = held_acceleration(orbit.mean_motion_rad_s, step_s) @ self.acceleration
            if self.correlated:
                within = self._correlate(G, cw_system(orbit.mean_motion_rad_s), step_s)
            measured = np.array([name.startswith("accelerometer_bias") for name in self.names])
            inputs = G
            if measured.any() and thrust is not None:
                inputs = _WhilePushed(thrust, G, measured)
        return AugmentedDynamics(base, self.decay, self.noise, inputs, self.considered, within)

    def _correlate(self, G: Array, A: Array, step_s: float) -> Array:
        """Put the columns of the correlated accelerations into G (6, e); return their noise in a step, (6, 6 + e)."""
        within = np.zeros((6, 6 + len(self.names)))
        for place, acceleration in self.correlated.items():
            end, Q = acceleration.over_step(A, step_s)
            G[:, place] = end[:6]
            within[:, :6] += Q[:6, :6]
            within[:, 6 + place] = Q[:6, 6]
        return within


class SeenBy(Protocol):
    """What augmented states need to know of a sensor: its channels, and the craft that carries it."""

    @property
    def host(self) -> str | None:
        """The craft that carries it."""
        ...

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels."""
        ...

    def needs_direction(self) -> tuple[bool, ...]:
        """Return for each channel whether a turn of the host changes it."""
        ...


def extension(options: Sequence[AugmentedStateOptions], sensors: Mapping[str, SeenBy], step_s: float) -> Extension:
    """Return the augmented states of a filter.

    Args:
        options: The kinds, in order.
        sensors: The sensors that the filter goes by.
        step_s: Time between epochs, s.

    Raises:
        ValueError: A state is the error of a sensor that is not there, or that has no such channel.
    """
    from scipy.linalg import block_diag

    motions = [option.motion(step_s) for option in options]
    modes = [option.mode for option in options for _ in option.names]
    return Extension(
        names=tuple(name for option in options for name in _named(option)),
        units=tuple(unit for option in options for unit in option.units),
        sigma=np.concatenate([option.sigmas for option in options]),
        decay=block_diag(*(D for D, _ in motions)),
        noise=block_diag(*(Q for _, Q in motions)),
        considered=tuple(place for place, mode in enumerate(modes) if mode == "consider"),
        channels=_added(options, sensors, len(modes)),
        turns=_turned(options, sensors, len(modes)),
        acceleration=np.concatenate([option.acceleration() for option in options], axis=1),
        correlated=_correlated(options),
    )


def _correlated(options: Sequence[AugmentedStateOptions]) -> dict[int, CorrelatedAcceleration]:
    """Return the accelerations that vary within a step, by the number of their state."""
    found: dict[int, CorrelatedAcceleration] = {}
    first = 0
    for option in options:
        found |= dict(enumerate(option.correlated, start=first))
        first += len(option.names)
    return found


def _named(option: AugmentedStateOptions) -> tuple[str, ...]:
    """Return the names of the states of one kind, with the sensor's before them where the option names one."""
    return option.names if option.sensor is None else tuple(f"{option.sensor}_{name}" for name in option.names)


def sensor_of(option: AugmentedStateOptions, sensors: Mapping[str, SeenBy]) -> str | None:
    """Return the name of the sensor whose error an augmented state is; None where it is no error of a sensor.

    Raises:
        ValueError: The sensor is not there, or has no such channel.
    """
    if not option.channels and not option.turn().any():
        if option.sensor is not None:
            raise ValueError(f"{option.kind} is no error of a sensor; leave the key sensor out")
        return None
    having = [
        name
        for name, each in sensors.items()
        if set(option.channels) <= set(each.channel_names) and (option.channels or any(each.needs_direction()))
    ]
    if option.sensor is None and having:
        return having[0]
    if option.sensor in having:
        return option.sensor
    if option.sensor is not None and option.sensor not in sensors:
        raise ValueError(f"the filter has no sensor {option.sensor}; it goes by {', '.join(sensors)}")
    which = f"no sensor of this filter ({', '.join(sensors)})" if option.sensor is None else option.sensor
    lacking = f"the channel {' and '.join(option.channels)}" if option.channels else "a channel that a turn changes"
    raise ValueError(f"{which} has {'not ' if option.sensor else ''}{lacking}")


def _added(
    options: Sequence[AugmentedStateOptions], sensors: Mapping[str, SeenBy], e: int
) -> dict[str, dict[str, Array]]:
    """Return what e states add to the channels of sensors."""
    added: dict[str, dict[str, Array]] = {name: {} for name in sensors}
    first = 0
    for option in options:
        name = sensor_of(option, sensors)
        for place, channel in enumerate(option.channels, start=first):
            if name is not None:
                added[name].setdefault(channel, np.zeros(e))[place] += 1.0
        first += len(option.names)
    return added


def _turned(options: Sequence[AugmentedStateOptions], sensors: Mapping[str, SeenBy], e: int) -> dict[str, Array]:
    """Return the turns of the sensors' hosts; a turn holds for all sensors on the same craft."""
    turns = {name: np.zeros((3, e)) for name in sensors}
    first = 0
    for option in options:
        name = sensor_of(option, sensors) if option.turn().any() else None
        for other, each in sensors.items():
            if name is not None and each.host == sensors[name].host:
                turns[other][:, first : first + len(option.names)] += option.turn()
        first += len(option.names)
    return turns


@dataclass(frozen=True)
class _WhilePushed:
    """G (6, e) step by step, the measured columns (e,) zero in runs without a force.

    No closure: dynamics that are copied, to go back over what they were fed before, take their thrust along.
    """

    thrust: KnownThrust
    G: Array
    measured: Mask

    def __call__(self, step: Step) -> Array:
        """Return that of one step, (runs or 1, 6, e)."""
        idle = self.measured & ~self.thrust.pushed(step)[:, None]
        return np.where(idle[:, None], 0.0, self.G)


def held_acceleration(mean_motion_rad_s: float, step_s: float) -> Array:
    """Return what an acceleration held over one step does to the state at its end, RTN, (6, 3)."""
    system = np.zeros((9, 9))
    system[:6, :6] = cw_system(mean_motion_rad_s)
    system[:6, 6:] = ACTS_ON_VELOCITY
    F, _ = van_loan(system, np.zeros((9, 1)), np.zeros((1, 1)), step_s)
    return np.array(F[:6, 6:])
