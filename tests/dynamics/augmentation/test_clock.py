"""A clock's bias and drift as augmented states: their exact motion, and where they add."""

import numpy as np
import pytest
from scipy.linalg import expm

from relnav_sim import LinearDynamics
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics
from relnav_sim.dynamics.augmentation.extension import extension, sensor_of
from relnav_sim.dynamics.augmentation.kinds import ClockOptions, RangeBiasOptions
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.dynamics.interface import Step
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.measurements.augmented import AugmentedMeasurement
from relnav_sim.measurements.interface import MeasurementDefaults
from relnav_sim.measurements.ranging import crosslink
from relnav_sim.measurements.tangent_sight import camera as cameras
from relnav_sim.sensors import ErrorShares
from relnav_sim.sensors.crosslink import CrosslinkOptions
from relnav_sim.sensors.lidar import LidarOptions

CLOCK = ClockOptions(sigma_m=30, drift_sigma_m_s=0.2, walk_m_per_sqrt_s=0.3, drift_walk_m_s_per_sqrt_s=0.004)
LINK = CrosslinkOptions(range_sigma_m=0.5, range_rate_sigma_m_s=0.01)
LIDAR = LidarOptions(range_sigma_m=0.05)


@pytest.mark.parametrize("step_s", [0.2, 1.0, 60.0])
def test_the_motion_is_the_exact_discretisation(step_s):
    A = np.array([[0.0, 1.0], [0.0, 0.0]])
    D, Q = CLOCK.motion(step_s)
    F, expected = van_loan(A, np.eye(2), np.diag([0.3**2, 0.004**2]), step_s)
    np.testing.assert_allclose(D, expm(A * step_s), rtol=0, atol=1e-12)
    np.testing.assert_allclose(D, F, rtol=1e-12, atol=1e-16)  # an exponential's zeros are its rounding
    np.testing.assert_allclose(Q, expected, rtol=1e-12)
    # Two half steps are one.
    D_half, Q_half = CLOCK.motion(step_s / 2)
    np.testing.assert_allclose(D_half @ D_half, D, rtol=1e-14)
    np.testing.assert_allclose(D_half @ Q_half @ D_half.T + Q_half, Q, rtol=1e-12)


def test_coupled_states_stand_behind_the_others():
    rng = np.random.default_rng(1)
    extra = extension([RangeBiasOptions(sigma_m=5, tau_s=60), CLOCK], {"link": LINK}, 2.0)
    assert extra.names == ("range_bias", "clock_bias", "clock_drift") and extra.units == ("m", "m", "m/s")
    np.testing.assert_array_equal(extra.sigma, [5, 30, 0.2])
    F, Q, G = rng.normal(size=(6, 6)), np.eye(6), rng.normal(size=(6, 3))
    dynamics = AugmentedDynamics(LinearDynamics(F, Q), extra.decay, extra.noise, G)
    D, U = CLOCK.motion(2.0)
    whole = np.zeros((9, 9))
    whole[:6, :6], whole[:6, 6:], whole[6, 6], whole[7:, 7:] = F, G, np.exp(-2 / 60), D
    step = Step(3, 2.0)
    for shape in ((4, 9), (4, 5, 9)):
        states = rng.normal(size=shape)
        np.testing.assert_allclose(dynamics.propagate(states, step), states @ whole.T, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(dynamics.propagate(states, step)[2:3], dynamics.propagate(states[2:3], step))
    np.testing.assert_array_equal(dynamics.transition(states[:, 0], step), whole)
    noise = np.zeros((9, 9))
    noise[:6, :6], noise[6, 6], noise[7:, 7:] = Q, 25 * -np.expm1(-4 / 60), U
    np.testing.assert_allclose(dynamics.process_noise(states, step), noise, rtol=1e-14)


def test_a_diagonal_is_the_matrix_with_that_diagonal():
    base, b = LinearDynamics(np.eye(2), np.eye(2)), np.random.default_rng(2).normal(size=(3, 4))
    by_numbers = AugmentedDynamics(base, [0.9, 1.0], [0.3, 0.0])
    by_matrices = AugmentedDynamics(base, np.diag([0.9, 1.0]), np.diag([0.3, 0.0]))
    step = Step(0, 1.0)
    for name in ("propagate", "transition", "process_noise"):
        np.testing.assert_array_equal(getattr(by_numbers, name)(b, step), getattr(by_matrices, name)(b, step))


@pytest.mark.parametrize(
    "decay, noise",
    [
        (np.eye(2), np.array([[1.0, 2.0], [2.0, 1.0]])),
        (np.eye(2), np.array([[1.0, 0.5], [0.0, 1.0]])),
        (np.eye(2), np.eye(3)),
        (np.ones((2, 3)), np.ones((2, 3))),
        (np.ones((1, 2, 2)), np.ones((1, 2, 2))),
    ],
)
def test_a_noise_that_is_no_covariance_is_refused(decay, noise):
    with pytest.raises(ValueError, match="covariance"):
        AugmentedDynamics(LinearDynamics(np.eye(2), np.eye(2)), decay, noise)


def test_bias_and_drift_add_to_the_channels_of_the_link():
    extra = extension([CLOCK, RangeBiasOptions(sigma_m=5, sensor="lidar")], {"lidar": LIDAR, "link": LINK}, 1.0)
    shares = ErrorShares(extra.channels["link"], extra.turns["link"])
    model = AugmentedMeasurement(
        crosslink(range_sigma_m=0.5, range_rate_sigma_m_s=0.01), 6, LINK.distortion(shares, "spherical")
    )
    x = np.array([[100.0, 200.0, 50.0, 0.1, 0.2, -0.1, 0.0, 0.0, 7.0]])
    off = x.copy()
    off[:, 6:8] = [30.0, 0.2]
    np.testing.assert_allclose(model.predict(off, 0) - model.predict(x, 0), [[30.0, 0.2]], rtol=1e-12)
    assert model.depends_on == (0, 1, 2, 3, 4, 5, 6, 7)
    H = model.jacobian(x, 0)
    np.testing.assert_allclose(H, MeasurementDefaults.jacobian(model, x, 0), rtol=0, atol=1e-7)
    own = LIDAR.distortion(ErrorShares(extra.channels["lidar"], extra.turns["lidar"]), "spherical")
    np.testing.assert_array_equal(own.jacobian(np.zeros(1), np.zeros(3))[1], [[0, 0, 1]])


def test_the_sensor_is_the_first_that_can_have_the_error():
    sensors = {"lidar": LIDAR, "link": LINK}
    assert sensor_of(CLOCK, sensors) == "link"
    assert sensor_of(RangeBiasOptions(sigma_m=5), sensors) == "lidar"
    assert sensor_of(RangeBiasOptions(sigma_m=5, sensor="link"), sensors) == "link"
    with pytest.raises(ValueError, match=r"no sensor of this filter \(lidar\) has the channel range and range_rate"):
        sensor_of(CLOCK, {"lidar": LIDAR})
    with pytest.raises(ValueError, match="lidar has not the channel range and range_rate"):
        sensor_of(CLOCK.model_copy(update={"sensor": "lidar"}), sensors)
    with pytest.raises(ValueError, match="the filter has no sensor radar"):
        sensor_of(RangeBiasOptions(sigma_m=5, sensor="radar"), sensors)


def test_a_clock_has_no_correlation_time():
    with pytest.raises(ValueError, match="tau_s"):
        ClockOptions(sigma_m=30, drift_sigma_m_s=0.2, tau_s=60)


def test_at_rest_behind_the_chief_a_clock_s_bias_is_a_distance():
    """A null direction of the link and of a camera beside it, for ever; on an ellipse there is none."""
    n, step_s = 1.1e-3, 60.0
    F = np.zeros((8, 8))
    F[:6, :6], F[6:, 6:] = cw_transition(n, step_s), CLOCK.motion(step_s)[0]
    link, camera = crosslink(range_sigma_m=1.0, range_rate_sigma_m_s=1e-2), cameras(angle_sigma_deg=0.1)

    def information(x):
        """Return the Gramian over one revolution in units of 10 m, 10 n m/s, 10 m and 1 cm/s."""
        state, moved, total = np.array(x, dtype=float), np.eye(8), np.zeros((8, 8))
        scale = np.array([10.0, 10, 10, 10 * n, 10 * n, 10 * n, 10, 1e-2])
        for _ in range(96):
            H = np.zeros((4, 8))
            H[:2, :6], H[2:, :6] = link.jacobian(state[None], 0)[0], camera.jacobian(state[None], 0)[0]
            H[0, 6] = H[1, 7] = 1.0
            H = H / [[1.0], [1e-2], [np.radians(0.1)], [np.radians(0.1)]] @ moved * scale
            total += H.T @ H
            state, moved = F[:6, :6] @ state, F @ moved
        return total

    at_rest = information([0, -2000, 0, 0, 0, 0])
    values, vectors = np.linalg.eigh(at_rest)
    assert values[0] < 1e-10 * values[1]
    np.testing.assert_allclose(np.abs(vectors[:, 0]), np.eye(8)[[1, 6]].sum(axis=0) / np.sqrt(2), rtol=0, atol=1e-6)
    assert vectors[1, 0] * vectors[6, 0] > 0  # nearer by as much as the bias adds
    assert np.linalg.eigvalsh(information([500, -2000, 400, 0.2, -2 * n * 500, 0.3]))[0] > 1
