"""What bearings alone say of linear relative motion: all but its size.

Woffinden and Geller, Observability criteria for angles-only navigation, IEEE Trans. AES 45(3), 2009: without a
manoeuvre every multiple of a trajectory has the same directions, so the state is known up to a factor; a known
manoeuvre, which does not grow with the state, tells it.
"""

import numpy as np
import pytest

from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.measurements.tangent_sight import camera

N, STEP_S = 0.0011, 20.0
ORBITS = {
    "ahead": [0.0, 800.0, 50.0, 0.0, 0.0, 0.02],
    "drifting": [-200.0, -1500.0, 30.0, 0.05, 0.31, -0.1],
    "round the chief, through the axis of azimuth": [250.0, 0.0, 0.0, 0.0, -2 * N * 250.0, 0.15],
}
SCALE = np.array([1.0, 1.0, 1.0, N, N, N])
"""Metres and metres a radian of orbit, so that position and velocity weigh alike."""


def gramian(start, impulse=None, epochs=250, at=100):
    """Sum of Phi^T H^T H Phi in scaled states, of the state at the start and its factor where there is an impulse."""
    F = cw_transition(N, STEP_S)
    model = camera(angle_sigma_deg=0.01)
    state, Phi, rows = np.array(start, dtype=float), np.eye(6), []
    for k in range(epochs):
        if k == at and impulse is not None:
            state = state + np.array([0, 0, 0, *impulse])
        rows.append(model.jacobian(state[None], k)[0] @ Phi * SCALE)
        state, Phi = F @ state, F @ Phi
    stacked = np.concatenate(rows)
    return stacked.T @ stacked


@pytest.mark.parametrize("name", ORBITS)
def test_the_one_null_direction_is_the_state_itself(name):
    start = np.array(ORBITS[name])
    eigenvalues, vectors = np.linalg.eigh(gramian(start))
    assert eigenvalues[0] < 1e-12 * eigenvalues[-1]
    assert eigenvalues[1] > 1e-7 * eigenvalues[-1]
    null = vectors[:, 0] * SCALE
    cosine = null @ start / np.linalg.norm(null) / np.linalg.norm(start)
    assert 1 - abs(cosine) < 1e-9


@pytest.mark.parametrize("name", ORBITS)
def test_a_known_manoeuvre_leaves_none(name):
    across_the_motion = [0.1, 0.0, 0.05]
    assert (
        np.linalg.eigvalsh(gramian(ORBITS[name], across_the_motion))[0]
        > 1e-9 * np.linalg.eigvalsh(gramian(ORBITS[name]))[-1]
    )
