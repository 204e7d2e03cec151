"""The white noise of a sensor whose channels are independent, as a filter is told of it."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.measurements.given_noise import MixtureNoise
from relnav_sim.sensors.interface import AssumedNoise
from relnav_sim.sensors.noise import NoiseOption, noise_parts, white_law


def told_noise(noise: NoiseOption, sigmas: Array, assumed: AssumedNoise) -> Array | MixtureNoise:
    """Return R (m, m) or the mixture that a filter believes in.

    Args:
        noise: The sensor's noise, in sigmas.
        sigmas: Standard deviations (m,) of the channels, SI units.
        assumed: ``nominal``: without outliers; ``total``: the covariance; ``mixture``: its components.
    """
    law = white_law(noise_parts(noise), len(sigmas))
    if assumed == "nominal":
        return np.diag(np.square(law.nominal * sigmas))
    mixture = MixtureNoise(law.weights, np.square(law.scales * sigmas)[:, :, None] * np.eye(len(sigmas)))
    return mixture if assumed == "mixture" and len(law.weights) > 1 else mixture.covariance
