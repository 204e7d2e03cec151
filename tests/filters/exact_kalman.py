"""The Kalman filter in 60 digits, with a pseudo-inverse where the innovation covariance is singular."""

import mpmath as mp
import numpy as np

mp.mp.dps = 60
ZERO = mp.mpf(10) ** -40


def exact_kalman(F, Q, H, R, z, mean, covariance):
    """Return means (T, n) and covariances (T, n, n); the prior is one step before z (T, m)."""
    F, Q, H, R, P = (mp.matrix(np.atleast_2d(A).tolist()) for A in (F, Q, H, R, covariance))
    m = mp.matrix(np.asarray(mean, float)[:, None].tolist())
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
        m, P = m + K * (mp.matrix(row[:, None].tolist()) - H * m), P - K * S * K.T
        means.append([float(x) for x in m])
        covariances.append([[float(P[i, j]) for j in range(P.cols)] for i in range(P.rows)])
    return np.array(means), np.array(covariances)
