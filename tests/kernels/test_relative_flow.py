"""Relative motion over a step and its Jacobian, against plain NumPy in 64 bits of mantissa."""

import numpy as np
import pytest
from plain_orbits import (
    PARTS,
    STEP,
    ZONALS,
    chiefs,
    collocated,
    legs_of,
    orbit_frame,
    orbit_step,
    pulled,
    slopes,
    step_of,
)

from relnav_sim import kernels

each_field = pytest.mark.parametrize("zonals", ZONALS.values(), ids=list(ZONALS))


def relative_step(zonals, chief, x):
    """Return a relative state (6,) after a step, the difference of two accelerations taken as it stands."""
    end, nodes = orbit_step(zonals, chief)
    A, w = orbit_frame(zonals, chief.astype(np.longdouble))
    r, v = A.T @ x[:3], A.T @ (x[3:] + np.cross(w, x[:3]))
    for part in range(PARTS):
        there = nodes[part]

        def slope(j, offset, there=there):
            return sum(pulled(zonals, there[j] + offset)) - sum(pulled(zonals, there[j]))

        r, v, _ = collocated(slope, r, v, STEP / PARTS)
    A, w = orbit_frame(zonals, end)
    return np.concatenate([A @ r, A @ v - np.cross(w, A @ r)])


def assert_blocks(F, expected, rtol):
    """Compare Jacobians (6, 6) by their four blocks, whose units differ."""
    F, expected = F.reshape(2, 3, 2, 3), expected.reshape(2, 3, 2, 3)
    scale = np.abs(expected).max(axis=(1, 3), keepdims=True)
    assert (np.abs(F - expected) <= rtol * scale).all()


@each_field
def test_relative_states_and_jacobian(zonals):
    states, x = chiefs(2)
    frames, nodes = (each[None] for each in legs_of(states, zonals))
    moved = kernels.relative_flow.flow(x, frames, nodes, 0, *step_of(zonals))
    end, F = kernels.relative_flow.linear_flow(x, frames, nodes, 0, *step_of(zonals))
    np.testing.assert_array_equal(end, moved)
    for run, chief in enumerate(states):

        def step(each, chief=chief):
            return relative_step(zonals, chief, each)

        expected = step(x[run]).astype(float)
        for rows in (slice(3), slice(3, 6)):
            size = np.linalg.norm(expected[rows])
            np.testing.assert_allclose(moved[run, rows], expected[rows], rtol=0, atol=1e-12 * size)
        assert_blocks(F[run], slopes(step, x[run], np.repeat([1.0, 0.001], 3)), 1e-12)


@pytest.mark.parametrize(("runs", "points"), [(1, 1), (3, 13), (50, 13), (1000, 1), (7, 100)])
def test_bits_of_a_point_do_not_depend_on_the_block(runs, points):
    zonals = ZONALS["J2 to J4"]
    states, _ = chiefs(runs)
    x = np.random.default_rng(5).normal(size=(runs, points, 6)) * np.repeat([5e3, 5.0], 3)
    frames, nodes = (each[None] for each in legs_of(states, zonals))
    moved = kernels.relative_flow.flow(x.reshape(-1, 6), frames, nodes, 0, *step_of(zonals)).reshape(x.shape)
    end, F = kernels.relative_flow.linear_flow(x[:, 0].copy(), frames, nodes, 0, *step_of(zonals))
    for run in {0, runs // 2, runs - 1}:
        alone = tuple(each[None] for each in legs_of(states[run : run + 1], zonals))
        for point in {0, points - 1}:
            one = kernels.relative_flow.flow(x[run, point][None], *alone, 0, *step_of(zonals))
            assert np.array_equal(one[0], moved[run, point])
        found = kernels.relative_flow.linear_flow(x[run, :1], *alone, 0, *step_of(zonals))
        assert np.array_equal(found[0][0], end[run]) and np.array_equal(found[1][0], F[run])
    shared = tuple(each[None] for each in legs_of(states[:1], zonals))
    all_about_one = kernels.relative_flow.flow(x.reshape(-1, 6), *shared, 0, *step_of(zonals)).reshape(x.shape)
    assert np.array_equal(all_about_one[0], moved[0])


def test_what_is_not_a_number_stays_in_its_run():
    zonals = ZONALS["J2"]
    states, x = chiefs(40)
    frames, nodes = (each[None] for each in legs_of(states, zonals))
    sound = kernels.relative_flow.linear_flow(x, frames, nodes, 0, *step_of(zonals))
    x[7, 2] = np.nan
    broken = kernels.relative_flow.linear_flow(x, frames, nodes, 0, *step_of(zonals))
    others = np.arange(40) != 7
    for before, after in zip(sound, broken, strict=True):
        assert np.isnan(after[7]).any() and np.array_equal(before[others], after[others])
