"""Augmented states of a campaign's filters: what they are, where they start, and what they are in truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.dynamics.augmentation.extension import Extension, extension, sensor_of
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.run import FilterHistory
from relnav_sim.linalg import transpose
from relnav_sim.measurements.augmented import AugmentedMeasurement
from relnav_sim.measurements.interface import Measurement
from relnav_sim.results.block import AugmentedStates
from relnav_sim.sensors import ErrorShares, hosts_of, own_sensor, relative_sensors, sensor_measurement, streams_of
from relnav_sim.sensors.availability import sensed
from relnav_sim.sensors.interface import Craft, Form, RelativeSensorOptions
from relnav_sim.sensors.noise import is_white, noise_parts
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.host_orbits import believed_orbit
from relnav_sim.simulation.start import fix_sensor
from relnav_sim.statistics.augmented import AugmentedAccumulator
from relnav_sim.statistics.errors import ScoringRules
from relnav_sim.streams import RandomSource
from relnav_sim.truth import EphemerisTruthOptions, Truth
from relnav_sim.truth.trajectory import force_model


def extension_of(entry: FilterEntry, config: CaseConfig) -> Extension | None:
    """Return the augmented states of a filter, None where it has none."""
    if not entry.augmented_states:
        return None
    return extension(entry.augmented_states, relative_sensors(config.sensors, entry.sensors), config.clock.step_s)


def drawn_extension(config: CaseConfig, names: Sequence[str]) -> Extension | None:
    """Return the errors that each run draws of some sensors, as augmented states; None where there are none."""
    sensors = relative_sensors(config.sensors, names)
    options = [
        error.model_copy(update={"sensor": name}) for name, each in sensors.items() for error in each.drawn_errors()
    ]
    return extension(options, sensors, config.clock.step_s) if options else None


def augmented_measurement(
    extra: Extension, name: str, base: Measurement, config: CaseConfig, form: Form = "spherical"
) -> AugmentedMeasurement:
    """Return what a sensor measures of [x; b], from what it measures of x in one form."""
    shares = ErrorShares(extra.channels.get(name, {}), extra.turns.get(name, np.zeros((3, len(extra.names)))))
    return AugmentedMeasurement(base, 6, relative_sensors(config.sensors)[name].distortion(shares, form))


def extended_prior(prior: Gaussian, extra: Extension, config: CaseConfig) -> Gaussian:
    """Return the prior of [x; b] from that of x, mean (runs, 6 + e) and covariance (runs, 6 + e, 6 + e).

    b starts at 0 with its sigmas; `extended_by` says what a position has to do with it that is the first fix.
    """
    return extended_by(prior, extra, config, fix_sensor(config) if isinstance(config.start, FirstFixStart) else None)


def extended_by(prior: Gaussian, extra: Extension, config: CaseConfig, sensor: str | None, epoch: int = 0) -> Gaussian:
    """Return the prior of [x; b] from that of x, whose position is the fix of a sensor or of none.

    A fix holds its sensor's errors: z = h(r) + H_b b makes it wrong by J H_b b, J = (dh/dr)^-1, which is the opposite
    of the error in b = 0 that it goes with.
    """
    runs, n = prior.mean.shape
    P_b = np.diag(np.square(extra.sigma))
    mean = np.concatenate([prior.mean, np.zeros((runs, len(extra.names)))], axis=1)
    covariance = np.zeros((runs, n + len(P_b), n + len(P_b)))
    covariance[:, :n, :n] = prior.covariance
    covariance[:, n:, n:] = P_b
    if sensor is not None:
        base = sensor_measurement(sensor, config.sensors, believed_orbit(config), config.clock.step_s)
        H = augmented_measurement(extra, sensor, base, config).jacobian(mean, epoch)
        H = np.broadcast_to(H, (runs, *H.shape[-2:]))[:, :3]
        # Stacked solve: a run without a fix is NaN and stays so.
        moved = np.asarray(np.linalg.solve(H[:, :, :3], H[:, :, n:]), dtype=np.float64)
        covariance[:, :3, :3] += moved @ P_b @ transpose(moved)
        covariance[:, :3, n:] = -moved @ P_b
        covariance[:, n:, :3] = transpose(covariance[:, :3, n:])
    return Gaussian(mean, covariance)


class AugmentedTrack:
    """The augmented states of a filter on its way through a block."""

    def __init__(
        self, extra: Extension, entry: FilterEntry, config: CaseConfig, rules: ScoringRules, source: RandomSource
    ) -> None:
        self._extra, self._entry, self._config, self._source = extra, entry, config, source
        self._accumulator = AugmentedAccumulator(len(source.runs), rules, extra.names, extra.units)

    def add(self, chunk: Chunk, history: FilterHistory, failed: Integers) -> None:
        """Count the next chunk; `failed` are the first failed epochs (runs,), -1: none."""
        if chunk.errors_are_known:
            truth = true_augmented_states(self._entry, self._config, chunk.truth, self._source)
        else:
            truth = np.full(history.mean[..., 6:].shape, np.nan)
        variance = np.diagonal(history.covariance, axis1=-2, axis2=-1)
        self._accumulator.add(chunk.first_epoch, history.mean[..., 6:], truth, variance[..., 6:], failed)

    def result(self) -> AugmentedStates:
        """Return the results over everything counted."""
        return self._accumulator.result()


def true_augmented_states(entry: FilterEntry, config: CaseConfig, truth: Truth, source: RandomSource) -> Array:
    """Return the true values of a filter's augmented states at some epochs, (runs, K, e); NaN where they are not known.

    The errors of a sensor are those of its options and of each run, unless a correlated part of its noise drifts on top
    of them. The attitude has no correlated error while its sensors' noise is white. Drag is that of the force model at
    the true states, where neither craft's ballistic coefficient nor the density is dispersed; recorded orbits tell
    none. The accelerometers' biases are those of each run, unless their noise drifts.

    Args:
        entry: The filter.
        config: The case.
        truth: The true states.
        source: Seed and runs of the block.
    """
    shape = (len(source.runs), len(truth.times_s))
    sensors = relative_sensors(config.sensors, entry.sensors)
    values = []
    for option in entry.augmented_states:
        name = sensor_of(option, sensors)
        own = np.full((*shape, len(option.names)), np.nan)
        if name is not None and option.channels:
            places = [sensors[name].channel_names.index(channel) for channel in option.channels]
            own[...] = _slow_errors(name, sensors[name], config, truth, source)[..., places]
        elif name is not None:
            own[...] = 0.0 if _attitude_is_white(config, sensors[name].host) else np.nan
        elif option.kind == "differential_drag":
            own[...] = np.asarray(_differential_drag(config, truth))[..., None]
        elif option.kind == "accelerometer_bias":
            own[...] = _accelerometer_biases(config, source)[:, None]
        values.append(own)
    return np.concatenate(values, axis=-1)


def _slow_errors(
    name: str, options: RelativeSensorOptions, config: CaseConfig, truth: Truth, source: RandomSource
) -> Array:
    """Return the errors of a sensor's channels that are not white, (runs or 1, K, m)."""
    streams = streams_of(name, options, options.host, source, config.clock.step_s)
    return options.slow_errors(sensed(truth, options.host, config.clock.step_s), streams)


def _attitude_is_white(config: CaseConfig, host: Craft) -> bool:
    found = (own_sensor(config.sensors, "orbit", host), own_sensor(config.sensors, "attitude", host))
    return all(is_white(noise_parts(each[1].noise)) for each in found if each is not None)


def _accelerometer_biases(config: CaseConfig, source: RandomSource) -> Array:
    """Return the constant error of the measured relative thrust, deputy less chief, (runs, 3), m/s^2."""
    found = own_sensor(config.sensors, "force")
    if found is None or not is_white(noise_parts(found[1].noise)):
        return np.full((len(source.runs), 3), np.nan)
    name, options = found
    signs: dict[Craft, float] = {"deputy": 1.0, "chief": -1.0}
    each = [
        signs[craft] * options.bias(streams_of(name, options, craft, source, config.clock.step_s))
        for craft in hosts_of(config.sensors, options)
    ]
    return np.asarray(sum(each))


def _differential_drag(config: CaseConfig, truth: Truth) -> Array | float:
    """Return the along-track difference of the two craft's drag, (runs or 1, K), m/s^2."""
    options = config.truth
    if isinstance(options, EphemerisTruthOptions):
        return np.nan
    if options.forces.drag == "none":
        return 0.0
    dispersions = options.dispersions
    if any((dispersions.chief_ballistic, dispersions.deputy_ballistic, dispersions.density)):
        return np.nan
    force = force_model(options)

    def drag(states: Array, ballistic_m2_kg: float) -> Array:
        times = truth.times_s
        return force.acceleration(states, ballistic_m2_kg, times) - force.acceleration(states, 0.0, times)

    difference = drag(truth.deputy, options.deputy.ballistic_m2_kg) - drag(truth.chief, options.chief.ballistic_m2_kg)
    position, velocity = truth.chief[..., :3], truth.chief[..., 3:]
    along = np.cross(np.cross(position, velocity), position)
    return np.asarray((difference * along).sum(axis=-1) / np.linalg.norm(along, axis=-1))
