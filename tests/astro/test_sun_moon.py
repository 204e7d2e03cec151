"""Sun and Moon against another library's series, the almanac's events and the daily polynomials."""

import erfa
import numpy as np
import pytest

from relnav_sim.astro.earth_orientation import gcrf_from_eme2000, itrf_from_eci
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.sky_table import day_and_variable, sky_table
from relnav_sim.astro.sun_moon import AU_M, moon_position, sun_position
from relnav_sim.kernels.sky import MOON, SUN

EPOCH = Epoch.parse("2010-07-27T00:00:00 GPS")
TIMES = np.random.default_rng(0).uniform(0.0, 365 * 86400.0, 200)


def degrees_between(a, b):
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.degrees(np.arctan2(cross, np.einsum("...i,...i->...", a, b)))


def test_the_polynomials_of_a_day_are_pyerfas():
    """To 10 mm; the Moon moves a kilometre a second."""
    days, variable = day_and_variable(TIMES)
    table = sky_table(EPOCH, days)
    powers = variable[:, None] ** np.arange(table.shape[-1])
    for rows, exact in ((SUN, sun_position(TIMES, EPOCH)), (MOON, moon_position(TIMES, EPOCH))):
        found = np.einsum("trp,tp->tr", table[:, rows : rows + 3], powers)
        assert np.abs(found - exact).max() < 1e-2


def test_events_of_the_almanac():
    """Total eclipse of 2010-07-11 19:33:33 UTC: from the Earth's centre the Moon stood within 0.7 deg of the Sun.

    Gamma was -0.6788 Earth radii (NASA's catalogue), the distance of the shadow's axis from the centre. The Sun's
    distance was least on 2010-01-03 and largest on 2010-07-06.
    """
    eclipse = "2010-07-11T19:33:33 UTC"
    sun, moon = sun_position(0.0, eclipse), moon_position(0.0, eclipse)
    axis = (moon - sun) / np.linalg.norm(moon - sun)
    assert np.linalg.norm(np.cross(moon, axis)) / 6378137.0 == pytest.approx(0.6788, abs=0.01)
    distance = np.linalg.norm(sun_position(np.arange(365) * 86400.0, "2010-01-01T12:00:00 UTC"), axis=1) / AU_M
    assert abs(int(distance.argmin()) - 2) <= 1
    assert abs(int(distance.argmax()) - 186) <= 1
    assert distance.min() == pytest.approx(0.98329, abs=1e-5)


def test_the_sun_stands_over_the_equator_at_the_equinox():
    """2010-09-23 03:09 UTC: in the ITRF its latitude is 0, to 20 arc seconds of aberration and a minute of time."""
    sun = sun_position(0.0, "2010-09-23T03:09:00 UTC")
    fixed = itrf_from_eci([[*sun, 0.0, 0.0, 0.0]], [0.0], "2010-09-23T03:09:00 UTC")[0, :3]
    assert abs(np.degrees(fixed[2] / np.linalg.norm(fixed))) < 0.005


def test_brahe_agrees():
    """Its low-precision series err by 0.1 deg and more (Montenbruck and Gill 2000, section 3.3.2)."""
    brahe = pytest.importorskip("brahe")
    brahe.set_global_eop_provider_from_static_provider(brahe.StaticEOPProvider.from_zero())
    start = brahe.Epoch.from_datetime(2010, 7, 26, 23, 59, 45.0, 0.0, brahe.TimeSystem.UTC)
    for t in TIMES[:40]:
        pair = (sun_position(t, EPOCH), brahe.sun_position(start + t)), (
            moon_position(t, EPOCH), brahe.moon_position(start + t),
        )  # fmt: skip
        for ours, theirs in pair:
            assert degrees_between(ours, theirs) < 0.3
            assert np.linalg.norm(ours) == pytest.approx(np.linalg.norm(theirs), rel=3e-3)


def test_the_sun_is_where_a_second_series_has_it():
    """ERFA's `plan94` (Simon et al. 1994) has the Earth-Moon barycentre to a few arc seconds, and the Moon the rest."""
    day, fraction = EPOCH.tt
    barycentre = erfa.plan94(day, fraction + TIMES / 86400, 3)["p"] * AU_M  # axes of J2000
    moon = moon_position(TIMES, EPOCH)
    earth = barycentre - moon * 4.902800066e12 / (3.986004415e14 + 4.902800066e12)
    assert degrees_between(sun_position(TIMES, EPOCH), -earth).max() < 10 / 3600


def test_axes_are_those_of_eme2000():
    sun = sun_position(TIMES, EPOCH)
    day, fraction = EPOCH.tt
    earth, _ = erfa.epv00(day, fraction + TIMES / 86400)
    gcrf = gcrf_from_eme2000(np.concatenate([sun, sun], axis=1))[:, :3]
    np.testing.assert_allclose(gcrf, -AU_M * earth["p"], rtol=0, atol=1e-3)


@pytest.mark.parametrize("of", [sun_position, moon_position])
def test_what_is_refused(of):
    with pytest.raises(ValueError, match="names no time scale"):
        of(0.0, "2010-07-27T00:00:00")
    assert of([[0.0, 1.0]], EPOCH).shape == (1, 2, 3)
