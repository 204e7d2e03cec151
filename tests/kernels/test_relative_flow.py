"""The chief's orbit and relative motion about it, against plain NumPy in 64 bits of mantissa."""

import numpy as np
import pytest

from relnav_sim import kernels
from relnav_sim.astro.constants import J2, J3, J4, MU_M3_S2, RADIUS_M
from relnav_sim.dynamics.collocation import rule_for

ZONALS = {"point mass": (), "J2": (J2,), "J2 to J4": (J2, J3, J4)}
RULE, PARTS, STEP = rule_for(0.02), 2, 20.0
INTEGRATION = RULE.tableau, RULE.sweeps
each_field = pytest.mark.parametrize("zonals", ZONALS.values(), ids=list(ZONALS))
NONE = np.empty((1, 0, 3))


def field_of(zonals):
    return np.array([MU_M3_S2, RADIUS_M, *zonals, 0.0, 0.0, 0.0][:5])


def chiefs(runs, seed=0):
    """Return states (runs, 6) in low orbits, and relative states (runs, 6)."""
    rng = np.random.default_rng(seed)
    r, v = rng.normal(size=(2, runs, 3))
    r *= 7.1e6 / np.linalg.norm(r, axis=1, keepdims=True)
    v -= np.einsum("bi,bi->b", r, v)[:, None] * r / 7.1e6**2
    v *= 7.6e3 / np.linalg.norm(v, axis=1, keepdims=True)
    return np.concatenate([r, v + 10], axis=1), rng.normal(size=(runs, 6)) * np.repeat([5e3, 5.0], 3)


def legs_of(states, zonals):
    return kernels.chief_orbit.legs(states, *INTEGRATION, PARTS, STEP / PARTS, field_of(zonals))


def step_of(zonals):
    return *INTEGRATION, STEP / PARTS, field_of(zonals)


def polynomial(n, derivative, s):
    c = np.polynomial.legendre.leg2poly(np.polynomial.legendre.legder([0] * n + [1], derivative))
    return sum(np.longdouble(each) * s**k for k, each in enumerate(c))


def pulled(zonals, p):
    """Return the acceleration at p (3,) by a point mass and the one by the harmonics."""
    p = p.astype(np.longdouble)
    r = np.sqrt(p @ p)
    s, bulge = p[2] / r, np.zeros(3, dtype=np.longdouble)
    for n, J in enumerate(zonals, start=2):
        size = np.longdouble(MU_M3_S2) / r**3 * np.longdouble(J) * (RADIUS_M / r) ** n
        bulge += size * polynomial(n + 1, 1, s) * p
        bulge[2] -= size * r * polynomial(n, 1, s)
    return -np.longdouble(MU_M3_S2) / r**3 * p, bulge


def collocated(slope, r, v, h):
    """Return position and velocity after a part of a step, and the nodes of the last sweep; slope(j, r) at node j."""
    r, v = r.astype(np.longdouble), v.astype(np.longdouble)
    line = r + h * RULE.nodes[:, None] * v
    nodes, f = line, np.zeros_like(line)
    for sweep in range(RULE.sweeps):
        if sweep:
            nodes = line + h * h * RULE.inner @ f
        f = np.stack([slope(j, each) for j, each in enumerate(nodes)])
    return r + h * v + h * h * RULE.position @ f, v + h * RULE.velocity @ f, nodes


def orbit_step(zonals, x):
    """Return a state (6,) after a step, and the nodes (parts, s, 3)."""
    r, v, nodes = x[:3], x[3:], []
    for _ in range(PARTS):
        r, v, there = collocated(lambda j, p: sum(pulled(zonals, p)), r, v, STEP / PARTS)
        nodes.append(there)
    return np.concatenate([r, v]), np.stack(nodes)


def orbit_frame(zonals, x):
    r, v = x[:3], x[3:]
    h = np.cross(r, v)
    R, N = r / np.sqrt(r @ r), h / np.sqrt(h @ h)
    tilt = np.sqrt(r @ r) * (sum(pulled(zonals, r)) @ N) / np.sqrt(h @ h)
    return np.stack([R, np.cross(N, R), N]), np.array([tilt, 0, np.sqrt(h @ h) / (r @ r)])


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


def slopes(step, x, sizes):
    """Return the Jacobian (6, 6) by central differences."""
    columns = []
    for j, size in enumerate(sizes):
        aside = np.zeros(6, dtype=np.longdouble)
        aside[j] = size
        columns.append((step(x + aside) - step(x - aside)) / (2 * size))
    return np.stack(columns, axis=1).astype(float)


def assert_blocks(F, expected, rtol):
    """Compare Jacobians (6, 6) by their four blocks, whose units differ."""
    F, expected = F.reshape(2, 3, 2, 3), expected.reshape(2, 3, 2, 3)
    scale = np.abs(expected).max(axis=(1, 3), keepdims=True)
    assert (np.abs(F - expected) <= rtol * scale).all()


@each_field
def test_legs_are_frames_and_nodes_of_the_orbit(zonals):
    states, _ = chiefs(3)
    frames, nodes = legs_of(states, zonals)
    for x, frame, leg in zip(states, frames.reshape(-1, 2, 4, 3), nodes.reshape(3, PARTS, -1, 2, 3), strict=True):
        end, there = orbit_step(zonals, x)
        for (axes, rates), found in zip((orbit_frame(zonals, x), orbit_frame(zonals, end)), frame, strict=True):
            np.testing.assert_allclose(found[:3], axes.astype(float), rtol=0, atol=1e-14)
            np.testing.assert_allclose(found[3], rates.astype(float), rtol=0, atol=1e-12 * 1e-3)
        np.testing.assert_allclose(leg[:, :, 0], there.astype(float), rtol=0, atol=1e-8)
        bulge = np.array([[pulled(zonals, p)[1] for p in part] for part in there], dtype=float)
        np.testing.assert_allclose(leg[:, :, 1], bulge, rtol=1e-12, atol=1e-16)


def test_a_walk_is_step_after_step_and_back_again():
    x = chiefs(1)[0][0]
    there = kernels.chief_orbit.walk(x, 3, *INTEGRATION, PARTS, STEP / PARTS, field_of(ZONALS["J2 to J4"]))
    expected = x
    for found in there[1:]:
        expected, _ = orbit_step(ZONALS["J2 to J4"], expected)
        np.testing.assert_allclose(found, expected.astype(float), rtol=1e-14, atol=1e-8)
    back = kernels.chief_orbit.walk(there[3], 3, *INTEGRATION, PARTS, -STEP / PARTS, field_of(ZONALS["J2 to J4"]))
    np.testing.assert_allclose(back[3], x, rtol=1e-14, atol=1e-8)


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


def believed(x, P, fixes, before, after, zonals, Q, R):
    """Return estimates (K, 6) and the last covariance of one run, in which no step leads to the first epoch."""
    estimates = []
    for k, z in enumerate(fixes):
        if k:
            x = np.concatenate([x[:3], x[3:] + before[k] @ orbit_frame((), x)[0]])
            F = slopes(lambda each: orbit_step(zonals, each)[0], x.astype(np.longdouble), np.repeat([100.0, 0.1], 3))
            x = orbit_step(zonals, x)[0].astype(float)
            P = F @ P @ F.T + Q
            x = np.concatenate([x[:3], x[3:] + after[k] @ orbit_frame((), x)[0]]).astype(float)
        if not np.isnan(z).any():
            K = P @ np.linalg.inv(P + np.diag(R))
            x, P = x + K @ (z - x), K @ np.diag(R)
            P = (P + P.T) / 2
        estimates.append(x)
    return np.stack(estimates), P


def test_the_orbit_filter_is_the_extended_kalman_filter():
    zonals, runs, K = ZONALS["J2 to J4"], 3, 4
    m, _ = chiefs(runs)
    rng = np.random.default_rng(3)
    R, Q = np.repeat([900.0, 0.02], 3), np.diag(np.repeat([1.0, 1e-2], 3))
    P = np.repeat(np.diag(np.repeat([1e5, 1e1], 3))[None], runs, axis=0)
    paths = [kernels.chief_orbit.walk(x, K - 1, *INTEGRATION, PARTS, STEP / PARTS, field_of(zonals)) for x in m]
    fixes = np.stack(paths) + rng.normal(size=(runs, K, 6)) * np.sqrt(R)
    fixes[1, 2, 4], fixes[2, 0] = np.nan, np.nan
    before, after = rng.normal(size=(2, runs, K, 3))
    before[0], after[0] = 0.0, 0.0
    rest = Q, R, *INTEGRATION, PARTS, STEP / PARTS, field_of(zonals)
    estimates, covariance = kernels.chief_orbit.follow(fixes, before, after, False, m, P, *rest)
    for run in range(runs):
        expected, last = believed(m[run], P[run], fixes[run], before[run], after[run], zonals, Q, R)
        np.testing.assert_allclose(estimates[run], expected, rtol=1e-12, atol=1e-7)
        scale = np.sqrt(np.multiply.outer(np.diagonal(last), np.diagonal(last)))
        np.testing.assert_allclose(covariance[run] / scale, last / scale, rtol=0, atol=1e-9)
    still, _ = kernels.chief_orbit.follow(fixes[:1], NONE, NONE, False, m[:1], P[:1], *rest)
    assert np.array_equal(still[0], estimates[0])


@pytest.mark.parametrize("runs", [1, 31, 33, 200])
def test_bits_of_an_estimate_do_not_depend_on_the_block(runs):
    zonals, K = ZONALS["J2"], 6
    m, _ = chiefs(runs)
    R, Q = np.repeat([900.0, 0.02], 3), np.diag(np.repeat([1.0, 1e-2], 3))
    P = np.repeat(np.diag(np.repeat([1e5, 1e1], 3))[None], runs, axis=0)
    fixes = m[:, None] + np.random.default_rng(1).normal(size=(runs, K, 6))
    fixes[runs // 2, 3] = np.nan
    rest = Q, R, *INTEGRATION, PARTS, STEP / PARTS, field_of(zonals)
    whole = kernels.chief_orbit.follow(fixes, NONE, NONE, True, m, P, *rest)
    for run in {0, runs // 2, runs - 1}:
        one = slice(run, run + 1)
        half, last = kernels.chief_orbit.follow(fixes[one, :2].copy(), NONE, NONE, True, m[one], P[one], *rest)
        rest_of_it = kernels.chief_orbit.follow(
            fixes[one, 2:].copy(), NONE, NONE, True, half[:, -1].copy(), last, *rest
        )
        assert np.array_equal(np.concatenate([half, rest_of_it[0]], axis=1)[0], whole[0][run])
        assert np.array_equal(rest_of_it[1][0], whole[1][run])


@pytest.mark.parametrize(("n", "points"), [(1, 1), (2, 33), (6, 1), (6, 1000), (12, 50)])
def test_quadratic_map(n, points):
    rng = np.random.default_rng(n)
    F, D, x = rng.normal(size=(n, n)), rng.normal(size=(n, n, n)), rng.normal(size=(points, n))
    D += D.swapaxes(1, 2)
    moved, slope = kernels.quadratic_map.images(F, D, x), kernels.quadratic_map.jacobians(F, D, x)
    expected = x @ F.T + np.einsum("mij,bi,bj->bm", D, x, x)
    size = np.abs(x) @ np.abs(F.T) + np.einsum("mij,bi,bj->bm", np.abs(D), np.abs(x), np.abs(x))
    np.testing.assert_array_less(np.abs(moved - expected), 1e-14 * size)
    np.testing.assert_allclose(slope, F + 2 * np.einsum("mij,bj->bmi", D, x), rtol=1e-12, atol=1e-13)
    alone = kernels.quadratic_map.images(F, D, x[-1:].copy())
    assert np.array_equal(alone[0], moved[-1])
    assert np.array_equal(kernels.quadratic_map.jacobians(F, D, x[-1:].copy())[0], slope[-1])
