"""The observability of linear problems whose answer is known, and against plain matrix algebra."""

import numpy as np
import pytest

from relnav_sim.crlb.observability import direction_in_words, observability
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition

N, STEP_S, T = 1.1e-3, 20.0, 200
F = cw_transition(N, STEP_S)
START = np.array([100.0, -1500.0, 80.0, 0.05, -0.2, 0.1])
PRIOR = np.diag(np.square([100.0, 100, 100, 0.1, 0.1, 0.1]))


def flown(kick=0.0):
    """Return the states after each step, with a known change of the state in the middle."""
    states = [START]
    for k in range(T):
        states.append(F @ states[-1] + (kick if k == T // 2 else 0.0))
    return np.array(states[1:])


def lines_of_sight(states):
    r = np.linalg.norm(states[:, :3], axis=1, keepdims=True)
    return r, states[:, :3] / r


def bearings(states, sigma=1e-3):
    """The information of a direction: across the line of sight, sigma in rad."""
    r, u = lines_of_sight(states)
    M = np.zeros((len(states), 6, 6))
    M[:, :3, :3] = (np.eye(3) - u[:, :, None] * u[:, None]) / (sigma * r[:, :, None]) ** 2
    return M


def ranges(states, sigma=1.0):
    _, u = lines_of_sight(states)
    M = np.zeros((len(states), 6, 6))
    M[:, :3, :3] = u[:, :, None] * u[:, None] / sigma**2
    return M


def test_bearings_alone_leave_exactly_the_state_itself():
    found = observability(F, bearings(flown()), PRIOR)
    assert found.ratio == pytest.approx(np.ones(T), abs=1e-9)
    assert found.ratios[1] < 0.05  # every other direction is known
    cosine = found.direction @ START / np.linalg.norm(found.direction) / np.linalg.norm(START)
    assert abs(cosine) == pytest.approx(1, abs=1e-9)
    words = direction_in_words(found.direction, PRIOR, START)
    assert words.startswith("the state itself, that is its scale and with it the range (mostly along-track position")


def test_a_known_manoeuvre_or_a_range_makes_it_observable():
    kick = np.array([0, 0, 0, 0.5, 0, 0])
    moved = observability(F, bearings(flown(kick)), PRIOR)
    assert moved.ratio[T // 2 - 1] == pytest.approx(1, abs=1e-9)
    assert moved.ratio[-1] < 0.1
    with_range = observability(F, bearings(flown()) + ranges(flown(), 10.0), PRIOR)
    assert with_range.ratio[-1] < 0.1
    assert (np.diff(with_range.ratio) <= 1e-12).all()  # readings take nothing away


def test_a_mirror_image_is_not_seen():
    """Range alone can't tell a coplanar orbit from its image through the chief, which no linear test sees."""
    coplanar = START * [1, 1, 0, 1, 1, 0]
    here, there = coplanar, -coplanar
    M = []
    for _ in range(T):
        here, there = F @ here, F @ there
        assert np.linalg.norm(here[:3]) == pytest.approx(np.linalg.norm(there[:3]), rel=1e-12)
        M.append(ranges(here[None])[0])
    plane = np.ix_([0, 1, 3, 4], [0, 1, 3, 4])
    assert observability(F[plane], np.array(M)[:, *plane], PRIOR[plane]).ratio[-1] < 0.2


def test_it_is_the_posterior_over_the_prior_of_plain_algebra():
    rng = np.random.default_rng(3)
    n, m = 7, 4
    A = rng.normal(size=(n, n))
    P = A @ A.T + np.eye(n)
    steps = np.eye(n) + 0.1 * rng.normal(size=(5, n, n))
    H = rng.normal(size=(5, 1, n))
    M = H.swapaxes(1, 2) @ H
    found = observability(steps, M, P, leading=m)
    G, gramian = np.eye(n), np.zeros((n, n))
    for k in range(5):
        G = steps[k] @ G
        gramian += G.T @ M[k] @ G
        posterior = np.linalg.inv(np.linalg.inv(P) + gramian)
        # The greatest of u^T posterior u over u^T prior u: a generalised eigenvalue.
        values = np.linalg.eigvals(np.linalg.solve(P[:m, :m], posterior[:m, :m])).real
        assert found.ratio[k] == pytest.approx(np.sqrt(values.max()), rel=1e-9)
    assert found.ratios == pytest.approx(np.sqrt(np.sort(values)[::-1]), rel=1e-9)
    assert found.sigma_ratio == pytest.approx(np.sqrt(np.diag(posterior) / np.diag(P)), rel=1e-9)
    u = found.direction[:m]
    assert u @ np.linalg.solve(P[:m, :m], u) == pytest.approx(1, rel=1e-9)


def test_a_bias_that_no_reading_tells_from_the_range_is_found():
    """A target at rest straight ahead: range and bias add up in every reading."""
    M = np.zeros((50, 3, 3))
    M[:] = np.outer([1, 0, 1], [1, 0, 1]) + np.diag([0, 1.0, 0])
    prior = np.diag([100.0**2, 100.0**2, 30.0**2])
    found = observability(np.eye(3), M, prior)
    assert found.ratio[-1] > 0.999
    assert found.direction[0] == pytest.approx(-found.direction[2], rel=1e-3) and abs(found.direction[1]) < 1e-6
    asked = observability(np.eye(3), M, prior, leading=2)  # the range is then known to the bias's 30 m
    assert asked.ratio[-1] == pytest.approx(30 / np.hypot(100, 30), rel=1e-3)
    assert asked.direction[2] == pytest.approx(-asked.direction[0], rel=1e-3)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="informations"):
        observability(np.eye(2), np.eye(2), np.eye(2))
    with pytest.raises(ValueError, match="transitions"):
        observability(np.zeros((3, 2, 2)), np.zeros((5, 2, 2)), np.eye(2))


def test_a_direction_is_named_by_its_parts_in_prior_sigmas():
    sigmas = np.array([1.0, 1, 1, 1e-3, 1e-3, 1e-3, 10])
    words = direction_in_words([0, 0.8, 0, 0, 0, 7e-4, -9], np.diag(sigmas**2), START, ["range_bias"])
    assert words == "range_bias, along-track position and normal velocity"


def test_the_course_against_plain_matrix_algebra():
    """Ratios of all directions after each epoch: the posterior with the prior's information, in units of the prior."""
    M = bearings(flown()) + ranges(flown(), 200.0)
    found = observability(F, M, PRIOR)
    L, information, Phi = np.linalg.cholesky(PRIOR), np.zeros((6, 6)), np.eye(6)
    for k in range(0, T):
        Phi = F @ Phi
        information = information + Phi.T @ M[k] @ Phi
        if k in (0, 3, 40, T - 1):
            values, vectors = np.linalg.eigh(np.eye(6) + L.T @ information @ L)
            np.testing.assert_allclose(found.course[k], 1 / np.sqrt(values), rtol=1e-6)
            assert found.course[k, 0] == pytest.approx(found.ratio[k], rel=1e-12)
            if k:  # after a single reading the weakest direction is one of several
                weakest = L @ vectors[:, 0]
                assert abs(np.linalg.solve(L, found.directions[k]) @ vectors[:, 0]) == pytest.approx(1, abs=1e-6)
                assert found.directions[k] @ weakest / np.linalg.norm(found.directions[k]) / np.linalg.norm(
                    weakest
                ) == pytest.approx(np.sign(found.directions[k] @ weakest), abs=1e-6)
    np.testing.assert_allclose(found.directions[-1], found.direction, rtol=1e-9)
