"""Two small sensors of the tests' own: a camera, and a rangefinder whose sigma grows with the range."""

from __future__ import annotations

from typing import Literal

import numpy as np

from relnav_sim.measurements.interface import MeasurementDefaults, Mixture
from relnav_sim.sensors.interface import Channel, MeasurementContext, RelativeSensorOptions
from relnav_sim.sensors.noise import noise_parts, white_law

ANGLE = 1e-3


class Seen(MeasurementDefaults):
    """Azimuth y/x and elevation of the relative position, RTN, and the attitude's share of their noise."""

    dimension = 2
    angles = (0, 1)

    def __init__(self, law, context: MeasurementContext) -> None:
        self.law, self.attitude, self.assumed = law, context.attitude, context.assumed_noise

    def predict(self, states, epoch):
        x, y, z = np.moveaxis(states[..., :3], -1, 0)
        return np.stack([np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))], axis=-1)

    def _share(self, mean):
        """The covariance of two turns across the line of sight, made to move with it."""
        tilt = self.predict(mean, 0)[:, 1]
        G = np.zeros((len(mean), 2, 3))
        G[:, 0, 1], G[:, 0, 2], G[:, 1, 0] = np.tan(tilt), 1.0, 1.0
        return G @ self.attitude @ G.swapaxes(1, 2)

    def noise(self, mean, epoch):
        nominal = np.square(self.law.nominal * ANGLE)
        total = np.einsum("k,ki->i", self.law.weights, np.square(self.law.scales * ANGLE))
        return np.diag(nominal if self.assumed == "nominal" else total) + self._share(mean)

    def mixture(self, mean, epoch):
        if self.assumed != "mixture" or len(self.law.weights) == 1:
            return None
        own = np.square(self.law.scales * ANGLE)[:, :, None] * np.eye(2)
        return Mixture(self.law.weights, own + self._share(mean)[:, None], shared=True)


class SeenOptions(RelativeSensorOptions):
    """A camera that sees all round."""

    channels = (Channel("azimuth", "rad", "azimuth", True), Channel("elevation", "rad", "elevation", True))
    kind: Literal["seen"] = "seen"

    @property
    def sigmas(self):
        return np.full(2, ANGLE)

    def needs_direction(self):
        return (True, True)

    def sample(self, truth, streams):
        z = streams.noise(truth.times_s) * self.sigmas
        offset = truth.target[..., :3] - truth.host[..., :3]
        axes = rtn_axes(truth.host)
        return z + Seen.predict(None, np.einsum("...ij,...j->...i", axes, offset), 0)

    def measurement(self, context):
        return Seen(white_law(noise_parts(self.noise), 2), context)


class Ranged(MeasurementDefaults):
    """Range, sigma 0.1 m and 1 % of it."""

    dimension = 1

    def __init__(self, law, context: MeasurementContext) -> None:
        self.law, self.assumed = law, context.assumed_noise

    def predict(self, states, epoch):
        return np.sqrt(np.square(states[..., :3]).sum(axis=-1, keepdims=True))

    def _variances(self, mean, scales):
        return (np.square(scales) * np.square(0.1 + 0.01 * self.predict(mean, 0)))[..., None]

    def noise(self, mean, epoch):
        scale = (
            self.law.nominal if self.assumed == "nominal" else np.sqrt(self.law.weights @ np.square(self.law.scales))
        )
        return self._variances(mean, scale)

    def mixture(self, mean, epoch):
        if self.assumed != "mixture" or len(self.law.weights) == 1:
            return None
        parts = [self._variances(mean, scale) for scale in self.law.scales]
        return Mixture(self.law.weights, np.stack(parts, axis=-3), shared=True)


class RangedOptions(RelativeSensorOptions):
    """A rangefinder."""

    channels = (Channel("range", "m", "range"),)
    kind: Literal["ranged"] = "ranged"

    @property
    def sigmas(self):
        return np.ones(1)

    def sample(self, truth, streams):
        distance = np.linalg.norm(truth.target[..., :3] - truth.host[..., :3], axis=-1, keepdims=True)
        return distance + streams.noise(truth.times_s) * (0.1 + 0.01 * distance)

    def measurement(self, context):
        return Ranged(white_law(noise_parts(self.noise), 1), context)


def rtn_axes(states):
    """Return the rows radial, along-track, normal of the orbit frame of ECI states (..., 6), (..., 3, 3)."""
    r, v = states[..., :3], states[..., 3:]
    radial, normal = r / np.linalg.norm(r, axis=-1, keepdims=True), np.cross(r, v)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([radial, np.cross(normal, radial), normal], axis=-2)
