"""Small turns across a line of sight: against rotations by scipy, differences, and azimuth and elevation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relnav_sim import kernels
from relnav_sim.astro.line_of_sight import sight_vector, spherical_of
from relnav_sim.astro.tangent_plane import across, deflected

BEHIND = np.array([[-1.0, 0.0, 0.0], [-1.0, 1e-12, 0.0], [-1.0, 0.0, -1e-200], [-1.0, 1e-5, 3e-6]])
CORNERS = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [0, -1, 0]])


def directions(count=200, seed=3):
    drawn = np.random.default_rng(seed).normal(size=(count, 3))
    every = np.vstack([drawn, CORNERS, BEHIND])
    return every / np.linalg.norm(every, axis=1, keepdims=True)


def stacked(vectors):
    return np.stack(vectors, axis=-1)


def deflection(centre, sight):
    return kernels.tangent.readings(rows(sight), np.eye(3), rows(centre), False).T


def deflection_gradients(centre, sight):
    return kernels.tangent.linearised(rows(sight), np.eye(3), rows(centre), False)[1].transpose(1, 2, 0)


def deflection_by_turn(centre):
    return kernels.tangent.by_turn(rows(centre), np.eye(3), rows(centre)).transpose(1, 2, 0)


def rows(vectors):
    return np.ascontiguousarray(np.atleast_2d(stacked(vectors)))


def test_axes_stand_across_every_direction_and_on_each_other():
    u = directions()
    a, b = (stacked(axis) for axis in across(tuple(u.T)))
    frames = np.stack([u, a, b], axis=1)
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), np.broadcast_to(np.eye(3), frames.shape), atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(frames), -1, atol=1e-9)  # y and -z, seen along x
    boresight = across(tuple(np.eye(3)[0]))
    np.testing.assert_array_equal(stacked(boresight), np.array([[0, 1, 0], [0, 0, -1]]).T)


def test_axes_are_those_of_the_boresight_brought_along_the_great_circle():
    u = directions()[:-4]  # straight behind there is no one great circle
    axis = np.cross([1.0, 0, 0], u)
    angle = np.arctan2(np.linalg.norm(axis, axis=1), u[:, 0])
    along = axis / np.maximum(np.linalg.norm(axis, axis=1), 1e-300)[:, None]
    turn = Rotation.from_rotvec(angle[:, None] * along)
    for own, at_boresight in zip(across(tuple(u.T)), ([0, 1.0, 0], [0, 0, -1.0]), strict=True):
        np.testing.assert_allclose(stacked(own), turn.apply(at_boresight), atol=1e-12)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 0.5, 3.0])
def test_a_deflection_is_the_angle_between_the_directions_and_comes_back(size):
    u = directions()
    a, b = size * np.array([0.8, -0.6])
    moved = deflected(tuple(u.T), np.full(len(u), a), np.full(len(u), b))
    between = np.arctan2(np.linalg.norm(np.cross(u, stacked(moved)), axis=1), (u * stacked(moved)).sum(axis=1))
    np.testing.assert_allclose(between, size, rtol=1e-6, atol=1e-15)
    back = deflection(tuple(u.T), tuple(7e3 * part for part in moved))
    np.testing.assert_allclose(stacked(back), np.broadcast_to([a, b], (len(u), 2)), rtol=1e-6, atol=1e-14)
    # Seen from the other end it is as far.
    np.testing.assert_allclose(np.hypot(*deflection(moved, tuple(u.T))), size, rtol=1e-6, atol=1e-15)


def test_gradients_are_the_derivatives_up_to_far_behind():
    u = directions()[:-4]
    generator = np.random.default_rng(4)
    sight = 1e3 * generator.uniform(0.5, 2, size=(len(u), 1)) * generator.normal(size=u.shape)
    sight[:20] = 800 * u[:20]  # the reading itself
    gradients = np.stack([stacked(row) for row in deflection_gradients(tuple(u.T), tuple(sight.T))], axis=1)
    width = 1e-3
    for i in range(3):
        off = width * np.eye(3)[i]
        ahead, behind = (stacked(deflection(tuple(u.T), tuple((sight + sign * off).T))) for sign in (1, -1))
        np.testing.assert_allclose(gradients[:, :, i], (ahead - behind) / (2 * width), rtol=1e-5, atol=3e-11)


def test_what_stands_straight_behind_is_half_a_turn_away():
    for u in (*CORNERS, BEHIND[0]):
        sight = tuple(-500.0 * u)
        angles = np.array(deflection(tuple(u), sight))
        assert np.hypot(*angles) == pytest.approx(np.pi)
        assert np.isfinite(deflection_gradients(tuple(u), sight)).all()


def test_a_small_turn_of_the_sensor_moves_the_reading():
    u = directions()[:-4]
    dtheta = 1e-6 * np.array([0.3, -0.7, 0.5])
    moved = u + np.cross(u, dtheta)
    told = stacked([stacked(row) @ dtheta for row in deflection_by_turn(tuple(u.T))])
    np.testing.assert_allclose(told, stacked(deflection(tuple(u.T), tuple(moved.T))), atol=1e-12)


def test_near_the_boresight_it_is_azimuth_and_elevation_to_second_order():
    """What differs falls with the square of the angle off the boresight, for one and the same small deflection."""
    errors = []
    for off in (0.2, 0.1, 0.05):
        azimuth, elevation = off * np.cos(0.7), off * np.sin(0.7)
        direction = sight_vector(np.ones(()), azimuth, elevation)
        moved = deflected(direction, np.array(1e-4), np.array(-2e-4))
        _, read_azimuth, read_elevation = spherical_of(moved)
        errors.append(np.hypot(read_azimuth - azimuth - 1e-4, read_elevation - elevation + 2e-4))
    assert errors[2] < 0.05**2 * 2.3e-4
    ratios = np.array(errors[:-1]) / errors[1:]
    np.testing.assert_allclose(ratios, 4, rtol=0.05)
