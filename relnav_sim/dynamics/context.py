"""What dynamics are built from, and what they are fed during a run: all that a filter may know of a campaign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, TypeVar, get_args

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.epoch import Epoch
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.dynamics.process_noise import ProcessNoiseOptions

if TYPE_CHECKING:
    from relnav_sim.dynamics.options import DynamicsOptions

T = TypeVar("T")

Need = Literal["chief_fixes", "known_thrust", "training_track", "epoch"]
"""What dynamics may need beyond the nominal orbit, the step and the process noise.

- ``chief_fixes``: the chief's own GNSS fixes. `DynamicsContext.chief_fixes` says how good they are, `feed` brings them;
  the dynamics can be put about given states of the chief by `with_chief`.
- ``known_thrust``: the forces on both craft as the filter is told of them; `feed` brings them. Their effect on the
  relative state is added round the dynamics by relnav, needed or not.
- ``training_track``: earlier motion of the two craft to learn from, by `DynamicsContext.learn`.
- ``epoch``: the calendar time of epoch 0, `DynamicsContext.epoch`; a campaign without one is refused.
"""
NEEDS: tuple[Need, ...] = get_args(Need)


class Timed(Protocol):
    """Something whose cost is charged to every filter that uses it."""

    @property
    def cpu_s(self) -> float:
        """CPU time spent on it so far, s."""
        ...


Shared = TypeVar("Shared", bound=Timed)


class Share(Protocol):
    """Gives what several dynamics use together."""

    def __call__(self, name: str, make: Callable[[], Shared]) -> Shared:
        """Return what `make` returns; it is called once for each name."""
        ...


class Learn(Protocol):
    """Gives what is learned from the training track."""

    def __call__(self, fit: Callable[[TrainingTrack], T]) -> T:
        """Return what `fit` makes of the track; it is called once, whatever the number of runs and filters."""
        ...


@dataclass(frozen=True)
class ChiefFixes:
    """The chief's GNSS fixes that will be fed.

    Attributes:
        sigmas: Standard deviations of a fix as the filter is told of them, ECI position and velocity, (6,), m and m/s.
        runs: Number of runs.
        sensor: Name of the receiver.
    """

    sigmas: Array
    runs: int
    sensor: str = "gnss"


@dataclass(frozen=True)
class TrainingTrack:
    """A piece of the relative motion, step by step, to learn from.

    Args:
        states: (S, 6), RTN m and m/s, one step apart.
        time_s: Their times after the campaign's start, (S,); negative before it.
        orbit: The chief's nominal orbit at epoch 0 of the flight that they are from.
        first_epoch: Epoch of the first of them.
    """

    states: Array
    time_s: Array
    orbit: ChiefOrbit
    first_epoch: int = 0

    def expected(self, base: DynamicsOptions, noise: ProcessNoiseOptions, step_s: float) -> Array:
        """Return what base dynamics make of each state but the last, (S - 1, 6)."""
        dynamics = base.build(DynamicsContext(self.orbit, noise, step_s))
        after = self.first_epoch + 1
        steps = [
            dynamics.propagate(state[None], Step(epoch, step_s)) for epoch, state in enumerate(self.states[:-1], after)
        ]
        return np.concatenate(steps)


@dataclass(frozen=True)
class TrainingRequest:
    """The track that dynamics ask for: the flight of the nominal pair that ends where the campaign starts.

    Attributes:
        duration_s: Its length, s; rounded up to whole steps.
        source: ``truth`` (the error-free states, which no flight filter can have) or ``smoothed_radar`` (those of a
            Kalman filter on the measurements of the first sensor that gives a position by itself, smoothed).
        base: The dynamics that this filter believes in.
    """

    duration_s: float
    source: Literal["smoothed_radar", "truth"]
    base: DynamicsOptions


def _apart(name: str, make: Callable[[], Shared]) -> Shared:
    return make()


def _no_track(fit: Callable[[TrainingTrack], T]) -> T:
    raise ValueError("there is no training track to learn from; options that need one say training_track in `needs`")


@dataclass(frozen=True)
class DynamicsContext:
    """What `DynamicsOptions.build` gets: what a filter knows before flight, and what the options declare in `needs`.

    Attributes:
        orbit: The chief's nominal orbit, which passes its true anomaly at epoch 0, and the body's constants.
        process_noise: The filter's process noise; `process_noise_matrix` gives Q.
        step_s: Time between epochs, s.
        chief_fixes: What `feed` will bring of the chief's GNSS; None: nothing (it is not needed, the receiver is on the
            deputy, or there is none), so that the nominal orbit must do.
        share: ``share(name, make)``: something that is computed once for all dynamics of a block that have the same
            options and are told of the same thrust, an estimate of the chief's orbit say; each filter is charged its
            `cpu_s`.
        learn: ``learn(fit)``: what `fit` makes of the training track, computed once for all blocks and filters with
            the same options and process noise; only with the need ``training_track``.
        epoch: Calendar time of epoch 0; None where it is not known.
    """

    orbit: ChiefOrbit
    process_noise: ProcessNoiseOptions
    step_s: float
    chief_fixes: ChiefFixes | None = None
    share: Share = _apart
    learn: Learn = _no_track
    epoch: Epoch | None = None


@dataclass(frozen=True)
class Arrival:
    """What is known at the next K epochs, fed before they are filtered; chunks come in order, from epoch 0.

    Attributes:
        first_epoch: Number of the first of the epochs.
        chief_fixes: The chief's GNSS fixes, (runs, K, 6), ECI, m and m/s, NaN = none; None where there are none at all
            or the need is not declared.
        forces: Specific force on chief and deputy in the steps that end there, (runs or 1, K, 2, 2, 3), m/s^2, RTN axes
            of each craft: the mean over the step, and the mean weighted with the time that is left (see
            `KnownThrust.take`); None where the filter is told of none or the need is not declared.
    """

    first_epoch: int
    chief_fixes: Array | None = None
    forces: Array | None = None


class FedDynamics(Dynamics, Protocol):
    """Dynamics whose options need what arrives during a run: ``chief_fixes`` or ``known_thrust``."""

    def feed(self, arrival: Arrival) -> None:
        """Take what is known at the next epochs."""
        ...


class ChiefDynamics(FedDynamics, Protocol):
    """Dynamics whose options need ``chief_fixes``."""

    def with_chief(self, chief: Array, first_epoch: int) -> Dynamics:
        """Return the same dynamics about known states of the chief.

        Args:
            chief: ECI, (runs, K, 6), m and m/s. The step to epoch k takes that of k - 1.
            first_epoch: Epoch of the first of them.
        """
        ...


class ChiefInFirstOrder(ChiefDynamics, Protocol):
    """Dynamics that estimate the chief's orbit from its fixes and say how that depends on them: for error budgets.

    Nothing obliges dynamics with the need ``chief_fixes`` to. Without it budgets name this error as not covered.
    """

    def linearised_chief(self, arrival: Arrival) -> tuple[Array, Array, Array] | None:
        """Return what the estimates at the epochs that arrive next will be and how they depend on each other.

        Nothing is taken: `feed` comes after it. To first order error_k = A_k error_{k-1} + G_k (error of fix k).

        Returns:
            For one run the estimates (K, 6), ECI, A (K, 6, 6) and G (K, 6, 6); None where fixes are not looked at.
        """
        ...


METHODS = ("propagate", "transition", "process_noise")
PROMISED: dict[Need, tuple[str, ...]] = {"chief_fixes": ("feed", "with_chief"), "known_thrust": ("feed",)}
"""The methods beyond `METHODS` that dynamics have whose options need this."""
