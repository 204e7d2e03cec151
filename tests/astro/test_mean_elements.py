"""Two-line elements: the axes of SGP4, its propagation, and lines that are no such set."""

import numpy as np
import pytest

from relnav_sim.astro.earth_orientation import eme2000_from_gcrf
from relnav_sim.astro.epoch import Epoch
from relnav_sim.astro.mean_elements import MeanElements, eme2000_from_teme

# CelesTrak's of GRACE-FO 1.
LOW = (
    "1 43476U 18047A   18365.89673225 +.00000266 +00000-0 +96631-5 0  9993",
    "2 43476 088.9970 209.2025 0019272 138.9449 221.3254 15.23792965033965",
)


def test_teme_is_turned_as_vallado_turns_it():
    """Vallado, 4th ed., example 3-15: TEME and J2000 of 6 April 2004, without corrections to the nutation."""
    teme = np.array([5094.18016210, 6127.64465950, 6380.34453270, -4.746131487, 0.785818041, 5.531931288]) * 1e3
    j2000 = np.array([5102.50960000, 6123.01152000, 6378.13630000, -4.7432196000, 0.7905366000, 5.5337561900]) * 1e3
    found = eme2000_from_teme(teme, Epoch.parse("2004-04-06T07:51:28.386009 UTC"))
    np.testing.assert_allclose(found[:3], j2000[:3], atol=0.02)
    np.testing.assert_allclose(found[3:], j2000[3:], atol=2e-5)


def test_brahe_turns_teme_alike():
    """It goes by IAU 2006 instead of 1976/1980, and those differ by some 50 mas, 2 m."""
    brahe = pytest.importorskip("brahe")
    brahe.set_global_eop_provider_from_static_provider(brahe.StaticEOPProvider.from_zero())
    teme = np.array([-6010541.0, -3359522.0, 2.3e6, 0.0, 0.0, 0.0])
    epoch = brahe.Epoch.from_datetime(2018, 12, 31, 21, 31, 17.0, 0.0, brahe.TimeSystem.UTC)
    there = np.array([*brahe.position_teme_to_gcrf(epoch, teme[:3]), 0.0, 0.0, 0.0])
    found = eme2000_from_teme(teme, Epoch.parse("2018-12-31T21:31:17 UTC"))
    assert np.linalg.norm((found - eme2000_from_gcrf(there))[:3]) < 3.0


def test_the_epoch_of_the_lines():
    """Day 365.89673225 of 2018."""
    assert MeanElements.from_lines(*LOW).epoch.text() == "2018-12-31T21:31:17.6664 UTC"


def test_the_same_as_sgp4_itself():
    from sgp4.api import Satrec

    elements = MeanElements.from_lines(*LOW)
    _, position_km, _ = Satrec.twoline2rv(*LOW).sgp4_tsince(200.0)
    when = elements.epoch.later(12_000.0)
    expected = eme2000_from_teme(np.array([*position_km, 0.0, 0.0, 0.0]) * 1e3, when)
    np.testing.assert_allclose(elements.state(when)[:3], expected[:3], atol=1e-6)


@pytest.mark.parametrize(
    ("first", "second", "sentence"),
    [
        (LOW[0][:-1] + "4", LOW[1], "line 1 of a two-line element set ends with 4, but its digits add to 3"),
        (LOW[0], LOW[1][:-1], "line 2 of a two-line element set has 69 characters and begins with 2"),
        (LOW[1], LOW[0], "line 1 of a two-line element set has 69 characters and begins with 1"),
        (LOW[0], LOW[1].replace("43476", "43477")[:-1] + "6", "line 1 is about object 43476 and line 2 about 43477"),
    ],
)
def test_lines_that_are_no_set(first, second, sentence):
    with pytest.raises(ValueError, match=sentence):
        MeanElements.from_lines(first, second)


def test_a_satellite_that_has_come_down():
    decaying = MeanElements(Epoch.parse("2018-12-31T00:00:00 UTC"), 1.19e-3, 0.001, 1.0, 0.0, 0.0, 0.0, bstar=0.05)
    with pytest.raises(ValueError, match="SGP4 does not reach 2019-06-19T00:00:00 UTC from elements of 2018-12-31"):
        decaying.state(decaying.epoch.later(170 * 86400.0))
