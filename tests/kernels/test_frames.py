"""Small turns and the way from body to orbit frame, against SciPy's rotations."""

import numpy as np
import pytest
from alone import check_runs_are_alone
from scipy.spatial.transform import Rotation

from relnav_sim import kernels

SIZES = [(1, 1), (3, 40), (40, 7)]


def attitudes(runs, epochs, seed=4):
    return Rotation.random(runs * epochs, random_state=np.random.default_rng(seed)).as_quat().reshape(runs, epochs, 4)


def matrices(quaternions):
    """Return C^T, from body to ECI, of quaternions (..., 4)."""
    return Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix().reshape(*quaternions.shape[:-1], 3, 3)


@pytest.mark.parametrize(("runs", "epochs"), SIZES)
@pytest.mark.parametrize("size_rad", [1e-9, 1e-4, 0.05, 2.0])
@pytest.mark.parametrize("shared", [True, False])
def test_turned_against_scipy(runs, epochs, size_rad, shared):
    q = attitudes(1 if shared else runs, epochs)
    angles = size_rad * np.random.default_rng(6).normal(size=(runs, epochs, 3))
    angles[0, 0] = 0
    # A body turned by a vector in its own axes: body to ECI is multiplied from the right.
    turns = Rotation.from_rotvec(angles.reshape(-1, 3)).as_matrix().reshape(runs, epochs, 3, 3)
    after = kernels.frames.turned(q, angles)
    np.testing.assert_allclose(matrices(after), matrices(q) @ turns, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(after, axis=-1), 1, rtol=1e-14)


def test_turned_keeps_every_digit_where_the_series_ends():
    for angle in np.linspace(0.19, 0.21, 41):
        e = kernels.frames.turned(np.array([[[0.0, 0.0, 0.0, 1.0]]]), np.array([[[angle, 0.0, 0.0]]]))[0, 0]
        np.testing.assert_allclose(e, [np.sin(angle / 2), 0, 0, np.cos(angle / 2)], rtol=3e-16)


@pytest.mark.parametrize(("runs", "epochs"), SIZES)
@pytest.mark.parametrize("shared", [True, False])
def test_orbit_from_body_against_rotations(runs, epochs, shared):
    rng = np.random.default_rng(7)
    q, states = attitudes(1 if shared else runs, epochs), rng.normal(size=(1 if shared else runs, epochs, 6)) * 7e6
    v = rng.normal(size=(3, runs, epochs))
    position, velocity = states[..., :3], states[..., 3:]
    nadir = -position / np.linalg.norm(position, axis=-1, keepdims=True)
    normal = np.cross(position, velocity)
    minus_normal = -normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    axes = np.stack([np.cross(minus_normal, nadir), minus_normal, nadir], axis=-2)
    expected = (axes @ matrices(q) @ np.moveaxis(v, 0, -1)[..., None])[..., 0]
    found = np.moveaxis(kernels.frames.orbit_from_body(states, q, *v), 0, -1)
    np.testing.assert_allclose(found, expected, atol=1e-13)


def test_runs_are_alone():
    rng = np.random.default_rng(8)
    q, states, v = attitudes(33, 5), rng.normal(size=(33, 5, 6)), rng.normal(size=(33, 5, 3))
    check_runs_are_alone(kernels.frames.turned, (q, 0.1 * v))

    def orbit_from_body(states, q, v):
        x, y, z = np.ascontiguousarray(np.moveaxis(v, -1, 0))
        return np.moveaxis(kernels.frames.orbit_from_body(states, q, x, y, z), 0, -1)

    check_runs_are_alone(orbit_from_body, (states, q, v))
