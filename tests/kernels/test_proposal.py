"""The unscented particle filter's proposals against the formulas, particle by particle."""

import numpy as np
import pytest

from relnav_sim import kernels


def wrapped(difference, angle):
    return np.where(angle, np.mod(difference + np.pi, 2 * np.pi) - np.pi, difference)


def some(runs, r, N, m, seed=0):
    rng = np.random.default_rng(seed)
    centre = rng.uniform(-3, 3, (runs, N, m))
    image = centre[None, :, None] + 0.3 * rng.standard_normal((r, runs, 2, N, m))
    z = centre[:, :1] + 0.2 * rng.standard_normal((runs, 1, m))
    A = rng.standard_normal((runs, m, m))
    return image, centre, z, np.arange(m) % 2 == 1, A @ A.swapaxes(1, 2) + 0.1 * np.eye(m), rng


def by_formula(image, centre, z, angle, R):
    """Return mean and covariance of one particle's q from images (r, 2, m), centre and z (m,), R (m, m)."""
    r = len(image)
    ahead, behind = wrapped(image - centre, angle).swapaxes(0, 1)
    C, mid = (ahead - behind) / (2 * np.sqrt(r)), (ahead + behind) / 2
    S = R + mid.T @ mid / r - np.outer(mid.mean(axis=0), mid.mean(axis=0)) + C.T @ C
    gain = C @ np.linalg.inv(S)
    return gain @ (wrapped(z - centre, angle) - mid.mean(axis=0)), np.eye(r) - gain @ C.T


@pytest.mark.parametrize(("runs", "r", "N", "m"), [(1, 1, 3, 1), (2, 6, 40, 3), (3, 4, 33, 4), (1, 12, 70, 2)])
def test_mean_covariance_and_ratio_of_every_proposal(runs, r, N, m):
    image, centre, z, angle, R, rng = some(runs, r, N, m)
    proposal = kernels.proposal.propose(image, centre, z, angle, R)
    at_zero, _ = kernels.proposal.draw(*proposal, np.zeros((runs, r, N)))
    columns = np.empty((runs, r, r, N))
    for j in range(r):
        unit = np.zeros((runs, r, N))
        unit[:, j] = 1
        columns[:, :, j] = kernels.proposal.draw(*proposal, unit)[0] - at_zero
    normals = rng.standard_normal((runs, r, N))
    xi, log_ratio = kernels.proposal.draw(*proposal, normals)
    for run in range(runs):
        for p in range(0, N, 5):
            mean, covariance = by_formula(image[:, run, :, p], centre[run, p], z[run, 0], angle, R[run])
            root = columns[run, :, :, p]
            np.testing.assert_allclose(at_zero[run, :, p], mean, rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(root @ root.T, covariance, rtol=1e-9, atol=1e-12)
            np.testing.assert_allclose(xi[run, :, p], mean + root @ normals[run, :, p], rtol=1e-9, atol=1e-10)
            # log p / q = log N(xi; 0, I) - log N(xi; mean, covariance)
            ratio = -0.5 * xi[run, :, p] @ xi[run, :, p] + 0.5 * normals[run, :, p] @ normals[run, :, p]
            ratio += 0.5 * np.linalg.slogdet(covariance)[1]
            np.testing.assert_allclose(log_ratio[run, p], ratio, rtol=1e-9, atol=1e-9)


def test_a_reading_for_each_particle_is_the_same_reading():
    image, centre, z, angle, R, _ = some(2, 6, 40, 3)
    one = kernels.proposal.propose(image, centre, z, angle, R)
    every = kernels.proposal.propose(image, centre, np.repeat(z, 40, axis=1), angle, R)
    for a, b in zip(one, every, strict=True):
        assert np.array_equal(a, b)


@pytest.mark.parametrize("roots", ["shared", "by run", "by particle"])
def test_sigma_points(roots):
    rng = np.random.default_rng(0)
    runs, n, r, N = 3, 6, 4, 50
    centres = rng.standard_normal((runs, n, N))
    G = rng.standard_normal({"shared": (1, 1), "by run": (runs, 1), "by particle": (runs, N)}[roots] + (n, r))
    every = np.broadcast_to(G, (runs, N, n, r))
    for j in range(r):
        offset = np.sqrt(r) * every[..., j].swapaxes(1, 2)
        expected = np.stack([centres + offset, centres - offset], axis=1)
        np.testing.assert_allclose(kernels.proposal.sigma_points(centres, G, j), expected, rtol=1e-12, atol=1e-13)


def test_bits_of_a_run_do_not_depend_on_the_block_and_a_broken_one_stays_alone():
    image, centre, z, angle, R, rng = some(35, 5, 41, 3)
    normals = rng.standard_normal((35, 5, 41))

    def outcome(rows):
        proposal = kernels.proposal.propose(image[:, rows].copy(), centre[rows], z[rows], angle, R[rows])
        return *proposal, *kernels.proposal.draw(*proposal, normals[rows])

    whole = outcome(slice(None))
    for run in (0, 12, 34):
        for alone, together in zip(outcome(slice(run, run + 1)), whole, strict=True):
            assert np.array_equal(alone[0], together[run])
    R[12] = -np.eye(3)
    R[20] = np.nan
    others = np.delete(np.arange(35), [12, 20])
    for broken, clean in zip(outcome(slice(None)), whole, strict=True):
        assert np.array_equal(broken[others], clean[others])
