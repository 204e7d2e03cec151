"""Flights against SciPy's integrator of the same method, and what orbits conserve."""

import numpy as np
import pytest
from scipy.integrate import DOP853

from relnav_sim.truth import ForceModel
from relnav_sim.truth.stepping import Batch

MU, RADIUS = 3.986004418e14, 6378137.0
STATE = np.array([6.9e6, 4e5, -3e5, 2e2, 5.1e3, 5.6e3])


def test_a_step_is_scipys():
    """The same step of the same pair: its end, and the dense output within."""
    force, length = ForceModel(MU, RADIUS), 97.0
    batch = Batch(STATE[None], force, np.zeros(1), np.zeros(1), 1e-6, kept_steps=1)
    batch._flights.base[:], batch._flights.level[:] = length, 0
    times, found = np.linspace(0.0, 96.9, 90), np.empty((1, 90, 6))
    batch.write(times, found)

    def slope(t, y):
        return np.concatenate([y[3:], force.acceleration(y)])

    peer = DOP853(slope, 0.0, STATE, 1e9, first_step=length, rtol=1.0, atol=1e9)
    peer.step()
    scale = np.repeat([np.linalg.norm(STATE[:3]), np.linalg.norm(STATE[3:])], 3)
    assert peer.t == batch._flights.reached == length
    assert (np.abs(batch._flights.states[0] - peer.y) <= 1e-14 * scale).all()
    assert (np.abs(found[0] - peer.dense_output()(times).T) <= 1e-13 * scale).all()


@pytest.mark.parametrize("zonals", [(), (1.08263e-3, -2.53e-6, -1.62e-6)])
def test_energy_and_polar_momentum_are_conserved(zonals):
    """Zonal fields are still and round: energy and the momentum about the axis stay, for a day, to 1e-13."""
    rng = np.random.default_rng(2)
    states = STATE + rng.normal(size=(40, 6)) * np.repeat([1e5, 50.0], 3)
    batch = Batch(states, ForceModel(MU, RADIUS, zonals), np.zeros(40), np.zeros(40), 1e-12, kept_steps=2)
    times, found = np.linspace(0.0, 86_400.0, 25), np.empty((40, 25, 6))
    batch.write(times, found)
    x, y, z, vx, vy, vz = np.moveaxis(found, -1, 0)
    r = np.sqrt(x * x + y * y + z * z)
    s, q = z / r, RADIUS / r
    legendre = (1.5 * s**2 - 0.5, 2.5 * s**3 - 1.5 * s, (35 * s**4 - 30 * s**2 + 3) / 8)
    harmonics = sum(j * q**n * p for n, j, p in zip((2, 3, 4), zonals, legendre, strict=False))
    energy = (vx * vx + vy * vy + vz * vz) / 2 - MU / r * (1 - harmonics)
    momentum = x * vy - y * vx
    for kept in (energy, momentum):
        assert np.abs(kept / kept[:, :1] - 1).max() < 1e-12
