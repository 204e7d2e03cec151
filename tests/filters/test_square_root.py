import numpy as np

from relnav_sim.filters.square_root import Whitener, semidefinite_root, squares, triangular_root


def test_triangular_root_is_lower_with_positive_diagonal():
    M = np.random.default_rng(1).normal(size=(50, 4, 9))
    L = triangular_root(M)
    np.testing.assert_allclose(L @ L.swapaxes(1, 2), M @ M.swapaxes(1, 2), rtol=0, atol=1e-13)
    assert np.array_equal(L, np.tril(L))
    assert (np.einsum("bii->bi", L) > 0).all()


def test_semidefinite_root_of_a_definite_matrix_is_its_cholesky_factor():
    M = np.random.default_rng(2).normal(size=(50, 5, 8))
    P = M @ M.swapaxes(1, 2)
    np.testing.assert_allclose(semidefinite_root(P), np.linalg.cholesky(P), rtol=1e-12, atol=1e-13)


def test_semidefinite_root_of_rank_two():
    M = np.random.default_rng(3).normal(size=(50, 4, 2))
    P = M @ M.swapaxes(1, 2)
    L = semidefinite_root(P)
    np.testing.assert_allclose(L @ L.swapaxes(1, 2), P, rtol=0, atol=1e-12)
    assert np.array_equal(L, np.tril(L))


def test_semidefinite_root_marks_what_is_not_semidefinite_in_its_own_run():
    P = np.stack([np.eye(2), np.diag([1.0, -1.0]), np.full((2, 2), np.nan), np.zeros((2, 2))])
    L = semidefinite_root(P)
    assert np.isfinite(L).all(axis=(1, 2)).tolist() == [True, False, False, True]


def test_whitener_finds_a_solution_in_the_range():
    rng = np.random.default_rng(4)
    M = rng.normal(size=(30, 5, 3))
    M[:, 2] = 0.0  # a component known exactly
    scale = np.array([1e3, 1.0, 1.0, 1e-3, 1e2])[:, None]
    P = (scale * M) @ (scale * M).swapaxes(1, 2)
    B = P @ (rng.normal(size=(30, 5, 2)) / scale)
    X = Whitener(P).solve(B)
    np.testing.assert_allclose((P @ X) / scale, B / scale, rtol=0, atol=1e-9)
    assert np.abs(X[:, 2]).max() < 1e-12
    definite = P + np.eye(5)
    np.testing.assert_allclose(Whitener(definite).solve(B), np.linalg.solve(definite, B), rtol=1e-7, atol=1e-9)


def test_whitener_measures_lengths_in_the_range():
    rng = np.random.default_rng(6)
    M = np.concatenate([rng.normal(size=(30, 5, 3)), np.zeros((30, 5, 3))], axis=2)
    M[::2] = rng.normal(size=(15, 5, 6))  # every other run has full rank
    P = M @ M.swapaxes(1, 2)
    v = np.einsum("bij,bj->bi", P, rng.normal(size=(30, 5)))
    expected = np.einsum("bi,bij,bj->b", v, np.linalg.pinv(P, rcond=1e-10), v)
    np.testing.assert_allclose(
        squares(Whitener(P), v, Whitener(np.ones((len(v), 1, 1))), np.ones((len(v), 1))), 1 + expected, rtol=1e-6
    )


def test_bits_of_a_run_do_not_depend_on_the_others():
    rng = np.random.default_rng(5)
    M = rng.normal(size=(40, 6, 8))
    M[::3, :, 4:] = 0.0  # every third run has rank four
    P = M @ M.swapaxes(1, 2)
    B = rng.normal(size=(40, 6, 2))
    L, X, T = semidefinite_root(P), Whitener(P).solve(B), triangular_root(M)
    for run in (0, 1, 38, 39):
        rows = slice(run, run + 1)
        assert np.array_equal(semidefinite_root(P[rows])[0], L[run])
        assert np.array_equal(Whitener(P[rows]).solve(B[rows])[0], X[run])
        assert np.array_equal(triangular_root(M[rows])[0], T[run])
