"""Options of learned dynamics: what is learned, from which flight, and with what variance."""

from __future__ import annotations

from functools import partial
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from relnav_sim.arrays import Indices
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.field_extent import FieldExtent
from relnav_sim.dynamics.averaged_j2 import SchweighartSedwickOptions
from relnav_sim.dynamics.clohessy_wiltshire import CwOptions, cw_system
from relnav_sim.dynamics.context import DynamicsContext, Need, TrainingRequest, TrainingTrack
from relnav_sim.dynamics.elliptic import YamanakaAnkersenOptions
from relnav_sim.dynamics.gp.dynamics import GpDynamics, Target, Variance, phase_clock
from relnav_sim.dynamics.gp.regression import RegressionOptions
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.dynamics.process_noise import process_noise_matrix
from relnav_sim.dynamics.quadratic import CwSecondOrderOptions
from relnav_sim.dynamics.registry import register_dynamics
from relnav_sim.dynamics.two_body import NonlinearOptions
from relnav_sim.dynamics.two_body_j2 import NonlinearJ2Options
from relnav_sim.options import AddedLater

BaseOptions = (
    CwOptions
    | CwSecondOrderOptions
    | YamanakaAnkersenOptions
    | SchweighartSedwickOptions
    | NonlinearOptions
    | NonlinearJ2Options
)


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
        description="What is learned: residual (the residual dynamics of the base: an error of a micrometre a step), "
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
        "there: smoothed_radar (the track that the first sensor that gives a position by itself, a radar say, with "
        "random numbers of its own, and a smoother give; the smoother has the base dynamics and the filter's "
        "`process_noise`) or truth (the error-free states, as the paper: no flight filter can have them, and reports "
        "call it leakage)",
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
    regression: Annotated[RegressionOptions | None, AddedLater()] = Field(
        default=None,
        description="How the process is fitted, where that is to be otherwise than predicts best: number of processes, "
        "kernel, units, calibration; default: one process for all outputs, a length scale for every input",
    )

    @model_validator(mode="after")
    def _base_has_a_use(self) -> GpOptions:
        if self.base is not None and self.target != "residual":
            raise ValueError(f"base is for the residual target; the {self.target} target learns without one")
        return self

    @model_validator(mode="after")
    def _regression_fits(self) -> GpOptions:
        if self.regression is None:
            return self
        if self.variance == "inducing" and self.regression.processes == "one_per_output":
            raise ValueError("variance: inducing is that of processes: shared; take exact or cloud_mean")
        if self.calibration_span_s is not None and not self.regression.calibrated:
            raise ValueError("calibration_span_s has no use with calibrated: false; leave it out")
        return self

    @property
    def uses_process_noise(self) -> bool:
        """Whether the filter's own process noise is added: the learned variance takes its place otherwise."""
        return self.add_process_noise

    @property
    def cost_factor(self) -> float:
        """As many as there are processes: nearly all of a filter's cost is theirs."""
        separate = self.regression is not None and self.regression.processes == "one_per_output"
        return 6.0 if separate else 1.0

    @property
    def believed_field(self) -> FieldExtent | None:
        """That of the base dynamics."""
        return None if self.base is None else self.base.believed_field

    def training_request(self, orbit: ChiefOrbit) -> TrainingRequest:
        """Return the track of both spans."""
        return TrainingRequest(sum(self._spans_s(orbit)), self.training, self.base or CwOptions())

    def build(self, context: DynamicsContext) -> GpDynamics:
        """Return the dynamics learned from the training track.

        Its last `training_span_s` are learned; those before calibrate the variance.
        """
        return context.learn(partial(self._fitted, context))

    def _fitted(self, context: DynamicsContext, track: TrainingTrack) -> GpDynamics:
        from relnav_sim.dynamics.gp.fit import Transitions, fit_gp_dynamics  # only then: it loads scikit-learn

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
            regression=None if self.regression is None else self.regression.model_dump(),
        )

    def _spans_s(self, orbit: ChiefOrbit) -> tuple[float, float]:
        """Return how long the flights are that calibrate and that are learned, in this order."""
        learned = self.training_span_s or 2 * np.pi / orbit.mean_motion_rad_s
        if self.regression is not None and not self.regression.calibrated:
            return 0.0, learned
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
