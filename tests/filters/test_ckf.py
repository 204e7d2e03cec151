import numpy as np

from relnav_sim import FunctionMeasurement, LinearDynamics, create_filter, run_filter

F = np.kron(np.array([[1.0, 1.0], [0.0, 1.0]]), np.eye(2))
Q = np.kron(np.array([[0.25, 0.5], [0.5, 1.0]]) * 0.04, np.eye(2)) + 1e-4 * np.eye(4)
R = np.diag([4.0, 1e-4])


def polar(states, epoch=0):
    x, y = states[..., 0], states[..., 1]
    return np.stack([np.hypot(x, y), np.arctan2(y, x)], axis=-1)


def track(runs, epochs):
    rng = np.random.default_rng(1)
    x = np.tile([100.0, 50.0, -1.0, 0.5], (runs, 1))
    mean0 = x + rng.normal(size=(runs, 4)) * [10, 10, 1, 1]
    z = np.empty((runs, epochs, 2))
    for k in range(epochs):
        x = x @ F.T + rng.normal(size=(runs, 4)) @ np.linalg.cholesky(Q).T
        z[:, k] = polar(x) + rng.normal(size=(runs, 2)) * np.sqrt(np.diag(R))
    return z, mean0, np.diag([100.0, 100.0, 1.0, 1.0])


def cubature_filter(z, m, P):
    """Arasaratnam and Haykin 2009, appendix A, one run, as printed."""
    means, covariances = [], []
    for measured in z:
        m, P = F @ m, F @ P @ F.T + Q
        S = np.linalg.cholesky(P)
        points = [m + sign * np.sqrt(4) * S[:, i] for sign in (1, -1) for i in range(4)]
        images = [polar(point) for point in points]
        predicted = sum(images) / 8
        Pzz = sum(np.outer(image, image) for image in images) / 8 - np.outer(predicted, predicted) + R
        Pxz = sum(np.outer(p, i) for p, i in zip(points, images, strict=True)) / 8 - np.outer(m, predicted)
        W = Pxz @ np.linalg.inv(Pzz)
        m, P = m + W @ (measured - predicted), P - W @ Pzz @ W.T
        means.append(m)
        covariances.append(P)
    return np.array(means), np.array(covariances)


def test_equals_the_printed_algorithm():
    z, mean0, P0 = track(3, 40)
    measurement = FunctionMeasurement(polar, R, angles=(1,))
    history = run_filter(create_filter("ckf", LinearDynamics(F, Q), measurement), z, mean0, P0)
    for run in range(3):
        mean, covariance = cubature_filter(z[run], mean0[run], P0)
        np.testing.assert_allclose(history.mean[run], mean, rtol=0, atol=1e-9)
        np.testing.assert_allclose(history.covariance[run], covariance, rtol=0, atol=1e-9)


def test_is_the_unscented_filter_with_kappa_zero():
    z, mean0, P0 = track(5, 20)
    dynamics, measurement = LinearDynamics(F, Q), FunctionMeasurement(polar, R, angles=(1,))
    ckf = run_filter(create_filter("ckf", dynamics, measurement, gate_probability=0.9), z, mean0, P0)
    ukf = run_filter(
        create_filter("ukf", dynamics, measurement, alpha=1.0, beta=0.0, kappa=0.0, gate_probability=0.9), z, mean0, P0
    )
    assert np.array_equal(ckf.mean, ukf.mean)
    assert np.array_equal(ckf.covariance, ukf.covariance)
    assert np.array_equal(ckf.extras["rejected"], ukf.extras["rejected"])
    assert ckf.extras["rejected"].sum() > 0
