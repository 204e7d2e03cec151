"""Learned relative dynamics: a Gaussian process for one step, alone or on top of other dynamics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sin, sqrt
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.gp.process import GaussianProcess
from relnav_sim.dynamics.gp.separate import SeparateProcesses
from relnav_sim.dynamics.interface import Dynamics, LinearDynamics, Step

Target = Literal["absolute", "difference", "residual"]
Variance = Literal["exact", "cloud_mean", "inducing"]
# What the learned part is added to: dynamics, the state itself, or nothing.
Base = Dynamics | Literal["state"] | None


class GpDynamics:
    """Dynamics learned by a Gaussian process: mean f(x) = base(x) + GP mean, noise Q(x) = GP variance.

    The variances of the states are c_j^2 times the process's; correlations between them are not learned. Both the mean
    and the variance are those of the training step: the duration of a `Step` is not looked at.

    Args:
        process: Maps the state, and sin and cos of twice the phase where there is one, to the target; one for all
            states, or one for each.
        base: What the target is added to: dynamics, ``"state"`` for the state itself, or None for nothing.
        calibration: c, factors on the standard deviations, (n,).
        variance: ``exact`` (at every state), ``cloud_mean`` (once a run, at the mean of its states) or ``inducing`` (at
            every state, from the training points of `uncertainty` alone).
        uncertainty: The process that gives the variance when it is ``inducing``.
        added_noise: Covariance added to Q, (n, n).
        phase: The argument of latitude by epoch, where it is an input.
    """

    linear = False
    leaves_arguments_alone = True

    def __init__(
        self,
        process: GaussianProcess | SeparateProcesses,
        base: Base,
        calibration: Array,
        variance: Variance = "exact",
        uncertainty: GaussianProcess | SeparateProcesses | None = None,
        added_noise: Array | None = None,
        phase: Callable[[int], float] | None = None,
    ) -> None:
        self.process = process
        self.calibration = calibration
        self.dimension = len(calibration)
        self._base = base
        self._variance = variance
        self._uncertainty = uncertainty
        self._added = np.zeros((self.dimension, self.dimension)) if added_noise is None else added_noise
        self._phase = phase
        self._known: tuple[GaussianProcess | SeparateProcesses, int, Array, Array] | None = None

    def propagate(self, states: Array, step: Step) -> Array:
        """Return the mean of the next state for states (runs, ..., n)."""
        learned = self._recalled(states, step)
        if learned is None:
            learned = self.process.predict(self._inputs(states, step)).reshape(states.shape)
        if self._base is None:
            return learned
        return learned + (states if self._base == "state" else self._base.propagate(states, step))

    def transition(self, mean: Array, step: Step) -> Array:
        """Return the Jacobian (runs, n, n) of `propagate` at `mean` (runs, n)."""
        slopes = self.process.jacobian(self._inputs(mean, step)[:, 0])[..., : self.dimension]
        if self._base is None:
            return slopes
        return slopes + (np.eye(self.dimension) if self._base == "state" else self._base.transition(mean, step))

    def process_noise(self, states: Array, step: Step) -> Array:
        """Return Q at states (runs, ..., n): (runs, ..., n, n), or (runs, n, n) with variance ``cloud_mean``."""
        if self._variance == "cloud_mean":
            states = states.reshape(len(states), -1, self.dimension).mean(axis=1)
        inputs = self._inputs(states, step)
        if self._variance == "exact":
            # A particle filter asks for the mean at the same states next: the costly kernel values serve both.
            mean, variance = self.process.predict_with_variance(inputs)
            self._known = (self.process, step.epoch, states.copy(), mean.reshape(states.shape))
        else:
            variance = (self._uncertainty or self.process).variance(inputs)
        scale = np.square(self.calibration * self.process.output_scale)
        Q: Array = variance.reshape(*states.shape[:-1], -1)[..., None] * np.diag(scale)
        Q += self._added
        return Q

    def _recalled(self, states: Array, step: Step) -> Array | None:
        if self._known is None:
            return None
        process, epoch, known, mean = self._known
        return mean if process is self.process and epoch == step.epoch and np.array_equal(known, states) else None

    def _inputs(self, states: Array, step: Step) -> Array:
        """Return the process's inputs (runs, N, d) for states (runs, ..., n)."""
        points = states.reshape(len(states), -1, self.dimension)
        return points if self._phase is None else with_phase(points, self._phase(step.epoch))


def with_phase(states: Array, phase_rad: Array | float) -> Array:
    """Return states (..., n) with sin 2 u and cos 2 u appended, (..., n + 2).

    Differential J2 is a function of twice the argument of latitude.
    """
    double = np.broadcast_to(2 * np.asarray(phase_rad), states.shape[:-1])
    return np.concatenate([states, np.sin(double)[..., None], np.cos(double)[..., None]], axis=-1)


def straight_line(dimension: int, step_s: float) -> LinearDynamics:
    """Return motion at constant velocity, the state being positions and then as many velocities.

    Raises:
        ValueError: The number of states is odd.
    """
    if dimension % 2:
        raise ValueError(f"the residual target of {dimension} states needs base dynamics")
    F = np.eye(dimension) + step_s * np.eye(dimension, k=dimension // 2)
    return LinearDynamics(F, np.zeros((dimension, dimension)))


@dataclass(frozen=True)
class PhaseClock:
    """The chief's argument of latitude, in rad, where the step towards an epoch begins: initial + rate (epoch - 1)."""

    initial_rad: float
    rate_rad: float

    def __call__(self, epoch: int) -> float:
        """Return the angle at which the step towards `epoch` begins."""
        return self.initial_rad + self.rate_rad * (epoch - 1)


def phase_clock(orbit: ChiefOrbit, step_s: float) -> PhaseClock:
    """Return the mean argument of latitude of the nominal orbit with J2's secular rates; epoch 0 is the orbit's own.

    Vallado, Fundamentals of Astrodynamics, 4th ed., section 9.6. Good to 0.1 rad a day, the nominal elements being
    osculating ones.
    """
    e, sine = orbit.eccentricity, sin(orbit.inclination_rad)
    parameter = orbit.semi_major_axis_m * (1 - e**2)
    drift = 1.5 * orbit.j2 * (orbit.equatorial_radius_m / parameter) ** 2
    perigee, anomaly = 2 - 2.5 * sine**2, sqrt(1 - e**2) * (1 - 1.5 * sine**2)
    rate = orbit.mean_motion_rad_s * (1 + drift * (perigee + anomaly))
    return PhaseClock(orbit.argument_of_perigee_rad + orbit.true_anomaly_rad, rate * step_s)
