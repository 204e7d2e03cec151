"""Orbits and relative paths under a turning field, against plain NumPy and against the kernels of zonal fields."""

import numpy as np
from plain_orbits import INTEGRATION, PARTS, RULE, STEP, ZONALS, chiefs, field_of

from relnav_sim import GravityField, kernels
from relnav_sim.dynamics.field_motion import others_than_zonals
from relnav_sim.kernels.field_paths import Field

K, NODES = 3, len(RULE.nodes)
DURATION = *INTEGRATION, PARTS, STEP / PARTS
NONE = np.empty((1, 0, 3))


def turned(*shape):
    """Return rotations (*shape, 3, 3), each another."""
    Q, R = np.linalg.qr(np.random.default_rng(3).normal(size=(*shape, 3, 3)))
    return Q * np.sign(np.diagonal(R, axis1=-2, axis2=-1))[..., None, :]


def field(degree, turns):
    model = GravityField.load("ggm05s", degree)
    J = [-np.sqrt(2 * n + 1) * model.C[n, 0] for n in (2, 3, 4)]
    zonals = np.array([model.mu_m3_s2, model.radius_m, *J])
    return model, Field(zonals, others_than_zonals(model), turns, NODES, 2)


def test_the_legs_have_all_of_the_field():
    states, _ = chiefs(33)
    ends, turns = turned(K, 2), turned(K, PARTS * NODES)
    model, given = field(12, turns)
    begun = np.ascontiguousarray(np.repeat(states[None], K, axis=0))
    frames, nodes = kernels.chief_orbit.legs_in_field(begun, *DURATION, given, ends)
    r, bulge, rest = np.moveaxis(nodes.reshape(K, 33, PARTS * NODES, 3, 3), 3, 0)
    central = -model.mu_m3_s2 * r / np.linalg.norm(r, axis=-1, keepdims=True) ** 3
    Q = turns[:, None]
    whole = (model.acceleration((Q @ r[..., None])[..., 0])[..., None, :] @ Q)[..., 0, :]
    # The whole is 9 m/s^2 with a rounding error of some 1e-15 of that.
    assert np.abs(central + bulge + rest - whole).max() < 2e-14
    assert 1e-3 < np.abs(rest).max() < 0.1  # the harmonics' axis is anywhere here
    normal = np.cross(states[:, :3], states[:, 3:])
    h, distance = np.linalg.norm(normal, axis=1), np.linalg.norm(states[:, :3], axis=1)
    for k in range(K):
        Q = ends[k, 0]
        across = np.einsum("bi,bi->b", model.acceleration(states[:, :3] @ Q.T) @ Q, normal) / h
        np.testing.assert_allclose(frames[k, :, 9], distance * across / h, rtol=0, atol=1e-17)


def test_without_other_harmonics_it_is_the_zonal_field_to_the_bit():
    zonals = field_of(ZONALS["J2 to J4"])
    _, given = field(4, np.zeros((K, PARTS * NODES, 3, 3)) + np.eye(3))
    rows = given.others.rows.copy()
    rows[:, 2:] = 0.0
    given = given._replace(zonals=zonals, others=given.others._replace(rows=rows))
    states, x = chiefs(33)
    begun, ends = np.ascontiguousarray(np.repeat(states[None], K, axis=0)), np.zeros((K, 2, 3, 3)) + np.eye(3)
    frames, nodes = kernels.chief_orbit.legs_in_field(begun, *DURATION, given, ends)
    expected = [each.reshape(K, 33, -1) for each in kernels.chief_orbit.legs(begun.reshape(-1, 6), *DURATION, zonals)]
    assert np.array_equal(frames, expected[0])
    assert np.array_equal(nodes.reshape(K, 33, -1, 3, 3)[:, :, :, :2], expected[1].reshape(K, 33, -1, 2, 3))
    step = *INTEGRATION, STEP / PARTS
    moved = kernels.relative_flow.flow_in_field(x, frames, nodes, 1, *step, given)
    end, F = kernels.relative_flow.linear_flow_in_field(x, frames, nodes, 1, *step, given)
    assert np.array_equal(moved, kernels.relative_flow.flow(x, *expected, 1, *step, zonals))
    assert np.array_equal(end, moved)
    assert np.array_equal(F, kernels.relative_flow.linear_flow(x, *expected, 1, *step, zonals)[1])
    walked = kernels.chief_orbit.walk_in_field(states[0], K, *DURATION, given)
    assert np.array_equal(walked, kernels.chief_orbit.walk(states[0], K, *DURATION, zonals))
    P, Q, R = np.tile(np.eye(6), (33, 1, 1)), 1e-3 * np.eye(6), np.full(6, 4.0)
    fixes = np.ascontiguousarray(begun.swapaxes(0, 1))
    found = kernels.chief_orbit.follow_in_field(fixes, NONE, NONE, True, states, P, Q, R, *DURATION, given)
    plain = kernels.chief_orbit.follow(fixes, NONE, NONE, True, states, P, Q, R, *DURATION, zonals)
    assert all(np.array_equal(one, other) for one, other in zip(found, plain, strict=True))


def test_bits_of_a_run_do_not_depend_on_the_block():
    states, x = chiefs(40)
    ends = turned(1, 2)
    _, given = field(6, turned(1, PARTS * NODES))
    step = *INTEGRATION, STEP / PARTS
    legs = kernels.chief_orbit.legs_in_field(states[None], *DURATION, given, ends)
    moved = kernels.relative_flow.flow_in_field(x, *legs, 0, *step, given)
    for run in (0, 33, 39):
        own = kernels.chief_orbit.legs_in_field(states[None, run : run + 1], *DURATION, given, ends)
        assert all(np.array_equal(one[0, 0], all_of[0, run]) for one, all_of in zip(own, legs, strict=True))
        assert np.array_equal(
            kernels.relative_flow.flow_in_field(x[run : run + 1], *own, 0, *step, given)[0], moved[run]
        )
    x[7, 1] = np.nan
    broken = kernels.relative_flow.flow_in_field(x, *legs, 0, *step, given)
    assert np.isnan(broken[7]).any() and np.array_equal(np.delete(broken, 7, 0), np.delete(moved, 7, 0))
