"""Relative orbital elements: by their definition, by brahe, and by the linear motion that they stand for."""

from math import radians

import numpy as np
import pytest

from relnav_sim.astro.constants import MU_M3_S2
from relnav_sim.astro.frames import rtn_from_eci
from relnav_sim.astro.orbits import Elements, state_from_elements
from relnav_sim.astro.relative_elements import RelativeElements, deputy_elements, mean_anomaly, true_anomaly

CHIEF = Elements(7.1e6, 0.02, radians(97.8), 1.1, 0.7, 2.0)
ROE = RelativeElements(120.0, -3000.0, 400.0, -250.0, 90.0, 310.0)


def test_the_definition_is_met():
    """D'Amico 2010, eq. 2.2, from the elements of both."""
    deputy = deputy_elements(CHIEF, ROE)
    a = CHIEF.semi_major_axis_m

    def longitude(orbit):
        return orbit.argument_of_perigee_rad + mean_anomaly(orbit.true_anomaly_rad, orbit.eccentricity)

    def vector(orbit):
        return orbit.eccentricity * np.exp(1j * orbit.argument_of_perigee_rad)

    node = deputy.raan_rad - CHIEF.raan_rad
    turn = longitude(deputy) - longitude(CHIEF) + node * np.cos(CHIEF.inclination_rad)
    found = [
        deputy.semi_major_axis_m - a,
        a * ((turn + np.pi) % (2 * np.pi) - np.pi),
        a * (vector(deputy) - vector(CHIEF)).real,
        a * (vector(deputy) - vector(CHIEF)).imag,
        a * (deputy.inclination_rad - CHIEF.inclination_rad),
        a * node * np.sin(CHIEF.inclination_rad),
    ]
    np.testing.assert_allclose(found, [*vars(ROE).values()], atol=1e-6)


def test_brahe_finds_the_same_elements():
    brahe = pytest.importorskip("brahe")

    def koe(orbit):
        e = orbit.eccentricity
        anomaly = mean_anomaly(float(orbit.true_anomaly_rad), e)
        return np.array(
            [orbit.semi_major_axis_m, e, orbit.inclination_rad, orbit.raan_rad, orbit.argument_of_perigee_rad, anomaly]
        )

    found = brahe.state_oe_to_roe(koe(CHIEF), koe(deputy_elements(CHIEF, ROE)), brahe.AngleFormat.RADIANS)
    found[1] = (found[1] + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(np.array(found) * CHIEF.semi_major_axis_m, [*vars(ROE).values()], atol=1e-6)


def test_near_a_circular_chief_they_are_the_linear_motion():
    """D'Amico 2010, eq. 2.17: radial da - |de| cos, along dlambda + 2 |de| sin, normal |di| sin (times a)."""
    chief = Elements(7e6, 0.0, 1.0, 0.5, 0.0, 0.9)
    roe = RelativeElements(0.0, 50.0, 20.0, 10.0, 15.0, -5.0)
    relative = rtn_from_eci(
        state_from_elements(chief, MU_M3_S2), state_from_elements(deputy_elements(chief, roe), MU_M3_S2)
    )
    u = 0.9
    expected = [
        -20 * np.cos(u) - 10 * np.sin(u),
        50 + 2 * (20 * np.sin(u) - 10 * np.cos(u)),
        15 * np.sin(u) + 5 * np.cos(u),
    ]
    np.testing.assert_allclose(relative[:3], expected, atol=100**2 / 7e6)


def test_an_equatorial_chief_has_no_node():
    chief = Elements(42.164e6, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert deputy_elements(chief, RelativeElements(a_dlambda_m=100.0)).raan_rad == 0.0
    with pytest.raises(ValueError, match="a_diy_m turns the node, which an equatorial orbit does not have"):
        deputy_elements(chief, RelativeElements(a_diy_m=1.0))
    with pytest.raises(ValueError, match="no ellipse"):
        deputy_elements(chief, RelativeElements(a_dex_m=43e6))


@pytest.mark.parametrize("e", [0.0, 1e-4, 0.3, 0.9])
def test_anomalies_there_and_back(e):
    """Kepler's equation by the eccentric anomaly's half-angle form."""
    for nu in np.linspace(-3.1, 3.1, 15):
        E = 2 * np.arctan2(np.sqrt(1 - e) * np.sin(nu / 2), np.sqrt(1 + e) * np.cos(nu / 2))
        assert mean_anomaly(nu, e) == pytest.approx(E - e * np.sin(E), abs=2e-15)
        assert true_anomaly(mean_anomaly(nu, e), e) == pytest.approx(nu, abs=1e-15 / (1 - e) ** 2 + 2e-15)
