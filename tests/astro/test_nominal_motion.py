"""The chief's nominal orbit, many epochs on."""

import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.nominal_motion import chief_motion


def test_an_epoch_after_a_million_others_may_be_the_first_that_is_asked_for():
    """A second later: by the series to second order, whose acceleration is n^2 R less gravity's."""
    orbit = ChiefOrbit(1.0e7, 0.3, 0.9, 0.0, 0.0, 1.0, j2=0.0)
    first, later = chief_motion(orbit, 1e-6, 0), chief_motion(orbit, 1e-6, 1_100_000)
    t = 1.1
    acceleration = first.n**2 * first.R - orbit.mu_m3_s2 / first.R**2
    assert pytest.approx(first.R + first.climb * t + acceleration * t**2 / 2, abs=1e-2) == later.R
    assert later.climb == pytest.approx(first.climb + acceleration * t, abs=1e-2)
