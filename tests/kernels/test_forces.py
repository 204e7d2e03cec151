"""Forces over lanes against plain transcriptions of the same physics."""

import numpy as np
import pytest
from mpmath import diff as slope_of
from mpmath import mp, mpf

from relnav_sim import kernels
from relnav_sim.kernels.forces import Forces

MU, RADIUS, TURN = 3.986004418e14, 6378137.0, 7.292115e-5
J = np.array([1.08263e-3, -2.53e-6, -1.62e-6, -2.3e-7, 5.4e-7])


def forces(terms=3, density=1e-12):
    return Forces(MU, RADIUS, J[:terms], density, 400e3, 60e3, TURN)


def flights(count, seed=0):
    rng = np.random.default_rng(seed)
    position, velocity = rng.normal(size=(2, count, 3))
    position *= rng.uniform(6.6e6, 9e6, (count, 1)) / np.linalg.norm(position, axis=1, keepdims=True)
    return np.hstack([position, 5e3 * velocity]), rng.uniform(0.0, 0.05, count)


def potential(x, y, z, terms):
    r = mp.sqrt(x * x + y * y + z * z)
    harmonics = sum(mpf(J[k]) * (RADIUS / r) ** (k + 2) * mp.legendre(k + 2, z / r) for k in range(terms))
    return mpf(MU) / r * (1 - harmonics)


@pytest.mark.parametrize("terms", [0, 1, 3, 5])
def test_gravity_is_the_gradient_of_the_potential(terms):
    states, _ = flights(4, terms)
    found = kernels.gravity.acceleration(np.ascontiguousarray(states[:, :3]), MU, RADIUS, J[:terms])
    with mp.workdps(40):
        for position, pull in zip(states[:, :3].tolist(), found, strict=True):
            axes = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
            exact = [
                float(slope_of(lambda *at: potential(*at, terms), tuple(mpf(c) for c in position), n)) for n in axes
            ]
            np.testing.assert_allclose(pull, exact, rtol=1e-12, atol=1e-12 * np.abs(exact).max())


def test_drag_is_added_to_gravity():
    states, ballistic = flights(100)
    together = kernels.forces.acceleration(forces(), states, ballistic)
    alone = kernels.forces.acceleration(forces(density=0.0), states, ballistic)
    r, v = states[:, :3], states[:, 3:]
    past_air = v - np.cross([0.0, 0.0, TURN], r)
    density = 1e-12 * np.exp((400e3 - (np.linalg.norm(r, axis=1) - RADIUS)) / 60e3)
    drag = -0.5 * (ballistic * density * np.linalg.norm(past_air, axis=1))[:, None] * past_air
    np.testing.assert_allclose(together, alone + drag, rtol=1e-12, atol=1e-14)
    pull = kernels.gravity.acceleration(np.ascontiguousarray(r), MU, RADIUS, J[:3])
    assert np.array_equal(alone, pull)


def test_bits_do_not_depend_on_the_block_and_nan_stays_in_its_row():
    states, ballistic = flights(1000)
    whole = kernels.forces.acceleration(forces(), states, ballistic)
    for rows in (slice(0, 1), slice(31, 34), slice(500, 541)):
        assert np.array_equal(kernels.forces.acceleration(forces(), states[rows], ballistic[rows]), whole[rows])
    spoilt = states.copy()
    spoilt[17] = np.nan
    found = kernels.forces.acceleration(forces(), spoilt, ballistic)
    assert np.isnan(found[17]).all()
    others = np.arange(1000) != 17
    assert np.array_equal(found[others], whole[others])
