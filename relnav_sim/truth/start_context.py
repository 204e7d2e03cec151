"""What a start state depends on besides its own numbers."""

from __future__ import annotations

from dataclasses import dataclass

from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.gravity import Gravity


@dataclass(frozen=True)
class StartContext:
    """The body that both craft go round, and the instant.

    Attributes:
        gravity: Point mass and zonal harmonics of the truth.
        radius_m: The body's equatorial radius, which altitudes count from, m.
        epoch: When the run starts; None where the campaign does not say.
    """

    gravity: Gravity
    radius_m: float
    epoch: Epoch | None = None
