"""The examples in what is documented of the sky run as they stand."""

import doctest

import pytest

import relnav_sim
from relnav_sim.astro import sun_moon


@pytest.mark.parametrize(
    "documented",
    [
        relnav_sim.Epoch,
        relnav_sim.LayeredAtmosphere,
        relnav_sim.eci_from_itrf,
        relnav_sim.itrf_from_eci,
        sun_moon.sun_position,
    ],
)
def test_an_example_runs(documented):
    (found,) = doctest.DocTestFinder(recurse=False).find(documented, globs={})
    failures = []
    assert doctest.DocTestRunner().run(found, out=failures.append).failed == 0, "".join(failures)
    assert found.examples
