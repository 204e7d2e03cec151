"""Kalman filters over many epochs in one go: beside their single steps, and beside plain NumPy."""

import numpy as np
import pytest
from checks import assert_close, covariances
from test_kalman import plain_update
from test_sight import VARIANCES, P, angles, derivatives, noise

from relnav_sim import kernels
from relnav_sim.astro.line_of_sight import mounting_matrix
from relnav_sim.measurements.converted_radar import attitude_map

M = mounting_matrix(30.0, -20.0, 75.0)
STILL = np.zeros((3, 3))


def problem(n, runs, epochs, seed=1, missing=0.0):
    """Return states that hardly move, some kilometres away, and readings of them."""
    rng = np.random.default_rng([n, runs, seed])
    m = np.concatenate([rng.normal(size=(runs, 3)) * 20 + [800.0, 5000.0, -300.0], rng.normal(size=(runs, n - 3))], 1)
    F = np.eye(n) + 1e-3 * rng.normal(size=(epochs, n, n)) * (rng.random((epochs, n, n)) < 0.5)
    z = np.empty((epochs, runs, 3))
    for b in range(runs):
        x = m[b] + rng.normal(size=n)
        for k in range(epochs):
            x = F[k] @ x
            z[k, b] = angles(x, M) + np.sqrt(VARIANCES) * rng.normal(size=3)
    read = rng.random((epochs, runs)) >= missing
    z[~read] = np.nan
    return m, covariances(rng, runs, n), F, covariances(rng, epochs, n) * 1e-2, z, read


def room(runs, n, epochs):
    return np.empty((epochs, runs, n)), np.empty((epochs, runs, n, n)), *np.full((2, epochs, runs), 7.0)


def in_one_go(given, attitude=P):
    m, z = given[0], given[4]
    out = room(*m.shape, len(z))
    no_extras = np.empty((len(z), 0, len(m)))
    return kernels.epochs.filtered(*given, False, M, attitude, VARIANCES[None], 1.0, *out, no_extras), out


def step_by_step(given, attitude=P):
    """Return the same by the kernels of an epoch, and the epoch at which a run is lost."""
    return stepped(given, lambda z, m: kernels.sight.linearised(z, m, M, attitude, VARIANCES))


def stepped(given, linearised):
    m, C, F, Q, z, read = given
    out = room(*m.shape, len(z))
    for k in range(len(z)):
        F_k, Q_k = (A[k : k + 1] if len(A) > 1 else A for A in (F, Q))
        m, C = kernels.kalman.predict_linear(m, C, F_k, Q_k)
        *updated, rows = kernels.kalman.update(m, C, *linearised(z[k], m))
        if read[k, rows].any():
            return k, out
        predicted = m, C, np.full(len(m), np.nan), np.zeros(len(m))
        found = [
            np.where(read[k].reshape(-1, *[1] * (a.ndim - 1)), a, b) for a, b in zip(updated, predicted, strict=True)
        ]
        m, C = found[:2]
        for series, one in zip(out, found, strict=True):
            series[k] = one
    return len(z), out


@pytest.mark.parametrize("r_scale", [1.0, 2.0])
@pytest.mark.parametrize(("n", "runs", "missing"), [(6, 1, 0.0), (8, 40, 0.3)])
def test_bits_of_converted_readings_are_those_of_single_steps(n, runs, missing, r_scale):
    m, C, F, Q, z, read = problem(n, runs, 12, missing=missing)
    z = m[:, :3] + z  # positions near those believed in
    coefficients = np.array([[1e-6, 4.0, 1e-6, 2.0, 1e-6, 3.0, 2e-6, 4.0, 1e-6, 1.0, 2e-6, 0.5, 1e-6, 2.0]])
    T = attitude_map(P)

    def linearised(z, m):
        R = kernels.converted_radar.covariances(m, M, coefficients, T)[:, 0]
        return np.ascontiguousarray(z - m[:, :3]), np.eye(3, n)[None], np.ascontiguousarray(R * r_scale)

    out = room(runs, n, 12)
    given = m, C, F, Q, z, read
    taken = kernels.epochs.filtered(*given, True, M, T, coefficients, r_scale, *out, np.empty((12, 0, runs)))
    stopped, expected = stepped(given, linearised)
    assert taken == stopped == 12
    for one, other in zip(out, expected, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("attitude", [P, STILL], ids=["attitude error", "none"])
@pytest.mark.parametrize("missing", [0.0, 0.4])
@pytest.mark.parametrize(("n", "runs"), [(6, 1), (6, 50), (8, 33), (12, 32)])
def test_bits_are_those_of_single_steps(n, runs, missing, attitude):
    given = problem(n, runs, 12, missing=missing)
    for F, Q in ((given[2], given[3]), (given[2][:1], given[3][:1])):
        same = given[0], given[1], F, Q, *given[4:]
        taken, found = in_one_go(same, attitude)
        stopped, expected = step_by_step(same, attitude)
        assert taken == stopped == 12
        for one, other in zip(found, expected, strict=True):
            np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("n", "runs"), [(6, 1), (8, 40), (12, 1000)])
def test_an_epoch_against_plain_numpy(n, runs):
    given = m, C, (F,), (Q,), (z,), _ = problem(n, runs, 1, seed=2)
    taken, found = in_one_go(given)
    assert taken == 1
    m, C = m @ F.T, F @ C @ F.T + Q
    h, H, R = (np.array([function(x, M) for x in m]) for function in (angles, derivatives, noise))
    nu = z - h
    nu[:, 1:] -= 2 * np.pi * np.rint(nu[:, 1:] / (2 * np.pi))
    for one, expected in zip(found, plain_update(m, C, nu, H, R), strict=True):
        assert_close(one[0], expected)


def test_it_stops_before_an_epoch_in_which_a_run_is_lost():
    given = problem(6, 40, 8, missing=0.0)
    given[4][5, 37] = np.nan  # from here on that run is no number, which is no loss
    assert in_one_go(given)[0] == 8
    given = problem(6, 40, 8, missing=0.0)
    wide = given[3].copy()
    wide[4] += 1e18 * np.eye(6)  # nothing of the noise is left in S
    spoilt = *given[:3], wide, *given[4:]
    taken, found = in_one_go(spoilt)
    stopped, expected = step_by_step(spoilt)
    assert taken == stopped == 4
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one[:4], other[:4])
    joseph = given[3].copy()
    joseph[4] += 1e10 * np.eye(6)  # S is WIDE: single steps go on by Joseph's form
    spoilt = *given[:3], joseph, *given[4:]
    assert in_one_go(spoilt)[0] == 4
    assert step_by_step(spoilt)[0] == 8
    unread = given[5].copy()
    unread[4] = False
    assert in_one_go((*given[:3], wide, given[4], unread))[0] == 5  # an epoch without readings loses nobody


def test_bits_of_a_run_do_not_depend_on_the_block():
    m, C, F, Q, z, read = problem(6, 70, 6, missing=0.2)
    _, whole = in_one_go((m, C, F, Q, z, read))
    for some in ([0], [31, 32], [69], list(range(5, 45))):
        _, own = in_one_go(
            (m[some], C[some], F, Q, np.ascontiguousarray(z[:, some]), np.ascontiguousarray(read[:, some]))
        )
        for one, many in zip(own, whole, strict=True):
            np.testing.assert_array_equal(one, many[:, some])
    spoilt = m.copy()
    spoilt[33] = np.nan
    _, broken = in_one_go((spoilt, C, F, Q, z, read))
    for one, many in zip(broken, whole, strict=True):
        np.testing.assert_array_equal(np.delete(one, 33, axis=1), np.delete(many, 33, axis=1))
