import numpy as np
import pytest

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.clohessy_wiltshire import cw_system, cw_transition
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.two_step_start import start_off_manifold

STARTS = ["linearised", "unscented", "closed_form"]
RADIUS = 7000e3
MEAN_MOTION = np.sqrt(398600.4e9 / RADIUS**3)
# Wei, Song and Zhang 2012: 3 sigma are 0.1 m and 0.05 deg.
RADAR_SIGMA = np.array([0.1, np.deg2rad(0.05), np.deg2rad(0.05)]) / 3


def chief_seen_from_deputy(states, epoch=0):
    """Range, in-plane and out-of-plane angle of the chief in the deputy's radial and along-track axes."""
    x, y, z = states[..., 0], states[..., 1], states[..., 2]
    squared = x**2 + y**2 + z**2
    in_plane = np.sqrt((RADIUS + x) ** 2 + y**2)
    distance = np.sqrt((RADIUS + x) ** 2 + y**2 + z**2)
    radial = -(RADIUS * x + squared) / distance
    along = -y * RADIUS / in_plane
    normal = -RADIUS * (RADIUS + x) * z / (distance * in_plane)
    return np.stack([np.sqrt(squared), np.arctan2(radial, along), np.arctan2(normal, np.hypot(radial, along))], axis=-1)


def start_up(runs, epochs, seed=1, position_sigma=200.0, velocity_sigma=0.3):
    rng = np.random.default_rng(seed)
    B = np.vstack([np.zeros((3, 3)), np.eye(3)])
    F, Q = van_loan(cw_system(MEAN_MOTION), B, 1e-12 * np.eye(3), 1.0)
    np.testing.assert_allclose(F, cw_transition(MEAN_MOTION, 1.0), rtol=1e-9, atol=1e-12)
    x = np.tile([300.0, -0.4 / MEAN_MOTION, -400.0, -0.2, -600 * MEAN_MOTION, 0.1], (runs, 1))
    P0 = np.diag([position_sigma**2] * 3 + [velocity_sigma**2] * 3)
    mean0 = x + rng.normal(size=(runs, 6)) @ np.sqrt(P0)
    root = np.linalg.cholesky(Q)
    truth = np.empty((runs, epochs, 6))
    for k in range(epochs):
        x = x @ F.T + rng.normal(size=(runs, 6)) @ root.T
        truth[:, k] = x
    z = chief_seen_from_deputy(truth) + rng.normal(size=(runs, epochs, 3)) * RADAR_SIGMA
    measurement = FunctionMeasurement(chief_seen_from_deputy, np.diag(RADAR_SIGMA**2), angles=(1, 2))
    return truth, z, mean0, P0, LinearDynamics(F, Q), measurement


def position_error(history, truth):
    return np.linalg.norm((history.mean - truth)[..., :3], axis=-1)


def test_start_up_from_a_prior_as_wide_as_the_range():
    truth, z, mean0, P0, dynamics, measurement = start_up(runs=100, epochs=30)
    errors = {}
    for name, kind, options in [
        ("ekf", "ekf", {}),
        ("iekf", "iekf", {}),
        *((start, "two_step", {"start": start}) for start in (*STARTS, "unscented_plain")),
    ]:
        history = run_filter(create_filter(kind, dynamics, measurement, **options), z, mean0, P0)
        errors[name] = position_error(history, truth)
        if name in ("unscented", "closed_form"):
            error = history.mean[:, -1] - truth[:, -1]
            nees = np.einsum("bi,bij,bj->b", error, np.linalg.inv(history.covariance[:, -1]), error)
            # The mean of 100 chi-square values of 6 degrees of freedom has standard deviation 0.35.
            assert abs(nees.mean() - 6) < 4 * 0.35
    last = {name: error[:, -1].mean() for name, error in errors.items()}
    assert last["iekf"] < 0.1
    assert last["unscented"] == pytest.approx(last["iekf"], rel=0.1)
    # Nearly all runs converge, but one that its sigma points left at the tangent, as the default start guards against.
    plain = np.sort(errors["unscented_plain"][:, -1])
    assert plain[:95].mean() == pytest.approx(np.sort(errors["iekf"][:, -1])[:95].mean(), rel=0.02)
    assert plain[-1] < last["ekf"] / 5
    assert last["closed_form"] == pytest.approx(last["iekf"], rel=0.1)
    assert last["linearised"] > 50 * last["unscented"]
    assert last["ekf"] > 50 * last["unscented"]
    # One reading fixes the position to 0.03 m along and twice 630 m times 2.9e-4 rad across the line of sight.
    assert errors["unscented"][:, 0].mean() < 0.3


def linear_problem(n, m, seed):
    rng = np.random.default_rng(seed)
    F = np.linalg.qr(rng.normal(size=(n, n)))[0] * 0.98
    root = rng.normal(size=(n, n)) * 0.1
    H = rng.normal(size=(m, n))
    R = np.diag(rng.uniform(0.1, 2.0, m))
    z = rng.normal(size=(5, 30, m)) * 3
    z[1, :4] = np.nan
    z[2, 10:20] = np.nan
    z[3] = np.nan
    P0 = np.diag(rng.uniform(0.5, 50.0, n))
    return LinearDynamics(F, root @ root.T), LinearMeasurement(H, R), z, rng.normal(size=(5, n)), P0


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("slack", [1e-6, 1.0, 1e4])
@pytest.mark.parametrize("n, m", [(6, 3), (1, 1), (2, 3)])
def test_linear_measurement_gives_the_kalman_filter(start, slack, n, m):
    dynamics, measurement, z, mean0, P0 = linear_problem(n, m, seed=2)
    kf = run_filter(create_filter("kf", dynamics, measurement), z, mean0, P0)
    two_step = run_filter(
        create_filter("two_step", dynamics, measurement, start=start, start_slack=slack), z, mean0, P0
    )
    sigma = np.sqrt(np.einsum("btii->bti", kf.covariance))
    assert (np.abs(two_step.mean - kf.mean) / sigma).max() < 1e-10
    difference = np.abs(two_step.covariance - kf.covariance) / (sigma[..., :, None] * sigma[..., None, :])
    assert difference.max() < 1e-10


@pytest.mark.parametrize("n, m", [(6, 3), (1, 1), (2, 3)])
def test_linear_measurement_gives_the_kalman_filter_with_the_plain_start_too(n, m):
    """y's covariance is then singular but for rounding, which no start adds to."""
    dynamics, measurement, z, mean0, P0 = linear_problem(n, m, seed=2)
    kf = run_filter(create_filter("kf", dynamics, measurement), z, mean0, P0)
    two_step = run_filter(create_filter("two_step", dynamics, measurement, start="unscented_plain"), z, mean0, P0)
    sigma = np.sqrt(np.einsum("btii->bti", kf.covariance))
    assert (np.abs(two_step.mean - kf.mean) / sigma).max() < 1e-8
    difference = np.abs(two_step.covariance - kf.covariance) / (sigma[..., :, None] * sigma[..., None, :])
    assert difference.max() < 1e-8


def test_equality_with_the_kalman_filter_lasts():
    dynamics, measurement, _, _, P0 = linear_problem(4, 2, seed=3)
    z = np.random.default_rng(4).normal(size=(2, 600, 2)) * 3
    kf, two_step = (run_filter(create_filter(name, dynamics, measurement), z, np.zeros(4), P0) for name in
                    ("kf", "two_step"))  # fmt: skip
    sigma = np.sqrt(np.einsum("btii->bti", kf.covariance))
    assert (np.abs(two_step.mean - kf.mean) / sigma).max() < 1e-10
    assert two_step.nis[:, 100:].mean() == pytest.approx(kf.nis[:, 100:].mean(), rel=0.05)


def quadratic(n, m, seed, curvature=1.0):
    """Return g(x) = x^T A_i x / 2 + H x, its Jacobian, and its second derivatives A_i."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(m, n, n))
    A = curvature * (A + A.swapaxes(1, 2)) / 2
    H = rng.normal(size=(m, n))

    def g(x, epoch=0):
        return np.einsum("mij,...i,...j->...m", A, x, x) / 2 + np.einsum("mi,...i->...m", H, x)

    def jacobian(x, epoch=0):
        return np.einsum("mij,...j->...mi", A, x) + H

    return g, jacobian, A


def textbook(z, x, Px, F, Q, R, g, G, y_extra, P_extra):
    """Haupt et al.'s recursion for one run, with explicit inverses and the noise part by subtraction."""
    n, m = len(x), len(R)

    def f(x):
        return np.concatenate([x, g(x)])

    def jacobian(x):
        return np.vstack([np.eye(n), G(x)])

    H = np.hstack([np.zeros((m, n)), np.eye(m)])
    means, covariances = [], []
    y = Py = None
    for k, measured in enumerate(z):
        xp, Pxp = F @ x, F @ Px @ F.T + Q
        if k == 0:
            yp, Pyp = f(xp), jacobian(xp) @ Pxp @ jacobian(xp).T
            yp[n:] += y_extra(Pxp)
            Pyp[n:, n:] += P_extra(Pxp)
        else:
            yp = y + f(xp) - f(x)
            Pyp = Py - jacobian(x) @ Px @ jacobian(x).T + jacobian(xp) @ Pxp @ jacobian(xp).T
        K = Pyp @ H.T @ np.linalg.inv(H @ Pyp @ H.T + R)
        y = yp + K @ (measured - H @ yp)
        J = np.eye(n + m) - K @ H
        Py = J @ Pyp @ J.T + K @ R @ K.T
        W = np.linalg.inv(Py)
        x = xp
        for _ in range(50):
            A = jacobian(x)
            x = x + np.linalg.solve(A.T @ W @ A, A.T @ W @ (y - f(x)))
        Px = np.linalg.inv(jacobian(x).T @ W @ jacobian(x))
        means.append(x)
        covariances.append(Px)
    return np.array(means), np.array(covariances)


def test_equals_the_textbook_recursion_on_quadratic_measurements():
    rng = np.random.default_rng(5)
    g, G, A = quadratic(3, 2, seed=6, curvature=0.3)
    F, Q, R = np.eye(3) + 0.02 * rng.normal(size=(3, 3)), 0.02 * np.eye(3), np.diag([0.2, 0.5])
    P0 = np.diag([0.3, 0.2, 0.4])
    mean0 = np.array([2.0, -1.0, 3.0]) + 0.3 * rng.normal(size=(4, 3))
    x, z = np.tile([2.0, -1.0, 3.0], (4, 1)), np.empty((4, 15, 2))
    for k in range(15):
        x = x @ F.T + rng.normal(size=(4, 3)) * np.sqrt(0.02)
        z[:, k] = g(x) + rng.normal(size=(4, 2)) * np.sqrt(np.diag(R))
    measurement = FunctionMeasurement(g, R, G)
    history = run_filter(
        create_filter("two_step", LinearDynamics(F, Q), measurement, start="closed_form", start_slack=0.1),
        z, mean0, P0,
    )  # fmt: skip
    for run in range(4):
        mean, covariance = textbook(
            z[run], mean0[run], P0, F, Q, R, g, G,
            lambda P: np.einsum("mij,ji->m", A, P) / 2,
            lambda P: np.einsum("pij,jk,qkl,li->pq", A, P, A, P) / 2 + 0.1 * R,
        )  # fmt: skip
        np.testing.assert_allclose(history.mean[run], mean, rtol=0, atol=1e-6)
        np.testing.assert_allclose(history.covariance[run], covariance, rtol=0, atol=1e-7)


def off_manifold(kind, g, jacobian, mean, P, floor, kappa=0.0):
    return start_off_manifold(kind, Gaussian(mean, P), g, lambda z, predicted: z - predicted, jacobian, floor, kappa)


def test_closed_form_start_has_the_moments_of_a_quadratic_under_a_gaussian():
    g, jacobian, _ = quadratic(3, 2, seed=7)
    rng = np.random.default_rng(8)
    root = rng.normal(size=(3, 3))
    mean, P, floor = rng.normal(size=(1, 3)), root @ root.T, 1e-9 * np.eye(2)
    off = off_manifold("closed_form", g, jacobian, mean, P[None], floor)
    samples = mean + rng.normal(size=(400_000, 3)) @ root.T
    beyond = g(samples) - g(mean) - (samples - mean) @ jacobian(mean)[0].T
    covariance = np.cov(beyond.T)
    sigma = np.sqrt(np.diag(covariance))
    assert (np.abs(off.mean_c[0] - beyond.mean(axis=0)) / sigma).max() < 5 / np.sqrt(400_000)
    # The kurtosis of a squared normal is 15, so its variance scatters by sqrt(14 / N) of itself.
    difference = np.abs((off.scatter[0] - covariance) / np.outer(sigma, sigma))
    assert difference.max() < 5 * np.sqrt(14 / 400_000)
    assert np.array_equal(off.regression, np.zeros((1, 3, 2)))
    np.testing.assert_allclose(off.covariance[0], P, rtol=1e-14)


def test_unscented_start_of_one_state_has_the_exact_mean_and_twice_the_variance():
    # kappa = 3 - n gives a Gaussian's fourth moment; the diagonal is added once more, as the start says.
    off = off_manifold(
        "unscented",
        lambda x: 3 * x**2,
        lambda x: 6 * x[..., None],
        np.array([[5.0]]),
        np.array([[[4.0]]]),
        np.array([[1e-9]]),
        kappa=2.0,
    )
    assert off.mean_c[0, 0] == pytest.approx(3 * 4)
    assert off.scatter[0, 0, 0] == pytest.approx(2 * 2 * (3 * 4) ** 2)


def sigma_point_moments(f, mean, P, kappa):
    """Return mean and covariance of f(x) by 2 n + 1 sigma points (Julier and Uhlmann; Liu et al. 2011), one by one."""
    n = len(mean)
    columns = np.linalg.cholesky((n + kappa) * P).T
    points = [mean, *(mean + c for c in columns), *(mean - c for c in columns)]
    weights = [kappa / (n + kappa), *([1 / (2 * (n + kappa))] * (2 * n))]
    images = [f(x) for x in points]
    centre = sum(w * y for w, y in zip(weights, images, strict=True))
    return centre, sum(w * np.outer(y - centre, y - centre) for w, y in zip(weights, images, strict=True))


@pytest.mark.parametrize("kappa", [0.0, 1.5])
def test_the_plain_start_is_what_the_sigma_points_say_of_y_and_nothing_else(kappa):
    rng = np.random.default_rng(12)
    root = rng.normal(size=(6, 6)) * [150.0, 150.0, 150.0, 0.3, 0.3, 0.3]
    mean, P = np.array([300.0, -371.0, -400.0, -0.2, -0.65, 0.1]), root.T @ root / 6
    measurement = FunctionMeasurement(chief_seen_from_deputy, np.diag(RADAR_SIGMA**2))
    G = measurement.jacobian(mean[None], 0)[0]
    off = start_off_manifold(
        "unscented_plain", Gaussian(mean[None], P[None]), lambda x: chief_seen_from_deputy(x), lambda a, b: a - b,
        lambda x: measurement.jacobian(x, 0), np.eye(3), kappa,
    )  # fmt: skip
    y, Py = sigma_point_moments(lambda x: np.concatenate([x, chief_seen_from_deputy(x)]), mean, P, kappa)
    K, V = off.regression[0], off.scatter[0]
    Px = off.covariance[0] + K @ V @ K.T
    cross = K @ V  # of x with c
    rebuilt = np.block([[Px, Px @ G.T + cross], [G @ Px + cross.T, G @ Px @ G.T + V + G @ cross + cross.T @ G.T]])
    scale = np.sqrt(np.diag(Py))
    assert np.abs((rebuilt - Py) / np.outer(scale, scale)).max() < 1e-9
    found = np.concatenate([mean + off.mean_x[0], chief_seen_from_deputy(mean) + off.mean_c[0] + G @ off.mean_x[0]])
    np.testing.assert_allclose(found, y, rtol=0, atol=1e-9 * scale.max())


def test_the_plain_start_gives_the_textbook_recursion_with_the_sigma_points_covariance():
    g, G, _ = quadratic(3, 2, seed=6, curvature=0.3)
    F, Q, R, P0 = np.eye(3), 0.02 * np.eye(3), np.diag([0.2, 0.5]), np.diag([0.3, 0.2, 0.4])
    z = g(np.tile([2.0, -1.0, 3.0], (1, 6, 1))) + np.random.default_rng(5).normal(size=(1, 6, 2)) * np.sqrt(np.diag(R))
    mean0 = np.array([2.3, -1.2, 2.8])
    found = run_filter(
        create_filter("two_step", LinearDynamics(F, Q), FunctionMeasurement(g, R, G), start="unscented_plain",
                      max_iterations=200),
        z, mean0, P0,
    )  # fmt: skip

    def beyond(P):
        return sigma_point_moments(lambda x: g(x) - g(mean0) - G(mean0) @ (x - mean0), mean0, P, 0.0)

    mean, covariance = textbook(z[0], mean0, P0, F, Q, R, g, G, lambda P: beyond(P)[0], lambda P: beyond(P)[1])
    np.testing.assert_allclose(found.mean[0], mean, rtol=0, atol=1e-6)
    np.testing.assert_allclose(found.covariance[0], covariance, rtol=0, atol=1e-7)


def test_slack_has_no_use_with_the_plain_start():
    dynamics, measurement, *_ = linear_problem(2, 1, seed=1)
    with pytest.raises(ValueError, match="start_slack has no use with start: unscented_plain"):
        create_filter("two_step", dynamics, measurement, start="unscented_plain", start_slack=2.0)


def test_unscented_start_keeps_the_prior_of_x_and_its_covariance_with_the_curvature():
    P = np.array([[[4.0]]])
    off = off_manifold(
        "unscented", lambda x: x**3, lambda x: 3 * x[..., None] ** 2, np.zeros((1, 1)), P, np.eye(1), kappa=2.0
    )
    K, V = off.regression, off.scatter
    np.testing.assert_allclose(off.covariance + K @ V @ K.swapaxes(1, 2), P, rtol=1e-12)
    # E[x x^3] = 3 P^2: the fourth moment is exact.
    assert (K @ V)[0, 0, 0] == pytest.approx(3 * 16)


@pytest.mark.parametrize("start", STARTS)
def test_start_waits_for_the_first_measurement(start):
    _, z, mean0, P0, dynamics, measurement = start_up(runs=4, epochs=12, position_sigma=20.0)
    late = z.copy()
    late[1, :5] = np.nan
    f = create_filter("two_step", dynamics, measurement, start=start)
    mixed, prompt = run_filter(f, late, mean0, P0), run_filter(f, z, mean0, P0)
    assert np.array_equal(mixed.mean[[0, 2, 3]], prompt.mean[[0, 2, 3]])
    # Before it the belief is the propagated prior; after it, the filter that starts there.
    predicted = run_filter(create_filter("kf", dynamics, measurement), late[1:2], mean0[1:2], P0)
    np.testing.assert_allclose(mixed.mean[1, :5], predicted.mean[0, :5], rtol=1e-14)
    np.testing.assert_allclose(mixed.covariance[1, :5], predicted.covariance[0, :5], rtol=1e-13)
    there = run_filter(f, late[1:2, 5:], mixed.mean[1:2, 4], mixed.covariance[1:2, 4])
    np.testing.assert_allclose(mixed.mean[1, 5:], there.mean[0], rtol=0, atol=1e-9)


def test_gap_in_the_measurements_is_prediction():
    _, z, mean0, P0, dynamics, measurement = start_up(runs=3, epochs=20, position_sigma=20.0)
    z[0, 8:14] = np.nan
    history = run_filter(create_filter("two_step", dynamics, measurement), z, mean0, P0)
    F = dynamics.transition(mean0, None)
    for k in range(8, 14):
        np.testing.assert_allclose(history.mean[0, k], F @ history.mean[0, k - 1], rtol=1e-13)
    assert np.isnan(history.nis[0, 8:14]).all()
    assert np.isfinite(history.nis[0, 14:]).all()


@pytest.mark.parametrize("start", ["unscented", "closed_form"])
def test_velocity_known_exactly(start):
    truth, z, mean0, _, dynamics, measurement = start_up(runs=20, epochs=10, velocity_sigma=1e-9)
    still = LinearDynamics(dynamics.transition(mean0, None), np.zeros((6, 6)))
    history = run_filter(
        create_filter("two_step", still, measurement, start=start), z, mean0, np.diag([200.0**2] * 3 + [0.0] * 3)
    )
    assert np.isfinite(history.mean).all()
    assert position_error(history, truth)[:, -1].mean() < 0.1


def test_sensor_that_moves():
    # Ranges from a platform on a circle: h depends on the epoch.
    def ranges(states, epoch):
        post = 300.0 * np.array([np.cos(0.05 * epoch), np.sin(0.05 * epoch)])
        return np.linalg.norm(states[..., :2] - post, axis=-1, keepdims=True)

    rng = np.random.default_rng(9)
    F = np.kron(np.array([[1.0, 1.0], [0.0, 1.0]]), np.eye(2))
    dynamics, measurement = LinearDynamics(F, 1e-6 * np.eye(4)), FunctionMeasurement(ranges, [[0.01]])
    truth = np.empty((50, 100, 4))
    x = np.tile([20.0, -10.0, 0.1, 0.2], (50, 1))
    for k in range(100):
        x = x @ F.T + 1e-3 * rng.normal(size=(50, 4))
        truth[:, k] = x
    z = np.stack([ranges(truth[:, k], k) for k in range(100)], axis=1) + 0.1 * rng.normal(size=(50, 100, 1))
    P0 = np.diag([25.0, 25.0, 0.01, 0.01])
    mean0 = np.array([20.0, -10.0, 0.1, 0.2]) + rng.normal(size=(50, 4)) @ np.sqrt(P0)
    two_step, iekf = (run_filter(create_filter(name, dynamics, measurement), z, mean0, P0) for name in
                      ("two_step", "iekf"))  # fmt: skip
    rms = [np.sqrt(np.square(h.mean[:, -1, :2] - truth[:, -1, :2]).sum(axis=1).mean()) for h in (two_step, iekf)]
    assert rms[0] < 0.5
    assert rms[0] == pytest.approx(rms[1], rel=0.1)


def test_bits_of_a_run_do_not_depend_on_its_block():
    _, z, mean0, P0, dynamics, measurement = start_up(runs=30, epochs=8)
    z[7, :3] = np.nan
    for start in STARTS:
        f = create_filter("two_step", dynamics, measurement, start=start)
        together = run_filter(f, z, mean0, P0)
        for run in (0, 7, 29):
            alone = run_filter(f, z[run : run + 1], mean0[run : run + 1], P0)
            assert np.array_equal(alone.mean[0], together.mean[run])
            assert np.array_equal(alone.covariance[0], together.covariance[run])
            assert np.array_equal(alone.log_likelihood[0], together.log_likelihood[run])


def test_angles_across_the_cut():
    # The same geometry turned about the line of sight's normal, so that the azimuth runs through +-pi.
    _, z, mean0, P0, dynamics, measurement = start_up(runs=10, epochs=20)
    offset = np.pi - z[0, 10, 1]

    def turned(states, epoch):
        seen = chief_seen_from_deputy(states)
        seen[..., 1] = np.arctan2(np.sin(seen[..., 1] + offset), np.cos(seen[..., 1] + offset))
        return seen

    z_turned = z.copy()
    z_turned[..., 1] = np.arctan2(np.sin(z[..., 1] + offset), np.cos(z[..., 1] + offset))
    assert (np.abs(np.diff(z_turned[..., 1], axis=1)) > 6).any()
    cut = FunctionMeasurement(turned, measurement.noise(mean0, 0), angles=(1, 2))
    for start in ("unscented", "closed_form"):
        plain, across = (run_filter(create_filter("two_step", dynamics, h, start=start), z_h, mean0, P0) for h, z_h in
                         ((measurement, z), (cut, z_turned)))  # fmt: skip
        np.testing.assert_allclose(across.mean, plain.mean, rtol=0, atol=1e-5)


def test_gate_rejects_before_and_after_the_start():
    truth, z, mean0, P0, dynamics, measurement = start_up(runs=3, epochs=10, position_sigma=20.0)
    z[0, 0, 0] += 1e4
    z[1, 5, 0] += 1e4
    history = run_filter(create_filter("two_step", dynamics, measurement, gate_probability=0.9999), z, mean0, P0)
    assert history.extras["rejected"][0, 0] == 1
    assert history.extras["rejected"][1, 5] == 1
    assert history.extras["rejected"].sum() == 2
    assert position_error(history, truth)[:, -1].max() < 1.0


@pytest.mark.parametrize("options", [{"start": "random"}, {"start_slack": 0.0}, {"start_kappa": -1.0}])
def test_options_out_of_range_are_refused(options):
    _, _, _, _, dynamics, measurement = start_up(runs=1, epochs=1)
    with pytest.raises(ValueError, match="two_step"):
        create_filter("two_step", dynamics, measurement, **options)
