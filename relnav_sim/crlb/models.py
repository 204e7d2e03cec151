"""The models of the motion that a bound is computed for: transitions and process noise along the truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.containment import Containment
from relnav_sim.dynamics.about_chief import AboutChiefDynamics
from relnav_sim.dynamics.augmentation.extension import Extension
from relnav_sim.dynamics.chief_segments import NominalChief
from relnav_sim.dynamics.context import ChiefDynamics
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.dynamics.motion import ZonalMotion
from relnav_sim.simulation.campaign_filter import create_campaign_filter
from relnav_sim.simulation.dynamics_inputs import dynamics_context
from relnav_sim.simulation.learned import Learned
from relnav_sim.truth import highest_zonal, nominal_chief


class Model:
    """A model of the motion, along the truth.

    Args:
        make: Makes the motion of the six states.
        config: The case.
        extra: The states behind them; None: there are none.
        about_chief: Whether the motion is that about the chief's true orbit, which `with_chief` puts in; else it has an
            orbit of its own.

    Attributes:
        broken: The exception that it raised; None: none.
    """

    def __init__(
        self,
        make: Callable[[], Dynamics],
        config: CaseConfig,
        extra: Extension | None = None,
        about_chief: bool = False,
    ) -> None:
        self.broken: BaseException | None = None
        self.extra = extra
        self.dimension = 6 if extra is None else 6 + len(extra.names)
        self._config = config
        self._about_chief = about_chief
        self._dynamics: Dynamics | None = None
        with Containment() as contained:  # it may run a filter of the user's own; the other bounds go on
            self._dynamics = make()
        if contained.error is not None:
            self.broken = contained.error.with_traceback(None)

    def has_states_of(self, other: Model) -> bool:
        """Return whether both have the same augmented states, seen alike by the sensors, known alike at first."""
        a, b = self.extra, other.extra
        if a is None or b is None:
            return a is b
        return (
            a.names == b.names
            and np.array_equal(a.sigma, b.sigma)
            and _same(a.channels, b.channels)
            and _same(a.turns, b.turns)
        )

    def at(self, epochs: Integers, chief: Array, states: Array) -> tuple[Array, Array]:
        """Return F and Q of the steps that end at `epochs` (K,), (K, n, n) each; NaN and 0 once it is broken.

        Args:
            epochs: (K,).
            chief: ECI states of the chief one step before, (K, 6).
            states: Relative states one step before, RTN, (K, 6).
        """
        if self._dynamics is not None and not self.broken:
            with Containment() as contained:  # as above
                step_s = self._config.clock.step_s
                if self._about_chief:
                    steps = _steps_about(cast(ChiefDynamics, self._dynamics), step_s, chief, states)
                else:
                    steps = _steps(self._dynamics, step_s, epochs, states)
                return self._extended(*_finite(*steps, states))
            if contained.error is not None:
                self.broken = contained.error.with_traceback(None)
        shape = (len(epochs), self.dimension, self.dimension)
        return np.full(shape, np.nan), np.zeros(shape)

    def _extended(self, F: Array, Q: Array) -> tuple[Array, Array]:
        """Return the matrices (K, 6, 6) with the part of the augmented states."""
        if self.extra is None:
            return F, Q
        step_s = self._config.clock.step_s
        whole = self.extra.dynamics(_Given(F, Q), nominal_chief(self._config.truth), step_s)
        states, step = np.zeros((len(F), self.dimension)), Step(0, step_s)
        return whole.transition(states, step), whole.process_noise(states, step)


def _same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Return whether two trees of arrays are equal."""
    if one.keys() != other.keys():
        return False
    return all(
        _same(value, other[key]) if isinstance(value, Mapping) else np.array_equal(value, other[key])
        for key, value in one.items()
    )


class _Given:
    """Dynamics of six states whose matrices are known, one for each row of states."""

    dimension = 6
    linear = True

    def __init__(self, transitions: Array, noises: Array) -> None:
        self._transitions, self._noises = transitions, noises

    def propagate(self, states: Array, step: Step) -> Array:
        """Return F x."""
        return np.einsum("kij,kj->ki", self._transitions, states)

    def transition(self, mean: Array, step: Step) -> Array:
        """Return F, (K, 6, 6)."""
        return self._transitions

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q, (K, 6, 6)."""
        return self._noises


def _steps_about(dynamics: ChiefDynamics, step_s: float, chief: Array, states: Array) -> tuple[Array, Array]:
    """Return F and Q of the six states about the chief's states (K, 6), (K, 6, 6) each.

    The epochs take the place of runs, each with a chief of its own.
    """
    step = Step(1, step_s)
    F = dynamics.with_chief(chief[:, None], first_epoch=0).transition(states, step)
    Q = dynamics.process_noise(states, step)
    return np.broadcast_to(F, (len(states), 6, 6)), np.broadcast_to(Q, (len(states), 6, 6))


def _steps(dynamics: Dynamics, step_s: float, epochs: Integers, states: Array) -> tuple[Array, Array]:
    """Return F and Q of the six states, (K, 6, 6) each."""
    pairs = []
    for epoch, state in zip(epochs, states[:, None], strict=True):
        step = Step(int(epoch), step_s)
        F, Q = dynamics.transition(state, step), dynamics.process_noise(state, step)
        pairs.append((np.reshape(F, (6, 6)), np.reshape(Q, (6, 6))))
    return np.stack([F for F, _ in pairs]), np.stack([Q for _, Q in pairs])


def _finite(F: Array, Q: Array, states: Array) -> tuple[Array, Array]:
    """Return F and Q (K, 6, 6), NaN and 0 where there are no states (K, 6) any more.

    Raises:
        ValueError: One is not finite at a state that is.
    """
    lost = np.any(~np.isfinite(F + Q), axis=(1, 2), keepdims=True)
    if (lost[:, 0, 0] & np.isfinite(states).all(axis=1)).any():
        raise ValueError("its transition or process noise is not finite")
    return np.where(lost, np.nan, F), np.where(lost, 0.0, Q)


def believed_dynamics(names: Sequence[str], config: CaseConfig, seed: int, learned: Learned) -> Dynamics:
    """Return the motion that some filters believe in, from the first of them that can be made."""

    def of(name: str) -> Dynamics:
        entry = config.filters[name]
        return create_campaign_filter(entry, config, dynamics_context(entry, config, seed, learned)).dynamics

    for name in names[:-1]:
        with Containment():
            return of(name)
    return of(names[-1])


def perfect_dynamics(config: CaseConfig) -> Dynamics:
    """Return the motion as it is, but for drag: the truth's point mass and zonal harmonics, no process noise."""
    orbit = nominal_chief(config.truth).up_to(highest_zonal(config.truth))
    motion = ZonalMotion(orbit, config.clock.step_s)
    return AboutChiefDynamics(motion, np.zeros((6, 6)), NominalChief(orbit, config.clock.step_s, motion))


def model_key(entry: FilterEntry) -> str:
    """Return what tells the model of a filter apart: most filters of a campaign share theirs."""
    if "training_track" in entry.dynamics.needs:  # what is learned depends on the filter's measurements too
        return entry.model_dump_json()
    return entry.model_dump_json(include={"dynamics", "process_noise", "augment", "sensors"})
