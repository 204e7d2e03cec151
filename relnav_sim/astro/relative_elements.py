"""Quasi-nonsingular relative orbital elements (D'Amico, PhD thesis, TU Delft, 2010, eq. 2.2)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, cos, hypot, sin, sqrt

import numpy as np

from relnav_sim.astro.kepler import eccentric_anomaly
from relnav_sim.astro.orbits import Elements

EQUATORIAL = 1e-6
"""Sine of the inclination below which the node, and with it the relative inclination vector, loses its meaning."""


@dataclass(frozen=True)
class RelativeElements:
    """Differences of mean or osculating elements, deputy minus chief, times the chief's semi-major axis, m.

    Attributes:
        a_da_m: Semi-major axis.
        a_dlambda_m: Mean longitude: the difference of omega + M, plus that of the node times cos i.
        a_dex_m: Eccentricity vector, e cos omega.
        a_dey_m: The same, e sin omega.
        a_dix_m: Inclination.
        a_diy_m: Node times sin i.
    """

    a_da_m: float = 0.0
    a_dlambda_m: float = 0.0
    a_dex_m: float = 0.0
    a_dey_m: float = 0.0
    a_dix_m: float = 0.0
    a_diy_m: float = 0.0


def deputy_elements(chief: Elements, relative: RelativeElements) -> Elements:
    """Return the deputy's elements, without linearisation.

    Args:
        chief: The chief's, numbers.
        relative: Those of the deputy relative to it.

    Raises:
        ValueError: The chief's orbit is equatorial and the node's difference is not zero, or the deputy's would be no
            ellipse.

    >>> chief = Elements(7e6, 0.0, 1.0, 0.0, 0.0, 0.5)
    >>> deputy_elements(chief, RelativeElements(a_dlambda_m=700.0)).true_anomaly_rad
    0.5001
    """
    a, e, i = (float(x) for x in (chief.semi_major_axis_m, chief.eccentricity, chief.inclination_rad))
    perigee = float(chief.argument_of_perigee_rad)
    node = 0.0
    if relative.a_diy_m:
        if abs(sin(i)) < EQUATORIAL:
            raise ValueError("a_diy_m turns the node, which an equatorial orbit does not have; give a shape instead")
        node = relative.a_diy_m / a / sin(i)
    ex = e * cos(perigee) + relative.a_dex_m / a
    ey = e * sin(perigee) + relative.a_dey_m / a
    eccentricity, size = hypot(ex, ey), a + relative.a_da_m
    if not (eccentricity < 1 and size > 0):
        raise ValueError("these relative elements put the deputy on no ellipse")
    longitude = mean_anomaly(float(chief.true_anomaly_rad), e) + perigee + relative.a_dlambda_m / a - node * cos(i)
    deputy_perigee = atan2(ey, ex) if eccentricity else 0.0
    return replace(
        chief,
        semi_major_axis_m=size,
        eccentricity=eccentricity,
        inclination_rad=i + relative.a_dix_m / a,
        raan_rad=float(chief.raan_rad) + node,
        argument_of_perigee_rad=deputy_perigee,
        true_anomaly_rad=true_anomaly(longitude - deputy_perigee, eccentricity),
    )


def mean_anomaly(true_anomaly_rad: float, eccentricity: float) -> float:
    """Return the mean anomaly of a true one, rad, of the same turn."""
    e = eccentricity
    half_lead = atan2(e * sin(true_anomaly_rad), 1 + sqrt(1 - e * e) + e * cos(true_anomaly_rad))
    E = true_anomaly_rad - 2 * half_lead
    return E - e * sin(E)


def true_anomaly(mean_anomaly_rad: float, eccentricity: float) -> float:
    """Return the true anomaly of a mean one, rad, of the same turn."""
    e = eccentricity
    E, ahead = (float(angle) for angle in eccentric_anomaly(np.asarray(mean_anomaly_rad), e))
    half_lead = atan2(e * sin(E), 1 + sqrt(1 - e * e) - e * cos(E))
    return mean_anomaly_rad + ahead + 2 * half_lead
