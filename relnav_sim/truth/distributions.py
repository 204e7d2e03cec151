"""How a quantity of the truth varies from run to run."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from relnav_sim.arrays import Array
from relnav_sim.options import Options
from relnav_sim.streams import Streams


def _on_every_axis(value: object) -> object:
    """Return one number as three, so that both spellings mean (and hash as) the same; and a list as a tuple."""
    if isinstance(value, list):
        return tuple(value)
    return (value,) * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _not_all_zero(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not any(value):
        raise ValueError("at least one axis must vary; leave the dispersion out if none does")
    return value


NotNegative = Annotated[float, Field(ge=0)]
Spread = Annotated[
    tuple[NotNegative, NotNegative, NotNegative],
    BeforeValidator(
        _on_every_axis,
        json_schema_input_type=Annotated[float, Field(gt=0)] | tuple[NotNegative, NotNegative, NotNegative],
    ),
    AfterValidator(_not_all_zero),
]
"""One number for all three axes, or one for each; 0 keeps an axis fixed."""


class NormalPosition(Options):
    """Normal about the nominal position."""

    kind: Literal["normal"] = Field(description="Normal about the nominal position")
    sigma_m: Spread = Field(description="Standard deviation, m, RTN: one number or one for each axis; 0 fixes an axis")

    def draw(self, streams: Streams) -> Array:
        """Return offsets (runs, 3) in m."""
        return streams.normal(3) * self.sigma_m


class UniformPosition(Options):
    """Uniform in a box about the nominal position."""

    kind: Literal["uniform"] = Field(description="Uniform in a box about the nominal position")
    half_width_m: Spread = Field(description="Largest offset, m, RTN: one number or one for each axis; 0 fixes an axis")

    def draw(self, streams: Streams) -> Array:
        """Return offsets (runs, 3) in m."""
        return (2 * streams.uniform(3) - 1) * self.half_width_m


class NormalVelocity(Options):
    """Normal about the nominal velocity."""

    kind: Literal["normal"] = Field(description="Normal about the nominal velocity")
    sigma_m_s: Spread = Field(
        description="Standard deviation, m/s, RTN: one number or one for each axis; 0 fixes an axis"
    )

    def draw(self, streams: Streams) -> Array:
        """Return offsets (runs, 3) in m/s."""
        return streams.normal(3) * self.sigma_m_s


class UniformVelocity(Options):
    """Uniform in a box about the nominal velocity."""

    kind: Literal["uniform"] = Field(description="Uniform in a box about the nominal velocity")
    half_width_m_s: Spread = Field(
        description="Largest offset, m/s, RTN: one number or one for each axis; 0 fixes an axis"
    )

    def draw(self, streams: Streams) -> Array:
        """Return offsets (runs, 3) in m/s."""
        return (2 * streams.uniform(3) - 1) * self.half_width_m_s


class NormalFactor(Options):
    """A factor with a normal distribution about 1."""

    kind: Literal["normal"] = Field(description="Normal about 1")
    sigma: float = Field(
        gt=0,
        le=0.2,
        description="Standard deviation of the factor; at most 0.2, so that it never gets near zero: "
        "take lognormal for more",
    )

    def draw(self, streams: Streams) -> Array:
        """Return factors (runs,)."""
        # At 5 sigma from zero a negative draw has probability 3e-7; it would turn drag into thrust.
        return np.maximum(1 + self.sigma * streams.normal(1)[:, 0], 0.0)


class UniformFactor(Options):
    """A factor that is uniform about 1."""

    kind: Literal["uniform"] = Field(description="Uniform about 1")
    half_width: float = Field(gt=0, le=1, description="Largest distance of the factor from 1")

    def draw(self, streams: Streams) -> Array:
        """Return factors (runs,)."""
        return 1 + self.half_width * (2 * streams.uniform(1)[:, 0] - 1)


class LognormalFactor(Options):
    """A factor whose logarithm is normal about 0: its median is 1."""

    kind: Literal["lognormal"] = Field(description="Lognormal with median 1")
    sigma: float = Field(
        gt=0, le=3, description="Standard deviation of the factor's natural logarithm; about the relative one if small"
    )

    def draw(self, streams: Streams) -> Array:
        """Return factors (runs,)."""
        factors: Array = np.exp(self.sigma * streams.normal(1)[:, 0])
        return factors


PositionDispersion = Annotated[NormalPosition | UniformPosition, Field(discriminator="kind")]
VelocityDispersion = Annotated[NormalVelocity | UniformVelocity, Field(discriminator="kind")]
FactorDispersion = Annotated[NormalFactor | UniformFactor | LognormalFactor, Field(discriminator="kind")]
