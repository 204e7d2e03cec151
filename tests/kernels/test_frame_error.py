"""What an error of the orbit frame adds to the noise, against the matrices written out."""

import numpy as np
import pytest
from checks import check_runs_are_alone, cross_matrix

from relnav_sim import kernels


@pytest.mark.parametrize("shared", [True, False])
@pytest.mark.parametrize(("runs", "m", "n"), [(1, 1, 6), (7, 6, 8), (33, 12, 12), (1000, 3, 6)])
def test_share_of_the_frame(runs, m, n, shared):
    rng = np.random.default_rng([runs, m, n])
    states = rng.standard_normal((runs, n)) * np.resize([900.0] * 3 + [0.5] * 3, n)
    H, A = rng.standard_normal((1 if shared else runs, m, n)), rng.standard_normal((1 if shared else runs, 6, 6))
    P = A @ A.swapaxes(1, 2) * 1e-10
    P = (P + P.swapaxes(1, 2)) / 2
    R = kernels.frame_error.added(H, states, P)
    for run, x in enumerate(states):
        D = np.block([[cross_matrix(x[:3]), np.zeros((3, 3))], [cross_matrix(x[3:6]), cross_matrix(x[:3])]])
        G = H[0 if shared else run][:, :6] @ D
        expected = G @ P[0 if shared else run] @ G.T
        np.testing.assert_allclose(R[run], expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(R, R.swapaxes(1, 2))
    if runs > 1 and not shared:
        check_runs_are_alone(lambda x, H, P: kernels.frame_error.added(H, x, P), (states, H, P))
