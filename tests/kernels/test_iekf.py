"""What the iterated extended Kalman filter works out at an iterate, against NumPy."""

import numpy as np
import pytest
from checks import SIZES, assert_close, check_runs_are_alone, covariances

from relnav_sim import kernels


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize(("n", "m", "runs"), SIZES)
def test_linearised_reading(n, m, runs, shared):
    rng = np.random.default_rng(15)
    H, P, R = rng.normal(size=(runs, m, n)), covariances(rng, runs, n), covariances(rng, 1 if shared else runs, m)
    d, residual = rng.normal(size=(runs, n)), rng.normal(size=(runs, m))
    HP, S, nu = kernels.iekf.linearised_reading(H, P, R, d, residual)
    assert_close(HP, H @ P)
    assert_close(S, H @ P @ H.swapaxes(1, 2) + R)
    assert_close(nu, residual + (H @ d[:, :, None])[:, :, 0])
    np.testing.assert_array_equal(S, S.swapaxes(1, 2))
    if runs > 1 and not shared:
        check_runs_are_alone(kernels.iekf.linearised_reading, (H, P, R, d, residual))
