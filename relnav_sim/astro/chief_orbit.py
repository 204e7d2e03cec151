"""What a filter is told about the chief's orbit before flight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt


@dataclass(frozen=True)
class ChiefOrbit:
    """The chief's nominal orbit and the constants of the body it goes round; never the truth of a run.

    Angles in rad, lengths in m, mu in m^3/s^2; j2 to j4 are unnormalised zonal harmonics.
    """

    semi_major_axis_m: float
    eccentricity: float
    inclination_rad: float
    raan_rad: float
    argument_of_perigee_rad: float
    true_anomaly_rad: float
    mu_m3_s2: float
    equatorial_radius_m: float
    j2: float
    j3: float = 0.0
    j4: float = 0.0

    @property
    def mean_motion_rad_s(self) -> float:
        """Mean motion n = sqrt(mu / a^3), rad/s."""
        return sqrt(self.mu_m3_s2 / self.semi_major_axis_m**3)

    def up_to(self, zonals: int) -> ChiefOrbit:
        """Return the same orbit about a body without the zonal harmonics above J_`zonals`."""
        return replace(self, **{name: 0.0 for n, name in ((2, "j2"), (3, "j3"), (4, "j4")) if n > zonals})
