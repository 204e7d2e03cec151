"""One day against integrations by other tools, and what the tolerance does to the error."""

import itertools

import numpy as np
import pytest

from relnav_sim.truth import propagate


def error_after_a_day(orbits, case, rtol):
    """Return the largest position error of the two craft and the error of their difference, m."""
    force = orbits.force(case["zonals"], case["drag"])
    day = [orbits.reference["duration_s"]]
    final = propagate(case["initial"], day, force, orbits.reference["constants"]["ballistic_m2_kg"], rtol)[:, 0]
    error = (final - case["final"])[:, :3]
    return np.linalg.norm(error, axis=1).max(), np.linalg.norm(error[1] - error[0])


def test_a_day_at_the_default_tolerance(orbits, reference_case):
    """A tenth of what is promised: 1e-3 m, and 1e-4 m between chief and deputy."""
    absolute, relative = error_after_a_day(orbits, reference_case, 1e-12)
    assert absolute < 1e-4
    assert relative < 1e-5


@pytest.mark.parametrize("name", ["leo_J2_J3_J4_drag", "polar_e_0.75_J2_J3_J4_drag"])
def test_the_error_falls_with_the_tolerance(orbits, name):
    """Ten times finer tolerance, at least twice finer result, down to the rounding floor of about 1e-5 m."""
    errors = [error_after_a_day(orbits, orbits.cases[name], 10.0**-digits)[0] for digits in range(6, 13)]
    assert errors[0] > 50
    for coarse, fine in itertools.pairwise(errors):
        assert fine < max(coarse / 2, 1e-5)
