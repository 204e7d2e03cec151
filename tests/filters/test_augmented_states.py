"""Filters with augmented states: estimated, or accounted for without estimating them (Schmidt's filter)."""

from dataclasses import dataclass

import numpy as np
import pytest
from every_filter import small_options
from scipy.stats import chi2

from relnav_sim import FunctionMeasurement, LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics
from relnav_sim.dynamics.augmentation.extension import extension
from relnav_sim.dynamics.augmentation.kinds import AzimuthBiasOptions, ElevationBiasOptions, RangeBiasOptions
from relnav_sim.dynamics.clohessy_wiltshire import cw_system, cw_transition
from relnav_sim.dynamics.process_noise import van_loan
from relnav_sim.filters.registry import filter_kinds
from relnav_sim.measurements.augmented import AdditiveBias, AugmentedMeasurement
from relnav_sim.measurements.radar_errors import RadarDistortion, radar_errors
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

KINDS = sorted(filter_kinds())
CONSIDERING = sorted(kind for kind, known in filter_kinds().items() if known.considers)
# With linear models and Gaussian noise these are the Kalman filter to rounding; the robust ones with their wildest
# thresholds, so that every weight is 1.
EXACT = {
    "kf": {},
    "ekf": {},
    "iekf": {},
    "ukf": {},
    "ckf": {},
    "sr_ukf": {},
    "ud_ekf": {},
    "imm": {},
    "gaussian_sum": {},
    "huber": {"threshold": 1e6},
    "adaptive_alpha_kf": {"scheme": "gate", "gate_scheme_probability": 1 - 1e-12},
    "skf": {"samples": 50},
}


@dataclass(frozen=True)
class Problem:
    """Two coordinates and their rates; both coordinates are measured, each with a bias, one of which drifts.

    A third augmented state accelerates the first coordinate.
    """

    F: np.ndarray
    Q: np.ndarray
    G: np.ndarray
    H: np.ndarray
    C: np.ndarray
    R: np.ndarray
    decay: np.ndarray
    noise: np.ndarray
    cov0: np.ndarray
    truth: np.ndarray
    z: np.ndarray

    @property
    def transition(self):
        return np.block([[self.F, self.G], [np.zeros((3, 4)), np.diag(self.decay)]])

    @property
    def noise_matrix(self):
        return np.block([[self.Q, np.zeros((4, 3))], [np.zeros((3, 4)), np.diag(self.noise)]])

    @property
    def observed(self):
        return np.hstack([self.H, self.C])

    def filter(self, kind, considered=(), **options):
        dynamics = AugmentedDynamics(LinearDynamics(self.F, self.Q), self.decay, self.noise, self.G, considered)
        measurement = AugmentedMeasurement(LinearMeasurement(self.H, self.R), 4, AdditiveBias(self.C))
        return create_filter(kind, dynamics, measurement, **options)

    def run(self, kind, considered=(), **options):
        return run_filter(self.filter(kind, considered, **options), self.z, np.zeros(7), self.cov0, seed=3)


def problem(runs=3, steps=60, seed=11):
    rng = np.random.default_rng(seed)
    dt = 1.0
    F = np.kron(np.eye(2), [[1, dt], [0, 1]])
    q = 1e-3 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    Q, R = np.kron(np.eye(2), q), np.diag([1.0, 2.0])
    G = np.array([[dt**2 / 2], [dt], [0], [0]]) @ np.array([[0, 0, 1.0]])
    H, C = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0]]), np.array([[1.0, 0, 0], [0, 1, 0]])
    decay, noise = np.array([1.0, np.exp(-dt / 20), 1.0]), np.array([0.0, 4 * (1 - np.exp(-2 * dt / 20)), 1e-8])
    cov0 = np.diag([25.0, 1, 25, 1, 9, 4, 1e-4])
    case = Problem(F, Q, G, H, C, R, decay, noise, cov0, np.empty(0), np.empty(0))
    x = rng.standard_normal((runs, 7)) @ np.linalg.cholesky(cov0).T
    # Q of the augmented states is singular where one is constant, so its root is that of a diagonal.
    root = np.block([[np.linalg.cholesky(Q), np.zeros((4, 3))], [np.zeros((3, 4)), np.diag(np.sqrt(noise))]])
    truth, z = np.empty((runs, steps, 7)), np.empty((runs, steps, 2))
    for k in range(steps):
        x = x @ case.transition.T + rng.standard_normal((runs, 7)) @ root.T
        truth[:, k] = x
        z[:, k] = x @ case.observed.T + rng.standard_normal((runs, 2)) @ np.sqrt(R)
    return Problem(F, Q, G, H, C, R, decay, noise, cov0, truth, z)


def kalman_by_hand(case, considered=()):
    """Return means and covariances by the textbook equations, the rows of the gain zero for considered states.

    Schmidt's filter in Joseph's form, which holds for any gain (Jazwinski 1970, section 8.4).
    """
    F, Q, H, R = case.transition, case.noise_matrix, case.observed, case.R
    runs, steps, _ = case.z.shape
    m, P = np.zeros((runs, 7)), case.cov0
    means, covariances = np.empty((runs, steps, 7)), np.empty((steps, 7, 7))
    for k in range(steps):
        m, P = m @ F.T, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        K[list(considered)] = 0
        m = m + (case.z[:, k] - m @ H.T) @ K.T
        P = (np.eye(7) - K @ H) @ P @ (np.eye(7) - K @ H).T + K @ R @ K.T
        means[:, k], covariances[k] = m, P
    return means, covariances


@pytest.fixture(scope="module")
def case():
    return problem(steps=30)


@pytest.mark.parametrize("kind", EXACT)
def test_estimated_states_are_those_of_the_augmented_kalman_filter(kind, case):
    history = case.run(kind, **EXACT[kind])
    means, covariances = kalman_by_hand(case)
    assert np.allclose(history.mean, means, rtol=1e-9, atol=1e-9)
    assert np.allclose(history.covariance, covariances[None], rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_a_filter_sees_nothing_but_a_larger_state(kind, case):
    """The wrapped models give what the stacked matrices give, for every filter there is."""
    smaller = small_options(kind)
    wrapped = case.run(kind, **smaller)
    stacked = create_filter(
        kind, LinearDynamics(case.transition, case.noise_matrix), LinearMeasurement(case.observed, case.R), **smaller
    )
    history = run_filter(stacked, case.z, np.zeros(7), case.cov0, seed=3)
    # Particles are resampled on either side of a rounding; the first steps tell enough.
    shown = 5 if "particles" in smaller else case.z.shape[1]
    assert np.allclose(wrapped.mean[:, :shown], history.mean[:, :shown], rtol=1e-6, atol=1e-6)
    assert np.allclose(wrapped.covariance[:, :shown], history.covariance[:, :shown], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("kind", sorted(EXACT.keys() & set(CONSIDERING)))
@pytest.mark.parametrize("considered", [(0,), (0, 2), (0, 1, 2)])
def test_considered_states_are_schmidt_s_filter(kind, considered, case):
    history = case.run(kind, considered, **EXACT[kind])
    means, covariances = kalman_by_hand(case, [4 + place for place in considered])
    assert np.allclose(history.mean, means, rtol=1e-8, atol=1e-8)
    assert np.allclose(history.covariance, covariances[None], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("kind", CONSIDERING)
def test_considered_states_stay_as_predicted(kind, case):
    history = case.run(kind, (0, 1), **small_options(kind))
    assert (history.mean[..., 4:6] == 0).all()
    variances = history.covariance[..., [4, 5], [4, 5]]
    assert np.allclose(variances, [9, 4], rtol=1e-9), "a constant and a stationary process keep their variance"
    assert np.linalg.eigvalsh(history.covariance).min() > 0
    assert set(CONSIDERING) >= {"kf", "ekf", "iekf", "ukf", "ckf", "sr_ukf", "huber", "mckf", "student_t", "imm"}


@pytest.mark.parametrize("kind", sorted(set(KINDS) - set(CONSIDERING)))
def test_a_filter_without_a_gain_refuses_to_consider(kind, case):
    with pytest.raises(ValueError, match="without estimating"):
        case.filter(kind, (0,))


def test_schmidt_is_honest_and_ignoring_is_not():
    """200 runs: the NEES of position and rates is chi-square, unlike that of a filter that ignores the biases."""
    many = problem(runs=200, seed=5)
    low, high = chi2.ppf([0.0005, 0.9995], 4 * 200) / (4 * 200)

    def anees(history, k):
        error = history.mean[:, k, :4] - many.truth[:, k, :4]
        P = history.covariance[:, k, :4, :4]
        return np.mean(np.einsum("bi,bij,bj->b", error, np.linalg.inv(P), error)) / 4

    ignoring = create_filter("kf", LinearDynamics(many.F, many.Q), LinearMeasurement(many.H, many.R))
    ignored = run_filter(ignoring, many.z, np.zeros(4), many.cov0[:4, :4])
    for considered in ((), (0, 1, 2)):
        history = many.run("kf", considered)
        # The epochs of one run are correlated; three far apart are looked at one by one.
        for k in (5, 30, 59):
            assert low < anees(history, k) < high
    assert anees(ignored, 59) > 2 * high


def test_a_bias_added_to_an_angle_is_wrapped_with_it():

    def bearing(states, epoch):
        return np.arctan2(states[..., 1], states[..., 0])[..., None]

    base = FunctionMeasurement(bearing, [[1e-6]], angles=(0,))
    measurement = AugmentedMeasurement(base, 2, AdditiveBias([[1.0]]))
    state = np.array([[-1.0, 0.01, 0.2]])
    predicted = measurement.predict(state, 0)
    z = predicted + 0.1 - 2 * np.pi
    assert np.allclose(measurement.residual(z, predicted), 0.1, atol=1e-12)


@dataclass(frozen=True)
class Radar:
    """What augmented states know of a sensor."""

    host: str = "chief"
    channel_names: tuple[str, ...] = ("range", "azimuth", "elevation")


def bias_sigmas(psd):
    """Return the stated sigmas (epochs, 3) of azimuth, elevation (deg) and range (m) bias over one revolution.

    The deputy stands 12 km ahead on the chief's circle; a reading every 60 s is as good as 300 of 4 m and 1/15 deg.
    """
    n, step_s, epochs = 2 * np.pi / 6000, 60.0, 100
    _, Q = van_loan(cw_system(n), np.vstack([np.zeros((3, 3)), np.eye(3)]), psd * np.eye(3), step_s)
    sigmas = np.array([4.0, np.radians(1 / 15), np.radians(1 / 15)]) / np.sqrt(300)
    radar = SphericalRadar(np.eye(3), SightNoise(np.ones(1), sigmas[None], sigmas, np.zeros((3, 3))))
    extra = extension(
        [AzimuthBiasOptions(sigma_deg=0.1), ElevationBiasOptions(sigma_deg=0.1), RangeBiasOptions(sigma_m=20)],
        {"radar": Radar()},
        step_s,
    )
    dynamics = AugmentedDynamics(LinearDynamics(cw_transition(n, step_s), Q), extra.decay, extra.noise)
    start = np.array([[0, 12000.0, 0, 0, 0, 0, 0, 0, 0]])
    z = np.broadcast_to(radar.predict(start[:, :6], 0)[:, None], (1, epochs, 3))
    cov0 = np.diag(np.concatenate([[30.0] * 3, [1.0] * 3, extra.sigma]) ** 2)
    filter = create_filter(
        "ekf",
        dynamics,
        AugmentedMeasurement(radar, 6, RadarDistortion(radar_errors(extra.channels["radar"], np.zeros((3, 3))))),
    )
    history = run_filter(filter, z, start, cov0, step_s=step_s)
    found = np.sqrt(np.diagonal(history.covariance[0], axis1=1, axis2=2)[:, 6:])
    return found * np.array([180 / np.pi, 180 / np.pi, 1])


def test_what_dynamics_can_and_cannot_tell_of_a_bias():
    """An angle's bias makes a standing offset that no orbit keeps; a range's bias one that an orbit does keep."""
    trusted, plain = bias_sigmas(1e-12), bias_sigmas(1e-6)
    # A standing offset along-track is an orbit: nothing but the priors of range bias and position tells them apart.
    alone = 1 / np.sqrt(1 / 30**2 + 1 / 20**2)
    for sigmas in (trusted, plain):
        np.testing.assert_allclose(sigmas[-1, 2], alone, rtol=1e-3)
    # A constant 0.05 deg, 10 m at 12 km, shows against trusted dynamics before the end of a revolution only.
    assert (trusted[8, :2] > 0.02).any() and (trusted[-1, :2] < 0.002).all()
    # Against dynamics as wrong as plain Clohessy-Wiltshire's at 12 km it hardly shows at all.
    assert (plain[-1, :2] > 0.01).all()
