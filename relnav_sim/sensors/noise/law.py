"""What a filter can be told about a sensor's noise: the law of its white part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.options import Options
from relnav_sim.sensors.noise.bias import BiasNoise
from relnav_sim.sensors.noise.fault import FaultOptions
from relnav_sim.sensors.noise.gauss_markov import GaussMarkovNoise
from relnav_sim.sensors.noise.gaussian import GaussianNoise
from relnav_sim.sensors.noise.mixture import MixtureNoise
from relnav_sim.sensors.noise.outage import OutageNoise


@dataclass(frozen=True)
class WhiteLaw:
    """The law of one white sample, in sigmas: a Gaussian mixture with independent channels in each component.

    Attributes:
        weights: (k,) probabilities of the joint components, all positive.
        scales: (k, channels) standard deviations.
        nominal: (channels,) standard deviations while no mixture part shows its wide component.
    """

    weights: Array
    scales: Array
    nominal: Array


def has_white_part(parts: Sequence[Options]) -> bool:
    """Return whether any part is white noise."""
    return any(isinstance(part, GaussianNoise | MixtureNoise) for part in parts)


def has_outages(parts: Sequence[Options]) -> bool:
    """Return whether there are times without a measurement."""
    return any(isinstance(part, OutageNoise) for part in parts)


def is_white(parts: Sequence[Options]) -> bool:
    """Return whether all errors are white: no bias, nothing correlated, no fault."""
    return not any(isinstance(part, GaussMarkovNoise | BiasNoise | FaultOptions) for part in parts)


def constant_part(parts: Sequence[Options], channels: int) -> Array:
    """Return the sum (channels,) of the biases, in sigmas; NaN where correlated noise or a fault comes on top."""
    if any(isinstance(part, GaussMarkovNoise | FaultOptions) for part in parts):
        return np.full(channels, np.nan)
    return sum(
        (np.broadcast_to(part.value, channels) for part in parts if isinstance(part, BiasNoise)), np.zeros(channels)
    )


def white_variance(parts: Sequence[Options]) -> float:
    """Return the variance of the white parts in one channel, in sigmas squared."""
    total = 0.0
    for part in parts:
        if isinstance(part, GaussianNoise):
            total += part.scale**2
        elif isinstance(part, MixtureNoise):
            total += 1 + part.marginal_fraction * (part.scale**2 - 1)
    return total


def white_law(parts: Sequence[Options], channels: int) -> WhiteLaw:
    """Return the law of the white parts; at most one of them is a mixture.

    Channels that switch by themselves are expanded into the 2^channels joint components.
    """
    gaussian = sum(part.scale**2 for part in parts if isinstance(part, GaussianNoise))
    mixture = next((part for part in parts if isinstance(part, MixtureNoise)), None)
    if mixture is None:
        nominal = np.full(channels, np.sqrt(gaussian))
        return WhiteLaw(np.ones(1), nominal[None], nominal)
    probabilities = (1 - mixture.marginal_fraction, mixture.marginal_fraction)
    deviations = np.sqrt([gaussian + 1, gaussian + mixture.scale**2])
    switches = [(0,) * channels, (1,) * channels] if mixture.shared else list(product((0, 1), repeat=channels))
    weights = np.array(
        [
            probabilities[switch[0]] if mixture.shared else np.prod([probabilities[i] for i in switch])
            for switch in switches
        ]
    )
    shown = weights > 0
    return WhiteLaw(weights[shown], deviations[np.array(switches)][shown], np.full(channels, deviations[0]))


def probability_below(parts: Sequence[Options], channels: int, channel: int, level: Array) -> Array:
    """Return the probability that the noise of a channel is below a level, in sigmas; any shape.

    Every part counts: biases shift it, correlated noise widens it by its stationary variance.
    """
    from scipy.special import ndtr

    law = white_law(parts, channels)
    shift, correlated = 0.0, 0.0
    for part in parts:
        if isinstance(part, BiasNoise):
            shift += float(np.broadcast_to(part.value, channels)[channel])
        elif isinstance(part, GaussMarkovNoise):
            correlated += part.scale**2
    deviations = np.sqrt(np.square(law.scales[:, channel]) + correlated)
    probability: Array = sum(
        (weight * ndtr((level - shift) / deviation) for weight, deviation in zip(law.weights, deviations, strict=True)),
        np.zeros(np.shape(level)),
    )
    return probability
