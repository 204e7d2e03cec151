"""Extra states of a campaign's filters: what they are, where they start, and what they are in truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig, FirstFixStart
from relnav_sim.dynamics.augmentation.kinds import AccelerometerBiasOptions, Extension, extension
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.run import FilterHistory
from relnav_sim.linalg import transpose
from relnav_sim.results.block import AugmentedStates
from relnav_sim.sensors.accelerometer import Craft, constant_bias
from relnav_sim.sensors.noise import BiasNoise, GaussMarkovNoise, NoisePart, noise_parts
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.start import radar_model
from relnav_sim.statistics.augmented import AugmentedAccumulator
from relnav_sim.statistics.errors import ScoringRules
from relnav_sim.streams import RandomSource
from relnav_sim.truth import Truth
from relnav_sim.truth.trajectory import force_model

Array = NDArray[np.float64]


def mounting_of(config: CaseConfig) -> Array:
    """Return the rotation (3, 3) from the nadir frame of the radar's carrier to the radar frame."""
    assert config.sensors.radar is not None, "the campaign's checks ask for a radar"
    return config.sensors.radar.mounting


def extension_of(entry: FilterEntry, config: CaseConfig) -> Extension | None:
    """Return the extra states of a filter, None where it has none."""
    if not entry.augment:
        return None
    return extension(entry.augment, mounting_of(config), config.clock.step_s)


def extended_prior(prior: Gaussian, extra: Extension, config: CaseConfig) -> Gaussian:
    """Return the prior of [x; b] from that of x, mean (runs, 6 + e) and covariance (runs, 6 + e, 6 + e).

    b starts at 0 with its sigmas. A position that is the first fix holds the radar's errors: z = h(r) + H_b b makes it
    wrong by J H_b b, J = (dh/dr)^-1, which is the opposite of the error in b = 0 that it goes with.
    """
    runs, n = prior.mean.shape
    P_b = np.diag(np.square(extra.sigma))
    mean = np.concatenate([prior.mean, np.zeros((runs, len(extra.names)))], axis=1)
    covariance = np.zeros((runs, n + len(P_b), n + len(P_b)))
    covariance[:, :n, :n] = prior.covariance
    covariance[:, n:, n:] = P_b
    radar = radar_model(config)
    if isinstance(config.start, FirstFixStart) and radar is not None:
        H = extra.measurement(radar, mounting_of(config)).jacobian(mean, 0)
        # Stacked solve: a run without a fix is NaN and stays so.
        moved = np.asarray(np.linalg.solve(H[:, :, :3], H[:, :, n:]), dtype=np.float64)
        covariance[:, :3, :3] += moved @ P_b @ transpose(moved)
        covariance[:, :3, n:] = -moved @ P_b
        covariance[:, n:, :3] = transpose(covariance[:, :3, n:])
    return Gaussian(mean, covariance)


class ExtraTrack:
    """The extra states of a filter on its way through a block."""

    def __init__(self, extra: Extension, config: CaseConfig, rules: ScoringRules, source: RandomSource) -> None:
        self._extra, self._config, self._source = extra, config, source
        self._accumulator = AugmentedAccumulator(len(source.runs), rules, extra.names, extra.units)

    def add(self, chunk: Chunk, history: FilterHistory, failed: NDArray[np.int64]) -> None:
        """Count the next chunk; `failed` are the first failed epochs (runs,), -1: none."""
        truth = true_extra(self._extra, self._config, chunk.truth, self._source)
        variance = np.diagonal(history.covariance, axis1=-2, axis2=-1)
        self._accumulator.add(chunk.first_epoch, history.mean[..., 6:], truth, variance[..., 6:], failed)

    def result(self) -> AugmentedStates:
        """Return the results over everything counted."""
        return self._accumulator.result()


def true_extra(extra: Extension, config: CaseConfig, truth: Truth, source: RandomSource) -> Array:
    """Return the true values of extra states at some epochs, (runs, K, e); NaN where they are not known.

    The radar's biases are those of its options, unless a correlated part of its noise drifts on top of them. The
    attitude has no correlated error while its sensors' noise is white. Drag is that of the force model at the true
    states, where neither craft's ballistic coefficient nor the density is dispersed. The accelerometers' biases are
    those of each run, unless their noise drifts.

    Args:
        extra: The states.
        config: The case.
        truth: The true states.
        source: Seed and runs of the block.
    """
    values = np.full((len(source.runs), len(truth.times_s), len(extra.names)), np.nan)
    biases = dict(zip(("range_bias", "azimuth_bias", "elevation_bias"), _radar_biases(config), strict=True))
    measured = dict(zip(AccelerometerBiasOptions.names, _accelerometer_biases(config, source), strict=True))
    for place, name in enumerate(extra.names):
        if name in biases:
            values[..., place] = biases[name]
        elif name in measured:
            values[..., place] = measured[name][:, None]
        elif name.startswith("attitude_error"):
            sensors = (config.sensors.gnss, config.sensors.star_tracker)
            white = all(_is_white(noise_parts(sensor.noise)) for sensor in sensors if sensor is not None)
            values[..., place] = 0.0 if white else np.nan
        elif name == "differential_drag":
            values[..., place] = _differential_drag(config, truth)
    return values


def _radar_biases(config: CaseConfig) -> Array:
    """Return the constant errors of range (m), azimuth and elevation (rad), (3,); NaN where they drift."""
    radar = config.sensors.radar
    if radar is None:
        return np.full(3, np.nan)
    parts = noise_parts(radar.noise)
    if any(isinstance(part, GaussMarkovNoise) for part in parts):
        return np.full(3, np.nan)
    constant = sum((np.broadcast_to(part.value, 3) for part in parts if isinstance(part, BiasNoise)), np.zeros(3))
    return radar.biases + constant * radar.sigmas


def _accelerometer_biases(config: CaseConfig, source: RandomSource) -> Array:
    """Return the constant error of the measured relative thrust, deputy less chief, (3, runs), m/s^2."""
    options = config.sensors.accelerometer
    if options is None or not _is_white(noise_parts(options.noise)):
        return np.full((3, len(source.runs)), np.nan)
    signs: dict[Craft, float] = {"deputy": 1.0, "chief": -1.0}
    return np.asarray(sum(signs[craft] * constant_bias(options, craft, source)[:, 0] for craft in options.craft)).T


def _is_white(parts: tuple[NoisePart, ...]) -> bool:
    return not any(isinstance(part, GaussMarkovNoise | BiasNoise) for part in parts)


def _differential_drag(config: CaseConfig, truth: Truth) -> Array | float:
    """Return the along-track difference of the two craft's drag, (runs or 1, K), m/s^2."""
    options = config.truth
    if options.forces.drag == "none":
        return 0.0
    dispersions = options.dispersions
    if any((dispersions.chief_ballistic, dispersions.deputy_ballistic, dispersions.density)):
        return np.nan
    force = force_model(options)

    def drag(states: Array, ballistic_m2_kg: float) -> Array:
        return force.acceleration(states, ballistic_m2_kg) - force.acceleration(states)

    difference = drag(truth.deputy, options.deputy.ballistic_m2_kg) - drag(truth.chief, options.chief.ballistic_m2_kg)
    position, velocity = truth.chief[..., :3], truth.chief[..., 3:]
    along = np.cross(np.cross(position, velocity), position)
    return np.asarray((difference * along).sum(axis=-1) / np.linalg.norm(along, axis=-1))
