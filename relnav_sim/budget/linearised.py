"""A filter and its sensors along the nominal truth, to first order: its own F, H and K, and what errors do to it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.budget.injection import SIZE, Asked, Injection, injecting
from relnav_sim.budget.predictions import ChiefAlong, ChiefErrors, ThrustAlong
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, DispersedStart
from relnav_sim.dynamics.context import FedDynamics
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.kalman import GaussianFilter
from relnav_sim.filters.readings import Readings
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.measurements.interface import linearised
from relnav_sim.measurements.partial import sensors_of
from relnav_sim.simulation.augmented_states import extended_prior
from relnav_sim.simulation.campaign_filter import CampaignFilter, create_campaign_filter, sensor_forms
from relnav_sim.simulation.chunks import Chunk, chunks, told
from relnav_sim.simulation.dynamics_inputs import arrival, dynamics_context
from relnav_sim.simulation.learned import Learned
from relnav_sim.simulation.start import starting_belief
from relnav_sim.simulation.thrust_inputs import ThrustInputs, known_thrust, measured_forces, planned_forces
from relnav_sim.streams import RandomSource
from relnav_sim.truth import nominal_truth

CHIEF = range(6)
"""The error of the chief's orbit: position and velocity, ECI."""


@dataclass(frozen=True)
class LinearFilter:
    """The error of a filter's estimate along the nominal truth, to first order.

    With e the estimate less the nominal state, augmented states counted from 0, and unit numbers s that sensors draw,
    e_k = A_k (F_k e_{k-1} - d_k) + G_k s_k, A the product of the I - K H of the epoch's updates. Where the filter
    estimates the chief's orbit by itself, that estimate's error stands behind the filter's own n states: N = n + 6.

    Attributes:
        times_s: Epochs (T,), s; at the first there is the start alone.
        transition: A F, (T, N, N); of the first epoch I.
        kept: A, (T, N, N); of the first epoch I.
        left_out: d, what the filter's prediction from the true state lacks, (T, N).
        response: G, (T, N, J), columns as the injections; of the first epoch what the start has of them.
        offset: What the start's mean has of the truth when nothing errs, (N,); zero where it is drawn about the truth.
        formal: The filter's own covariance, (T, n, n).
        read: Whether each sensor reads at an epoch, by its name, (T,).
        follows_chief: Whether the error of the chief's orbit, as the filter estimates it, is in it.
    """

    times_s: Array
    transition: Array
    kept: Array
    left_out: Array
    response: Array
    offset: Array
    formal: Array
    read: Mapping[str, Mask] = field(default_factory=dict)
    follows_chief: bool = False


def asked_numbers(config: CaseConfig) -> Asked:
    """Return the numbers that the sensors of a case draw beside the noise of their channels."""
    asked = Asked()
    next(iter(_nominal_chunks(config, [], asked)))
    return asked


def linear_filter(config: CaseConfig, entry: FilterEntry, seed: int, injections: Sequence[Injection]) -> LinearFilter:
    """Return a filter to first order along the nominal truth of a case.

    Nothing is derived by hand: the sensors read with one error at a time, the front end makes of that what filters
    take, and the filter's own update says what it does with it.

    Args:
        config: The case.
        entry: The filter, one with a nominal gain.
        seed: The campaign's seed, for dynamics that are learned.
        injections: The errors.

    Raises:
        ValueError: The filter fails on the nominal truth, or there is nothing to start from.
    """
    along: _Along | None = None
    for chunk in _nominal_chunks(config, injections):
        along = along or _Along(config, entry, seed, len(injections), chunk)
        along.add(chunk)
    assert along is not None  # there is a chunk at least
    return along.result()


def _nominal_chunks(config: CaseConfig, injections: Sequence[Injection], asked: Asked | None = None) -> Iterator[Chunk]:
    nominal = config.model_copy(update={"truth": nominal_truth(config.truth)})
    return chunks(nominal, RandomSource(0, tuple(range(1 + len(injections)))), injecting(injections, asked))


@dataclass(frozen=True)
class _Steps:
    """Steps and updates of K epochs, as they are noted one by one; zeros where nothing acts or nothing is read.

    Attributes:
        F: Transitions, (K, n, n).
        B: What the error of the chief's orbit does to the predictions, (K, n, 6).
        told: What the injections do to the predictions, (K, n, J).
        K: Gains of the S sensors, (S, K, n, m).
        H: (S, K, m, n).
        C: What the injections do to the residuals, (S, K, m, J).
    """

    F: Array
    B: Array
    told: Array
    K: Array
    H: Array
    C: Array

    @classmethod
    def of_nothing(cls, epochs: int, sensors: int, n: int, m: int, injections: int) -> _Steps:
        """Return steps that are still to be noted."""
        shapes = (n, n), (n, len(CHIEF)), (n, injections)
        by_sensor = (n, m), (m, n), (m, injections)
        steps = [np.zeros((epochs, *shape)) for shape in shapes]
        return cls(*steps, *(np.zeros((sensors, epochs, *shape)) for shape in by_sensor))

    def updated(self) -> tuple[Array, Array]:
        """Return A (K, n, n) and G (K, n, J) of `LinearFilter`: the sensors' updates one after the other."""
        A: Array = np.broadcast_to(np.eye(self.F.shape[1]), self.F.shape)
        G = self.told
        for gain, H, C in zip(self.K, self.H, self.C, strict=True):
            kept = np.eye(self.F.shape[1]) - gain @ H
            A, G = kept @ A, kept @ G + gain @ C
        return A, G


class _Along:
    """A filter on its way along the nominal truth."""

    def __init__(self, config: CaseConfig, entry: FilterEntry, seed: int, count: int, first: Chunk) -> None:
        self._config, self._entry, self._count = config, entry, count
        self._forms = sensor_forms(entry, config)
        self._step_s = config.clock.step_s
        self._context = dynamics_context(entry, config, seed, Learned(), 1)
        self._made: CampaignFilter = create_campaign_filter(entry, config, self._context, first.late)
        assert isinstance(self._made.algorithm, GaussianFilter)  # as those with a nominal gain are
        self._own: GaussianFilter = self._made.algorithm
        # The gain is read off small differences of measurements, which float32 would round away.
        self._filter = _in_double(self._own, entry)
        self._measurement = self._filter.measurement
        self._channels = np.eye(self._measurement.dimension)
        self._thrust_inputs = ThrustInputs(config)
        self._carries_bias = any(extra.kind == "accelerometer_bias" for extra in entry.augment)
        self._chief_along = ChiefAlong(self._made.dynamics)
        self._chief: ChiefErrors | None = None
        self._thrust_along: ThrustAlong | None = None
        if known_thrust(entry, config) == "measured":
            self._thrust_along = ThrustAlong(self._context.orbit, self._step_s)
        n, T = self._filter.dynamics.dimension, config.clock.epochs
        self._n, N = n, n + len(CHIEF)
        self._times, self._formal = np.empty(T), np.empty((T, n, n))
        self._transition, self._kept = np.zeros((T, N, N)), np.zeros((T, N, N))
        self._left_out, self._response = np.zeros((T, N)), np.zeros((T, N, count))
        self._read = {sensor.name: np.zeros(T, dtype=bool) for sensor in sensors_of(self._measurement)}
        self._source = RandomSource(0, (0,))
        self._start(first)

    def _start(self, first: Chunk) -> None:
        config, n = self._config, self._n
        if isinstance(config.start, DispersedStart):  # drawn about the truth, whatever is read
            sigma = np.array([*config.start.position_sigma_m, *config.start.velocity_sigma_m_s])
            prior = Gaussian(first.truth.relative[:1, 0], np.diag(sigma**2)[None])
        else:
            prior = starting_belief(config, first, RandomSource(0, tuple(range(1 + self._count))))
            self._response[0, :6] = (prior.mean[1:] - prior.mean[:1]).T / SIZE
            prior = Gaussian(prior.mean[:1], prior.covariance[:1])
        if not np.isfinite(prior.mean).all():
            raise ValueError("no measurement at 0 s that gives a position, where the start is the first fix")
        self._offset = np.zeros(self._transition.shape[1])
        self._offset[:6] = prior.mean[0] - first.truth.relative[0, 0]
        if self._made.extension is not None:
            prior = extended_prior(prior, self._made.extension, config)
        self._P = prior.covariance
        self._before = np.zeros((1, n))

    def add(self, chunk: Chunk) -> None:
        """Go on through the next chunk of epochs."""
        alone = _run(chunk, 0)
        forces = None
        if self._made.thrust is not None:
            known = known_thrust(self._entry, self._config)
            forces, noise = self._thrust_inputs.of(alone, known, self._carries_bias)
            self._made.thrust.take(forces, chunk.first_epoch, noise)
        if self._thrust_along is not None:
            plan = planned_forces(self._config.truth, chunk.truth.times_s, self._step_s)
            every, _ = measured_forces(self._config, chunk.z, plan)
            self._thrust_along.take(every, chunk.first_epoch)
        if (arrived := arrival(self._entry, self._context, alone, forces)) is not None:
            if arrived.chief_fixes is not None and self._context.chief_fixes is not None:
                fixes = chunk.z[self._context.chief_fixes.sensor]
                errors = (fixes[1:] - fixes[:1]).transpose(1, 2, 0) / SIZE
                self._chief = self._chief_along.errors(arrived, errors)
            cast(FedDynamics, self._made.dynamics).feed(arrived)
        truth = np.zeros((len(chunk.truth.times_s), self._n))
        truth[:, :6] = chunk.truth.relative[0]
        self._times[chunk.first_epoch :][: len(truth)] = chunk.truth.times_s
        z = told(chunk, self._forms, self._config)
        skipped = 1 if chunk.first_epoch == 0 else 0
        if skipped:
            self._transition[0] = self._kept[0] = np.eye(len(self._offset))
            self._formal[0], self._before = self._P[0], truth[:1]
            if self._chief is not None:
                self._response[0, self._n :] = self._chief.response[0]
        # Behind the runs with one error each, a perfect one for each channel, to ask the filter for its gain.
        m = self._measurement.dimension
        rows = {name: np.concatenate([one, np.repeat(one[:1], m, axis=0)])[:, skipped:] for name, one in z.items()}
        first = chunk.first_epoch + skipped
        readings = Readings(self._measurement, self._as_given(rows), first)
        steps = _Steps.of_nothing(len(truth) - skipped, len(readings.sensors), self._n, m, self._count)
        with np.errstate(all="ignore"), readings:
            for k, state in enumerate(truth[skipped:]):
                self._step(steps, readings, k, Step(first + k, self._step_s), state[None])
            self._note(steps, slice(first, first + len(steps.F)))

    def _as_given(self, z: dict[str, Array]) -> dict[str, Array]:
        return {sensor.name: z[sensor.name] for sensor in sensors_of(self._measurement)}

    def _step(self, steps: _Steps, readings: Readings, k: int, step: Step, state: Array) -> None:
        """Predict from the true state before and update at the true state now."""
        epoch, before, dynamics = step.epoch, self._before, self._filter.dynamics
        readings.begin(k)
        steps.F[k] = dynamics.transition(before, step)
        # Augmented states have no truth here: they count from 0.
        self._left_out[epoch, :6] = (state - dynamics.propagate(before, step))[0, :6]
        prior = self._filter.start(Gaussian(before, self._P), self._source)
        P = self._filter.predict(prior, step).covariance
        if self._thrust_along is not None:
            steps.told[k, :6] = self._thrust_along.effect(before[0, :6], steps.F[k, :6, :6], step)
        if self._chief is not None:
            steps.B[k, :6] = self._chief.effect(before[0, :6], step)
        for place, one in enumerate(readings.sensors):
            if one.read[0, k]:
                found = self._update(readings.attend(place, k), state, P, step)
                steps.K[place, k], steps.H[place, k], steps.C[place, k], P = found
                self._read[one.sensor.name][epoch] = True
        self._formal[epoch] = P[0]
        self._before, self._P = state, P

    def _note(self, steps: _Steps, epochs: slice) -> None:
        """Put steps together to what `LinearFilter` has of their epochs."""
        own, chief = slice(0, self._n), slice(self._n, None)
        A, G = steps.updated()
        self._transition[epochs, own, own], self._kept[epochs, own, own] = A @ steps.F, A
        self._response[epochs, own] = G
        self._kept[epochs, chief, chief] = np.eye(len(CHIEF))
        if self._chief is not None:
            places = slice(epochs.start - self._chief.first_epoch, None)
            self._transition[epochs, own, chief] = A @ steps.B
            self._transition[epochs, chief, chief] = self._chief.transition[places]
            self._response[epochs, chief] = self._chief.response[places]

    def _update(self, z: Array, state: Array, P: Array, step: Step) -> tuple[Array, Array, Array, Array]:
        """Return K (n, m), H (m, n), what the injections do to the residual (m, J), and P after the update."""
        filter, measurement, epoch = self._filter, self._measurement, step.epoch
        errors = 1 + self._count
        mean = state.repeat(len(z), axis=0)
        residual, H, R = linearised(measurement, z, mean, epoch)
        C = (residual[1:errors] - residual[0]).T / SIZE
        # The mean is linear in the measurement, so any size will do; that of the noise keeps the digits.
        probe = np.sqrt((R if R.ndim == 2 else R[0]).diagonal())
        probed = z.copy()
        probed[errors:] += self._channels * probe
        gaussian = Gaussian(mean, P.repeat(len(z), axis=0))
        prior = filter.start(gaussian, self._source)
        posterior, innovation = filter.correct(prior, probed, step)
        if self._own is not filter:
            _, innovation = self._own.correct(self._own.start(gaussian, self._source), z, step)
        if innovation.failed:  # runs would end here: what arithmetic loses depends on P, not on what is read
            reason = innovation.failed[min(innovation.failed)]
            raise ValueError(f"it fails on the nominal truth at {self._times[epoch]:g} s: {reason}")
        posterior = filter.keep_considered(prior, posterior)
        gain = (posterior.mean[errors:] - posterior.mean[0]).T / probe
        return gain, H if H.ndim == 2 else H[0], C, posterior.covariance[:1]

    def result(self) -> LinearFilter:
        """Return what was found.

        Raises:
            ValueError: A matrix is not finite.
        """
        states = slice(0, self._n + len(CHIEF) * (self._chief is not None))
        found = LinearFilter(
            self._times,
            np.ascontiguousarray(self._transition[:, states, states]),
            self._kept[:, states, states],
            self._left_out[:, states],
            self._response[:, states],
            self._offset[states],
            self._formal,
            self._read,
            self._chief is not None,
        )
        wrong = ~np.isfinite(self._transition).all(axis=(1, 2)) | ~np.isfinite(self._response).all(axis=(1, 2))
        wrong |= ~np.isfinite(self._left_out).all(axis=1) | ~np.isfinite(self._formal).all(axis=(1, 2))
        if wrong.any():
            time_s = self._times[np.argmax(wrong)]
            raise ValueError(f"its gain, its transition or what a sensor's error does is not finite at {time_s:g} s")
        return found


def in_single(entry: FilterEntry) -> bool:
    """Return whether a filter computes in float32."""
    return getattr(entry, "arithmetic", "float64") == "float32"


def _in_double(filter: GaussianFilter, entry: FilterEntry) -> GaussianFilter:
    """Return a filter with the same models in float64."""
    if not in_single(entry):
        return filter
    in_double = entry.model_copy(update={"arithmetic": "float64"})
    made = filter_kinds()[entry.kind].factory(filter.dynamics, filter.measurement, in_double)
    assert isinstance(made, GaussianFilter)  # as it was
    return made


def _run(chunk: Chunk, run: int) -> Chunk:
    """Return a chunk with one run only."""
    return replace(
        chunk,
        z={name: values[run : run + 1] for name, values in chunk.z.items()},
        inputs={
            name: {form: values[run : run + 1] for form, values in forms.items()}
            for name, forms in chunk.inputs.items()
        },
    )
