"""What a filter is told about the chief's orbit before flight."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import isfinite, sqrt

from relnav_sim.astro.constants import J2, MU_M3_S2, RADIUS_M


@dataclass(frozen=True)
class ChiefOrbit:
    """The chief's nominal orbit and the constants of the body it goes round (default: the Earth); never a run's truth.

    Angles in rad, lengths in m, mu in m^3/s^2; j2 to j4 are unnormalised zonal harmonics, J3 and J4 zero
    unless given.

    Raises:
        ValueError: A number is not finite, the orbit is no ellipse, or its semi-major axis lies within the body.
    """

    semi_major_axis_m: float
    eccentricity: float
    inclination_rad: float
    raan_rad: float
    argument_of_perigee_rad: float
    true_anomaly_rad: float
    mu_m3_s2: float = MU_M3_S2
    equatorial_radius_m: float = RADIUS_M
    j2: float = J2
    j3: float = 0.0
    j4: float = 0.0

    def __post_init__(self) -> None:
        for each in fields(self):
            if not isfinite(getattr(self, each.name)):
                raise ValueError(f"{each.name} is {getattr(self, each.name)}; it must be a finite number")
        if not 0 <= self.eccentricity < 1:
            raise ValueError(f"eccentricity is {self.eccentricity:g}; it must be from 0 to less than 1")
        if self.semi_major_axis_m < self.equatorial_radius_m:
            raise ValueError(
                f"semi_major_axis_m is {self.semi_major_axis_m:g}, within a body of {self.equatorial_radius_m:g} m "
                "radius; it is the distance from the centre, in metres"
            )

    @property
    def mean_motion_rad_s(self) -> float:
        """Mean motion n = sqrt(mu / a^3), rad/s."""
        return sqrt(self.mu_m3_s2 / self.semi_major_axis_m**3)

    def up_to(self, zonals: int) -> ChiefOrbit:
        """Return the same orbit about a body without the zonal harmonics above J_`zonals`."""
        return replace(self, **{name: 0.0 for n, name in ((2, "j2"), (3, "j3"), (4, "j4")) if n > zonals})
