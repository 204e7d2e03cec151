"""Two-component Gaussian mixture noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.options import Effect, Options
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting
from relnav_sim.streams import Streams

Fraction = Annotated[float, Field(ge=0, le=1)] | Literal["per_run", "random"]


class MixtureNoise(Options):
    """Glint: white noise of 1 sigma, now and then replaced by a wider Gaussian of `scale` sigmas.

    p(v) = (1 - f) N(v; 0, 1) + f N(v; 0, scale^2), the contamination model of Shi et al. (2025), eq. 3.
    """

    stream: ClassVar[str] = "white"
    effect: ClassVar[Effect] = Effect("noise", "noise")

    kind: Literal["mixture"] = Field(default="mixture", description="Two-component Gaussian mixture")
    scale: float = Field(
        gt=0, description="Standard deviation of the wide component in sigmas of the sensor (Shi et al. 2025: 2)"
    )
    fraction: Fraction = Field(
        description="Probability f of the wide component: a number from 0 to 1; `per_run`: drawn from U(0, 1) once "
        "for each run; `random`: drawn from U(0, 1) anew for each sample, which is the same law as 0.5"
    )
    shared: bool = Field(
        default=True,
        description="True: one switch for all channels, as when the target's echo fades (default); "
        "false: each channel switches by itself",
    )

    @property
    def marginal_fraction(self) -> float:
        """Probability of the wide component for who does not know a drawn fraction: 1/2 is the mean of U(0, 1)."""
        return 0.5 if isinstance(self.fraction, str) else self.fraction

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return the process for one block."""
        switches = 1 if self.shared else setting.channels
        fractions = setting.streams("fraction") if isinstance(self.fraction, str) else None
        fraction = np.full((1, 1, 1), self.marginal_fraction)
        if self.fraction == "per_run" and fractions is not None:
            fraction, fractions = fractions.uniform(1, 1), None
        return _Mixture(
            setting.streams(), setting.streams("switch"), fractions, fraction, self.scale, setting.channels, switches
        )


@dataclass(frozen=True)
class _Mixture:
    normals: Streams
    switch_draws: Streams
    fraction_draws: Streams | None
    fraction: Array
    scale: float
    channels: int
    switches: int

    def sample(self, times_s: Array) -> Array:
        draws = self.normals.normal(len(times_s), self.channels)
        fraction = self.fraction
        if self.fraction_draws is not None:
            fraction = self.fraction_draws.uniform(len(times_s), self.switches)
        wide = self.switch_draws.uniform(len(times_s), self.switches) < fraction
        draws *= np.where(wide, self.scale, 1.0)
        return draws
