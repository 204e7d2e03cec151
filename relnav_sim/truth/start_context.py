"""What a start state depends on besides its own numbers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.astro.earth_orientation import EarthOrientation, eci_from_itrf
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.gravity import Gravity


@dataclass(frozen=True)
class StartContext:
    """The body that both craft go round, and the instant.

    Attributes:
        gravity: Point mass and zonal harmonics of the truth.
        radius_m: The body's equatorial radius, which altitudes count from, m.
        epoch: When the run starts; None where the campaign does not say.
        orientation: What only observation tells about the Earth's rotation.
    """

    gravity: Gravity
    radius_m: float
    epoch: Epoch | None = None
    orientation: EarthOrientation = field(default_factory=EarthOrientation)

    def eci_from_itrf(self, state: Array) -> Array:
        """Return a state (6,) of the epoch, given in the ITRF, in ECI, m and m/s.

        Raises:
            ValueError: There is no epoch.
        """
        if self.epoch is None:
            raise ValueError("the frame ITRF turns with the Earth; give the start's calendar time as truth.epoch")
        values = self.orientation
        (turned,) = eci_from_itrf(
            state[None],
            [0.0],
            self.epoch,
            ut1_utc_s=values.ut1_utc_s,
            polar_motion_rad=values.polar_motion_rad,
        )
        return np.asarray(turned)
