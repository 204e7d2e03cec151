"""Measurements of another object."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.frames import eci_from_rtn
from relnav_sim.options import Effect
from relnav_sim.sensors.noise.fault import Fault, FaultOptions
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting, Silent
from relnav_sim.sensors.sensed import Sensed


class WrongTargetNoise(FaultOptions):
    """A fault: the sensor follows another object, which keeps its place beside the other craft.

    A piece of debris, a reflection, another satellite of the formation. Its measurements are sound, but not of the
    target; where the object is out of the sensor's limits it reads nothing.
    """

    stream: ClassVar[str] = "wrong_target"
    effect: ClassVar[Effect] = Effect("fault: wrong target", "never")
    needs_other: ClassVar[bool] = True

    kind: Literal["wrong_target"] = Field(default="wrong_target", description="Measurements of another object")
    offset_m: tuple[float, float, float] = Field(
        description="Where that object is as seen from the true target, m, in the RTN axes of the sensor's host"
    )

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return a process that adds nothing."""
        return Silent()

    def fault(self) -> Fault:
        """Return the fault for one block."""
        return _WrongTarget(self)


@dataclass(frozen=True)
class _WrongTarget:
    options: WrongTargetNoise

    def seen(self, truth: Sensed) -> Sensed:
        on = self.options.on(truth.times_s)
        if not on.any():
            return truth
        beside = np.array([*self.options.offset_m, 0.0, 0.0, 0.0])
        # At rest in the turning axes; its velocity holds their turn.
        offset = eci_from_rtn(truth.host, np.broadcast_to(beside, truth.host.shape)) - truth.host
        return replace(truth, target=np.where(on[:, None], truth.target + offset, truth.target))

    def reported(self, z: Array, times_s: Array) -> Array:
        return z
