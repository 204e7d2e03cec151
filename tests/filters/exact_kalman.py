"""The Kalman filter in 60 digits, with a pseudo-inverse where the innovation covariance is singular."""

from functools import cache

import mpmath as mp
import numpy as np

mp.mp.dps = 60
ZERO = mp.mpf(10) ** -40


def exact_kalman(F, Q, H, R, z, mean, covariance):
    """Return means (T, n) and covariances (T, n, n); the prior is one step before z (T, m)."""
    column = np.asarray(mean, float)[:, None]
    return _of_numbers(*(tuple(map(tuple, np.atleast_2d(A).tolist())) for A in (F, Q, H, R, z, column, covariance)))


@cache  # many filters are held against the same answer
def _of_numbers(F, Q, H, R, z, mean, covariance):
    F, Q, H, R, m, P = map(mp.matrix, (F, Q, H, R, mean, covariance))
    means, covariances = [], []
    for row in z:
        m, P = F * m, F * P * F.T + Q
        S = H * P * H.T + R
        values, vectors = mp.eigsy(S)
        inverse = mp.zeros(len(values))
        for i, value in enumerate(values):
            if value > ZERO * max(values) and value > ZERO:
                inverse[i, i] = 1 / value
        K = P * H.T * vectors * inverse * vectors.T
        m, P = m + K * (mp.matrix(row) - H * m), P - K * S * K.T
        means.append([float(x) for x in m])
        covariances.append([[float(P[i, j]) for j in range(P.cols)] for i in range(P.rows)])
    answer = np.array(means), np.array(covariances)
    for array in answer:
        array.flags.writeable = False
    return answer
