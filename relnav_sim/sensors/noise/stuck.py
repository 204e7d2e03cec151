"""Measurements that repeat."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.options import Effect
from relnav_sim.sensors.noise.fault import Fault, FaultOptions
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting, Silent
from relnav_sim.sensors.sensed import Sensed


class StuckNoise(FaultOptions):
    """A fault: every measurement repeats the last one before it began: a frozen output, a buffer that is not renewed.

    The epochs of the measurements stay as they are; a sensor that had read nothing yet repeats the first one.
    """

    stream: ClassVar[str] = "stuck"
    effect: ClassVar[Effect] = Effect("fault: stuck", "never")

    kind: Literal["stuck"] = Field(default="stuck", description="Measurements that repeat the last sound one")

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return a process that adds nothing."""
        return Silent()

    def fault(self) -> Fault:
        """Return the fault for one block."""
        return _Stuck(self)


class _Stuck:
    def __init__(self, options: StuckNoise) -> None:
        self._options = options
        self._last: Array | None = None  # the last measurement of each channel (runs, m), NaN where there was none

    def seen(self, truth: Sensed) -> Sensed:
        return truth

    def reported(self, z: Array, times_s: Array) -> Array:
        on = self._options.on(times_s)
        held = np.full((len(z), z.shape[2]), np.nan) if self._last is None else self._last
        if (before := np.flatnonzero(times_s < self._options.from_s)).size:
            held = np.where(np.isnan(latest := _nearest(z[:, before][:, ::-1])), held, latest)
        if on.any():
            during = z[:, on]
            held = np.where(np.isnan(held), _nearest(during), held)
            z = z.copy()
            z[:, on] = np.where(np.isnan(during), np.nan, held[:, None])
        self._last = held
        return z


def _nearest(z: Array) -> Array:
    """Return the first number of each channel along the epochs of z (runs, K, m); NaN where there is none."""
    first = np.argmax(~np.isnan(z), axis=1)
    return np.take_along_axis(z, first[:, None], axis=1)[:, 0]
