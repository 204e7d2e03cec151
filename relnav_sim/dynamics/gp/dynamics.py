"""Learned relative dynamics: a Gaussian process for one step, alone or on top of other dynamics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import sin, sqrt
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from relnav_sim.arrays import Array, Indices
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.dynamics.averaged_j2 import SchweighartSedwickOptions
from relnav_sim.dynamics.clohessy_wiltshire import CwOptions, cw_system
from relnav_sim.dynamics.context import DynamicsContext, Need, TrainingRequest, TrainingTrack
from relnav_sim.dynamics.elliptic import YamanakaAnkersenOptions
from relnav_sim.dynamics.gp.process import GaussianProcess
from relnav_sim.dynamics.interface import Dynamics, LinearDynamics, Step
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix
from relnav_sim.dynamics.quadratic import CwSecondOrderOptions
from relnav_sim.dynamics.registry import register_dynamics
from relnav_sim.dynamics.two_body import NonlinearOptions
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options

Target = Literal["absolute", "difference", "residual"]
Variance = Literal["exact", "cloud_mean", "inducing"]
BaseOptions = (
    CwOptions
    | CwSecondOrderOptions
    | YamanakaAnkersenOptions
    | SchweighartSedwickOptions
    | NonlinearOptions
    | NonlinearJ2Options
)
# What the learned part is added to: dynamics, the state itself, or nothing.
Base = Dynamics | Literal["state"] | None


class GpDynamics:
    """Dynamics learned by a Gaussian process: mean f(x) = base(x) + GP mean, noise Q(x) = GP variance.

    The variances of the states are c_j^2 times the process's; correlations between them are not learned. Both the mean
    and the variance are those of the training step: the duration of a `Step` is not looked at.

    Args:
        process: Maps the state, and sin and cos of twice the phase where there is one, to the target.
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
        process: GaussianProcess,
        base: Base,
        calibration: Array,
        variance: Variance = "exact",
        uncertainty: GaussianProcess | None = None,
        added_noise: Array | None = None,
        phase: Callable[[int], float] | None = None,
    ) -> None:
        self.process = process
        self.calibration = calibration
        self.dimension = len(calibration)
        self._base = base
        self._variance = variance
        self._uncertainty = uncertainty or process
        self._scale = np.square(calibration * process.kernel.output_scale)
        self._added = np.zeros((self.dimension, self.dimension)) if added_noise is None else added_noise
        self._phase = phase
        self._known: tuple[Array, int, Array] | None = None

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
            self._known = (states.copy(), step.epoch, mean.reshape(states.shape))
        else:
            variance = self._uncertainty.variance(inputs)
        Q: Array = variance.reshape(states.shape[:-1])[..., None, None] * np.diag(self._scale)
        Q += self._added
        return Q

    def _recalled(self, states: Array, step: Step) -> Array | None:
        if self._known is None or self._known[1] != step.epoch or not np.array_equal(self._known[0], states):
            return None
        return self._known[2]

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


@register_dynamics("gp")
class GpOptions(DynamicsOptions):
    """Learned dynamics: a Gaussian process for one step of the relative motion (Wei, Song and Zhang 2012).

    Whoever runs the campaign makes the training track; a process trained on the truth knows what no flight filter
    can know before flight.
    """

    needs: ClassVar[frozenset[Need]] = frozenset({"training_track"})

    kind: Literal["gp"] = Field(default="gp", description="Dynamics learned by Gaussian-process regression")
    target: Target = Field(
        default="residual",
        description="What is learned: residual (what the base dynamics leave over: an error of a micrometre a step), "
        "difference (next state less this one: centimetres) or absolute (the next state, as the paper does: half a "
        "metre and more)",
    )
    base: Annotated[BaseOptions, Field(discriminator="kind")] | None = Field(
        default=None,
        description="Dynamics that the residual is taken from, any that are not learned; default: Clohessy-Wiltshire. "
        "Those that need the chief's orbit go by the nominal one",
    )
    training: Literal["smoothed_radar", "truth"] = Field(
        default="smoothed_radar",
        description="Where training states come from, the nominal flight before the campaign's start, which ends "
        "there: smoothed_radar (the track that the radar, with random numbers of its own, and a smoother give; the "
        "smoother has the base dynamics and the filter's `process_noise`) or truth (the error-free states, as the "
        "paper: no flight filter can have them, and reports call it leakage)",
    )
    training_points: int = Field(
        default=500, ge=50, le=5000, description="Training points S; default 500, as the paper; fitting costs S^3"
    )
    selection: Literal["random", "consecutive"] = Field(
        default="random",
        description="Which steps of the training span are learned: random (spread over all of it, half the error) or "
        "consecutive (its first S)",
    )
    training_span_s: float | None = Field(
        default=None,
        gt=0,
        description="Length of the flight that is learned, s; it ends where the campaign starts; default: one "
        "revolution of the chief",
    )
    calibration_span_s: float | None = Field(
        default=None,
        ge=0,
        description="Length of the flight before it, s, that is not learned but calibrates the variance: as far from "
        "what is learned as the campaign is; default: as long as training_span_s; 0: the last fifth of the training "
        "points does it, which leaves the filter two to twenty times too sure of absolute and difference targets",
    )
    argument_of_latitude: bool = Field(
        default=False,
        description="Take sine and cosine of twice the chief's argument of latitude as inputs: what differential J2 "
        "depends on, so that the process holds on other relative orbits; default: states alone, as the paper",
    )
    variance: Variance = Field(
        default="exact",
        description="Where the process's variance is taken: exact (at every particle: nearly all of the cost), "
        "cloud_mean (once a run, at the mean of its particles) or inducing (at every particle, from few points)",
    )
    inducing_points: int = Field(
        default=100, ge=5, description="Training points that the inducing variance uses, the most informative ones"
    )
    add_process_noise: bool = Field(
        default=False,
        description="Add the filter's process_noise to the process's variance; default: the variance alone, as the "
        "paper",
    )
    restarts: int = Field(
        default=2, ge=0, le=100, description="Further starts of the maximisation of the marginal likelihood"
    )

    @model_validator(mode="after")
    def _base_has_a_use(self) -> GpOptions:
        if self.base is not None and self.target != "residual":
            raise ValueError(f"base is for the residual target; the {self.target} target learns without one")
        return self

    @property
    def uses_process_noise(self) -> bool:
        """Whether the filter's own process noise is added: the learned variance takes its place otherwise."""
        return self.add_process_noise

    def training_request(self, orbit: ChiefOrbit) -> TrainingRequest:
        """Return the track of both spans."""
        return TrainingRequest(sum(self._spans_s(orbit)), self.training, self.base or CwOptions())

    def build(self, context: DynamicsContext) -> GpDynamics:
        """Return the dynamics learned from the training track.

        Its last `training_span_s` are learned; those before calibrate the variance.
        """
        return context.learn(partial(self._fitted, context))

    def _fitted(self, context: DynamicsContext, track: TrainingTrack) -> GpDynamics:
        from relnav_sim.dynamics.gp.fit import Transitions, fit_gp_dynamics  # which needs GpDynamics from here

        orbit, noise, step_s = context.orbit, context.process_noise, context.step_s
        clock = phase_clock(orbit, step_s) if self.argument_of_latitude else None

        base = (self.base or CwOptions()) if self.target == "residual" else None
        expected = None if base is None else track.expected(base, noise, step_s)

        def transitions(rows: Indices) -> Transitions:
            phase = None if clock is None else clock.initial_rad + clock.rate_rad * track.time_s[rows] / step_s
            return Transitions(
                track.states[rows], track.states[rows + 1], phase, None if expected is None else expected[rows]
            )

        learned, earlier = self._split(track, orbit)
        training = transitions(learned)
        added = process_noise_matrix(noise, cw_system(orbit.mean_motion_rad_s), step_s)
        return fit_gp_dynamics(
            training.now,
            training.next,
            step_s,
            None if base is None else base.build(DynamicsContext(orbit, noise, step_s)),
            self.target,
            variance=self.variance,
            inducing_points=self.inducing_points,
            phase_rad=training.phase_rad,
            phase=clock,
            expected=training.expected,
            held_out=transitions(earlier) if len(earlier) >= 10 else None,
            added_noise=added if self.add_process_noise else None,
            restarts=self.restarts,
        )

    def _spans_s(self, orbit: ChiefOrbit) -> tuple[float, float]:
        """Return how long the flights are that calibrate and that are learned, in this order."""
        learned = self.training_span_s or 2 * np.pi / orbit.mean_motion_rad_s
        return learned if self.calibration_span_s is None else self.calibration_span_s, learned

    def _split(self, track: TrainingTrack, orbit: ChiefOrbit) -> tuple[Indices, Indices]:
        """Return the rows to learn from and the rows before them; the row after a row is its next state."""
        _, span_s = self._spans_s(orbit)
        rows = np.arange(len(track.states) - 1)
        is_learned = track.time_s[1:] > track.time_s[-1] - span_s
        within = rows[is_learned]
        count = min(self.training_points, len(within))
        if self.selection == "random":
            learned = np.sort(np.random.default_rng(0).choice(within, count, replace=False))
        else:
            learned = within[:count]
        return learned, rows[~is_learned]
