"""What is counted of every estimate, against plain NumPy."""

import numpy as np
import pytest
from checks import covariances

from relnav_sim import kernels


def estimates(runs, epochs, seed=4):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(runs, epochs, 6)), covariances(rng, epochs, runs, 6)


@pytest.mark.parametrize(("runs", "epochs"), [(1, 1), (1, 40), (50, 7), (33, 33)])
def test_normalised_errors_against_plain_numpy(runs, epochs):
    error, covariance = estimates(runs, epochs)
    nees, definite, finite = kernels.statistics.normalised_errors(error, covariance)
    assert definite.all()
    assert finite.all()
    for part, place in ((0, slice(0, 6)), (1, slice(0, 3)), (2, slice(3, 6))):
        P = covariance.swapaxes(0, 1)[..., place, place]
        expected = np.einsum("bki,bki->bk", error[..., place], np.linalg.solve(P, error[..., place, None])[..., 0])
        np.testing.assert_allclose(nees[part], expected, rtol=1e-12)


def test_normalised_errors_tell_what_is_no_covariance():
    error, covariance = estimates(5, 9)
    sound = kernels.statistics.normalised_errors(error, covariance)
    covariance[3, 2] *= -1
    covariance[4, 2, 0, 5] = np.inf  # in the triangle that is not factored
    nees, definite, finite = kernels.statistics.normalised_errors(error, covariance)
    assert np.argwhere(~definite).tolist() == [[2, 3]]
    assert np.argwhere(~finite).tolist() == [[2, 4]]
    others = np.ones((5, 9), dtype=bool)
    others[2, 3] = False
    np.testing.assert_array_equal(nees[:, others], sound[0][:, others])


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_doubtful_runs(bad):
    error, covariance = estimates(6, 9)
    mean = np.ascontiguousarray(error.swapaxes(0, 1))
    assert not kernels.statistics.doubtful(mean, covariance).any()
    mean[8, 1, 5], covariance[0, 2, 5, 0], covariance[3, 4, 1, 1] = bad, bad, -1e-9
    assert np.flatnonzero(kernels.statistics.doubtful(mean, covariance)).tolist() == [1, 2, 4]


def test_a_run_is_its_own():
    error, covariance = estimates(40, 9)
    whole = kernels.statistics.normalised_errors(error, covariance)
    for run in (0, 17, 39):
        own = slice(run, run + 1)
        alone = kernels.statistics.normalised_errors(error[own], covariance[:, own].copy())
        for one, many in zip(alone, whole, strict=True):
            np.testing.assert_array_equal(one, many[..., own, :])
