"""The likelihood of many states against its formula."""

import numpy as np
import pytest
from checks import check_runs_are_alone

from relnav_sim import kernels


@pytest.mark.parametrize(("runs", "m", "N"), [(1, 1, 5), (3, 2, 100), (2, 3, 500), (4, 6, 33)])
@pytest.mark.parametrize("shared", [True, False])
def test_likelihood(runs, m, N, shared):
    rng = np.random.default_rng([runs, N])
    A = rng.standard_normal((1 if shared else runs, m, m))
    R = A @ A.swapaxes(1, 2) + np.eye(m)
    z, predicted = rng.standard_normal((runs, m)), 3 * rng.standard_normal((runs, N, m))
    angle = np.arange(m) % 2 == 1
    difference = z[:, None] - predicted
    difference[..., angle] = np.mod(difference[..., angle] + np.pi, 2 * np.pi) - np.pi
    every = np.broadcast_to(R, (runs, m, m))
    nis = np.einsum("bpi,bij,bpj->bp", difference, np.linalg.inv(every), difference)
    expected = -0.5 * (nis + np.linalg.slogdet(2 * np.pi * every)[1][:, None])
    found = kernels.likelihood.gaussian(z, predicted, angle, R)
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)
    if not shared and runs > 1:
        check_runs_are_alone(lambda z, h, R: kernels.likelihood.gaussian(z, h, angle, R), (z, predicted, R))
        R[1] = -np.eye(m)
        broken = kernels.likelihood.gaussian(z, predicted, angle, R)
        assert np.isnan(broken[1]).all()
        assert np.array_equal(np.delete(broken, 1, axis=0), np.delete(found, 1, axis=0))
