"""Times without a measurement."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from relnav_sim.arrays import Array, Mask
from relnav_sim.options import Effect, Options
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting
from relnav_sim.streams import Streams

_DRAWN_AT_ONCE = 16


class OutageNoise(Options):
    """No measurement in fixed windows, at random times, or both: blinding by the Sun, loss of lock.

    Random outages are a renewal process: working times and outages alternate, each exponentially distributed,
    and every run starts working.
    """

    stream: ClassVar[str] = "outage"
    effect: ClassVar[Effect] = Effect("outages", "absence")

    kind: Literal["outage"] = Field(default="outage", description="Times without a measurement")
    windows_s: tuple[tuple[float, float], ...] = Field(
        default=(), description="Fixed outages [[from, to], ...], s; out from `from` up to, not including, `to`"
    )
    rate_per_hour: float | None = Field(
        default=None, gt=0, description="Random outages per hour of working time; default: none"
    )
    mean_duration_s: float | None = Field(default=None, gt=0, description="Mean length of a random outage, s")

    @model_validator(mode="after")
    def _complete(self) -> OutageNoise:
        if (self.rate_per_hour is None) != (self.mean_duration_s is None):
            raise ValueError("random outages need both rate_per_hour and mean_duration_s")
        if not self.windows_s and self.rate_per_hour is None:
            raise ValueError("an outage needs windows_s, or rate_per_hour with mean_duration_s")
        for start, end in self.windows_s:
            if not start < end:
                raise ValueError(f"the outage window [{start:g}, {end:g}] must end after it starts")
        return self

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return the process for one block."""
        switches = None
        if self.rate_per_hour is not None and self.mean_duration_s is not None:
            switches = _Switches(setting.streams(), 3600 / self.rate_per_hour, self.mean_duration_s)
        return _Outage(self.windows_s, switches)


class _Outage:
    def __init__(self, windows_s: tuple[tuple[float, float], ...], switches: _Switches | None) -> None:
        self._windows = windows_s
        self._switches = switches

    def sample(self, times_s: Array) -> Array:
        out = np.zeros((1, len(times_s)), dtype=bool)
        for start, end in self._windows:
            out |= (times_s >= start) & (times_s < end)
        if self._switches is not None:
            out = out | self._switches.out(times_s)
        return np.where(out, np.nan, 0.0)[..., None]


class _Switches:
    """The times at which each run stops and starts working, drawn a fixed number at a time as they are needed."""

    def __init__(self, streams: Streams, mean_working_s: float, mean_outage_s: float) -> None:
        self._streams = streams
        self._means = np.tile([mean_working_s, mean_outage_s], _DRAWN_AT_ONCE // 2)
        self._times = np.zeros((len(streams.generators), 1))

    def out(self, times_s: Array) -> Mask:
        while self._times[:, -1].min() <= times_s[-1]:
            lengths = -self._means * np.log1p(-self._streams.uniform(_DRAWN_AT_ONCE))
            from_last = np.concatenate([self._times[:, -1:], lengths], axis=1)
            self._times = np.concatenate([self._times, np.cumsum(from_last, axis=1)[:, 1:]], axis=1)
        # The leading zero is no switch: after it an odd count means working.
        passed = [np.searchsorted(run, times_s, side="right") for run in self._times]
        return np.array(passed) % 2 == 0
