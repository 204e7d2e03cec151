"""Noise of a sensor as parts that add up, each in units of the sensor's 1-sigma per channel.

A new kind is one new file with its options model (a `kind`, a docstring, `process(setting)`) and its name in
`NoisePart`; the campaign schema, `relnav list noise` and the contract tests take it from there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Any, get_args

import numpy as np
from pydantic import Discriminator, Field, Tag

from relnav_sim.arrays import Array
from relnav_sim.options import Options
from relnav_sim.sensors.noise.bias import BiasNoise
from relnav_sim.sensors.noise.fault import Fault, FaultOptions, faults_of
from relnav_sim.sensors.noise.gauss_markov import GaussMarkovNoise
from relnav_sim.sensors.noise.gaussian import GaussianNoise
from relnav_sim.sensors.noise.law import (
    WhiteLaw,
    constant_part,
    has_outages,
    has_white_part,
    is_white,
    probability_below,
    white_law,
    white_variance,
)
from relnav_sim.sensors.noise.mixture import MixtureNoise
from relnav_sim.sensors.noise.outage import OutageNoise
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting
from relnav_sim.sensors.noise.ramp import RampNoise
from relnav_sim.sensors.noise.step import StepNoise
from relnav_sim.sensors.noise.stuck import StuckNoise
from relnav_sim.sensors.noise.wrong_target import WrongTargetNoise
from relnav_sim.streams import RandomSource

__all__ = [
    "BiasNoise",
    "Fault",
    "FaultOptions",
    "GaussMarkovNoise",
    "GaussianNoise",
    "MixtureNoise",
    "Noise",
    "NoiseOption",
    "NoisePart",
    "NoiseProcess",
    "NoiseSetting",
    "OutageNoise",
    "RampNoise",
    "StepNoise",
    "StuckNoise",
    "WhiteLaw",
    "WrongTargetNoise",
    "check_parts",
    "constant_part",
    "faults_of",
    "has_outages",
    "has_white_part",
    "is_white",
    "noise_kinds",
    "noise_parts",
    "probability_below",
    "white_law",
    "white_variance",
]


NoisePart = (
    GaussianNoise
    | MixtureNoise
    | BiasNoise
    | GaussMarkovNoise
    | OutageNoise
    | StepNoise
    | RampNoise
    | StuckNoise
    | WrongTargetNoise
)
"""The registered kinds of noise."""

_Part = Annotated[NoisePart, Field(discriminator="kind")]


def _one_or_list(value: Any) -> str:
    return "list" if isinstance(value, list | tuple) else "part"


NoiseOption = Annotated[
    Annotated[_Part, Tag("part")] | Annotated[tuple[_Part, ...], Tag("list")], Discriminator(_one_or_list)
]
"""A sensor's `noise:`: one part, or a list of parts whose samples add."""


def noise_kinds() -> dict[str, type[Options]]:
    """Return the options model of every kind of noise by the name that campaigns use."""
    return {model.model_fields["kind"].default: model for model in get_args(NoisePart)}


def noise_parts(noise: NoisePart | tuple[NoisePart, ...]) -> tuple[NoisePart, ...]:
    """Return the parts of a sensor's noise."""
    return noise if isinstance(noise, tuple) else (noise,)


def check_parts(parts: Sequence[NoisePart], channels: int) -> None:
    """Check that the parts fit a sensor.

    Raises:
        ValueError: Two mixtures, or a bias or a fault for another number of channels.
    """
    if sum(isinstance(part, MixtureNoise) for part in parts) > 1:
        raise ValueError("the parts of a noise may hold one mixture, not more")
    for part in parts:
        if isinstance(part, BiasNoise | FaultOptions):
            values = part.value if isinstance(part, BiasNoise) else part.per_channel
            if isinstance(values, tuple) and len(values) != channels:
                raise ValueError(f"the {part.stream} has {len(values)} values; this sensor has {channels} channels")


class Noise:
    """The noise of one sensor over one block of runs.

    The numbers of a run depend neither on the other runs of the block nor on how the epochs are split into
    chunks: each kind of draw has a stream of its own. Gaussian and mixture parts draw their normal numbers from
    the same stream, so that cases with one and with the other differ in nothing but the switch.

    Args:
        parts: The sensor's noise parts.
        name: Name of the sensor, the stem of its stream names (``sensor.radar.white``).
        source: Seed and runs of the block.
        channels: Components of the measurement.
        step_s: Time between epochs, s.
    """

    def __init__(
        self, parts: Sequence[NoisePart], name: str, source: RandomSource, channels: int, step_s: float
    ) -> None:
        self._shape = (len(source.runs), channels)
        self._processes: list[NoiseProcess] = []
        used: Counter[str] = Counter()
        for part in parts:
            used[part.stream] += 1
            ordinal = f".{used[part.stream]}" if used[part.stream] > 1 else ""
            setting = NoiseSetting(f"sensor.{name}.{part.stream}{ordinal}", source, channels, step_s)
            self._processes.append(part.process(setting))

    def sample(self, times_s: Array) -> Array:
        """Return the noise at the next epochs in sigmas, (runs, len(times_s), channels), a fresh array.

        Rows are NaN during outages.
        """
        runs, channels = self._shape
        total: Array | None = None
        for process in self._processes:
            sample = process.sample(times_s)
            total = sample if total is None else total + sample
        shape = (runs, len(times_s), channels)
        if total is None:
            return np.zeros(shape)
        return total if total.shape == shape else np.array(np.broadcast_to(total, shape))
