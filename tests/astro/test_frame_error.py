"""Errors of an orbit turn the frame that is computed from it."""

import numpy as np
import pytest

from relnav_sim.astro.constants import MU_M3_S2
from relnav_sim.astro.frame_error import frame_covariance, frame_errors
from relnav_sim.astro.frames import eci_from_rtn, rtn_from_eci

RADIUS_M = 7e6
SPEED_M_S = np.sqrt(MU_M3_S2 / RADIUS_M)
RELATIVE = np.array([2000.0, -5000.0, 3000.0, 1.0, 2.0, -1.5])


@pytest.fixture
def chief():
    """On a circular orbit, its RTN axes those of ECI."""
    return np.array([RADIUS_M, 0.0, 0.0, 0.0, SPEED_M_S, 0.0])


@pytest.mark.parametrize("axis", range(6))
def test_the_relative_state_moves_as_the_linear_map_says(chief, axis):
    error = np.eye(6)[axis] * (100.0 if axis < 3 else 0.1)
    offset = eci_from_rtn(chief, RELATIVE) - chief
    moved = rtn_from_eci(chief + error, chief + error + offset) - RELATIVE
    theta, phi = np.split(frame_errors(error, RADIUS_M, SPEED_M_S), 2)
    r, v = np.split(RELATIVE, 2)
    np.testing.assert_allclose(moved[:3], np.cross(r, theta), atol=1e-5)
    np.testing.assert_allclose(moved[3:], np.cross(v, theta) + np.cross(r, phi), atol=1e-8)


def test_the_covariance_is_that_of_the_errors():
    root = np.tril(np.random.default_rng(1).normal(size=(4, 6, 6)))
    errors = np.einsum("rij,kj->rki", root, np.eye(6))
    seen = frame_errors(errors, RADIUS_M, SPEED_M_S)
    expected = np.einsum("rki,rkj->rij", seen, seen)
    np.testing.assert_allclose(
        frame_covariance(root, np.full(4, RADIUS_M), np.full(4, SPEED_M_S)), expected, rtol=1e-12
    )
