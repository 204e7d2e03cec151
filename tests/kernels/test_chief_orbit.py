"""The chief's orbit, its legs and its filter, against plain NumPy in 64 bits of mantissa."""

import numpy as np
import pytest
from checks import check_runs_are_alone
from plain_orbits import (
    INTEGRATION,
    PARTS,
    STEP,
    ZONALS,
    chiefs,
    field_of,
    legs_of,
    orbit_frame,
    orbit_step,
    pulled,
    slopes,
)

from relnav_sim import kernels

each_field = pytest.mark.parametrize("zonals", ZONALS.values(), ids=list(ZONALS))
NONE = np.empty((1, 0, 3))


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


def test_a_leg_is_its_own():
    check_runs_are_alone(lambda states: legs_of(states, ZONALS["J2 to J4"]), (chiefs(40)[0],))


def test_a_walk_is_step_after_step_and_back_again():
    x = chiefs(1)[0][0]
    there = kernels.chief_orbit.walk(x, 3, *INTEGRATION, PARTS, STEP / PARTS, field_of(ZONALS["J2 to J4"]))
    expected = x
    for found in there[1:]:
        expected, _ = orbit_step(ZONALS["J2 to J4"], expected)
        np.testing.assert_allclose(found, expected.astype(float), rtol=1e-14, atol=1e-8)
    back = kernels.chief_orbit.walk(there[3], 3, *INTEGRATION, PARTS, -STEP / PARTS, field_of(ZONALS["J2 to J4"]))
    np.testing.assert_allclose(back[3], x, rtol=1e-14, atol=1e-8)


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
