"""Augmented states behind a model's own: what they do to dynamics and measurement."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from relnav_sim import LinearDynamics, LinearMeasurement
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, mounting_matrix
from relnav_sim.dynamics.augmentation.augmented import AugmentedDynamics
from relnav_sim.dynamics.augmentation.extension import extension, held_acceleration
from relnav_sim.dynamics.augmentation.kinds import (
    AttitudeErrorOptions,
    AzimuthBiasOptions,
    DifferentialDragOptions,
    ElevationBiasOptions,
    RangeBiasOptions,
)
from relnav_sim.dynamics.clohessy_wiltshire import cw_system, cw_transition
from relnav_sim.dynamics.interface import Step
from relnav_sim.measurements.augmented import AdditiveBias, AugmentedMeasurement
from relnav_sim.measurements.converted_radar import ConvertedRadar
from relnav_sim.measurements.interface import MeasurementDefaults
from relnav_sim.measurements.radar_errors import RadarDistortion, radar_errors
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

MOUNTING = mounting_matrix(20, 30, 40)
ALL = (
    AzimuthBiasOptions(sigma_deg=0.1),
    DifferentialDragOptions(sigma_m_s2=1e-7, walk_m_s2_per_sqrt_s=1e-9),
    AttitudeErrorOptions(sigma_arcsec=30, tau_s=60, mode="consider"),
    RangeBiasOptions(sigma_m=5, tau_s=600),
    ElevationBiasOptions(sigma_deg=0.1),
)


@dataclass(frozen=True)
class Radar:
    """What augmented states know of a sensor."""

    host: str = "chief"
    channel_names: tuple[str, ...] = ("range", "azimuth", "elevation")

    def needs_direction(self) -> tuple[bool, ...]:
        return (False, True, True)


def extended(kinds, step_s=1.0):
    return extension(kinds, {"radar": Radar()}, step_s)


def errors_of(extra):
    return radar_errors(extra.channels["radar"], MOUNTING @ extra.turns["radar"])


def measured(extra, base):
    rotation = MOUNTING @ NADIR_FROM_RTN if isinstance(base, ConvertedRadar) else None
    return AugmentedMeasurement(base, 6, RadarDistortion(errors_of(extra), rotation))


def radar(kind):
    noise = SightNoise(np.ones(1), np.array([[4.0, 1e-3, 1e-3]]), np.array([4.0, 1e-3, 1e-3]), 1e-9 * np.eye(3))
    return SphericalRadar(MOUNTING, noise) if kind == "spherical" else ConvertedRadar(MOUNTING, noise)


def test_what_a_campaign_asks_for():
    extra = extended(ALL, step_s=2.0)
    assert extra.names == (
        "azimuth_bias",
        "differential_drag",
        "attitude_error_x",
        "attitude_error_y",
        "attitude_error_z",
        "range_bias",
        "elevation_bias",
    )
    assert extra.units == ("rad", "m/s^2", "rad", "rad", "rad", "m", "rad")
    arcsec = np.radians(1 / 3600)
    degree = np.radians(0.1)
    assert np.allclose(extra.sigma, [degree, 1e-7, *[30 * arcsec] * 3, 5, degree], rtol=1e-14)
    assert extra.considered == (2, 3, 4)
    decay, noise = np.diagonal(extra.decay), np.diagonal(extra.noise)
    assert np.array_equal(extra.decay, np.diag(decay)) and np.array_equal(extra.noise, np.diag(noise))
    assert np.allclose(decay, [1, 1, *[np.exp(-2 / 60)] * 3, np.exp(-2 / 600), 1], rtol=1e-14)
    assert np.allclose(noise[[0, 1, 6]], [0, 2e-18, 0])
    # A Gauss-Markov process keeps its variance.
    stays = [2, 3, 4, 5]
    variance = extra.sigma[stays] ** 2
    assert np.allclose(decay[stays] ** 2 * variance + noise[stays], variance, rtol=1e-14)


def test_a_process_is_a_walk_or_gauss_markov():
    with pytest.raises(ValueError, match="tau_s or a random walk"):
        AzimuthBiasOptions(sigma_deg=0.1, tau_s=60, walk_deg_per_sqrt_s=0.1)


def test_the_dynamics_are_those_of_the_stacked_system():
    rng = np.random.default_rng(1)
    F, Q, G = rng.normal(size=(6, 6)), np.eye(6), rng.normal(size=(6, 2))
    base = LinearDynamics(F, Q)
    dynamics = AugmentedDynamics(base, [0.9, 1.0], [0.3, 0.0], G, considered=[1])
    assert (dynamics.dimension, dynamics.linear, dynamics.considered) == (8, True, (7,))
    whole = np.block([[F, G], [np.zeros((2, 6)), np.diag([0.9, 1.0])]])
    step = Step(3, 1.0)
    for shape in ((4, 8), (4, 5, 8)):
        states = rng.normal(size=shape)
        assert np.allclose(dynamics.propagate(states, step), states @ whole.T, rtol=1e-13, atol=1e-13)
        assert np.array_equal(dynamics.process_noise(states, step), np.diag([1.0] * 6 + [0.3, 0.0]))
    assert np.array_equal(dynamics.transition(states[:, 0], step), whole)
    per_run = AugmentedDynamics(base, [0.9, 1.0], [0.3, 0.0], lambda step: np.stack([G, 2 * G, 3 * G, 4 * G]))
    moved = per_run.propagate(states, step)
    for run in range(4):
        scaled = np.block([[F, (run + 1) * G], [np.zeros((2, 6)), np.diag([0.9, 1.0])]])
        assert np.allclose(moved[run], states[run] @ scaled.T, rtol=1e-13, atol=1e-13)
        assert np.allclose(per_run.transition(states[:, 0], step)[run], scaled)


@pytest.mark.parametrize(
    "arguments",
    [([1.0], [0.0, 0.0]), ([1.0], [-1.0]), ([1.0], [0.0], np.ones((2, 2))), ([1.0], [0.0], None, [1])],
)
def test_sizes_that_do_not_fit_are_refused(arguments):
    with pytest.raises(ValueError):
        AugmentedDynamics(LinearDynamics(np.eye(2), np.eye(2)), *arguments)


@pytest.mark.parametrize("step_s", [0.2, 60.0])
def test_a_held_acceleration_moves_as_the_equations_of_motion_say(step_s):
    n = 1.1e-3
    A, G = cw_system(n), held_acceleration(n, step_s)
    for axis in range(3):

        def slope(t, x, axis=axis):
            rate = A @ x
            rate[3 + axis] += 1.0
            return rate

        exact = solve_ivp(slope, (0, step_s), np.zeros(6), rtol=1e-12, atol=1e-12).y[:, -1]
        assert np.allclose(G[:, axis], exact, rtol=1e-9, atol=1e-12)


def test_drag_pulls_as_the_secular_drift_of_hill_s_equations():
    """A constant along-track acceleration a moves the deputy by -3/2 a t^2 + (4 a / n^2)(1 - cos nt) along-track."""
    n, step_s, a = 1.1e-3, 5.0, 1e-6
    base = LinearDynamics(cw_transition(n, step_s), np.zeros((6, 6)))
    G = held_acceleration(n, step_s) @ extended([DifferentialDragOptions(sigma_m_s2=1.0)], step_s).acceleration
    dynamics = AugmentedDynamics(base, [1.0], [0.0], G)
    state = np.array([[0, 0, 0, 0, 0, 0, a]])
    for k in range(1000):
        state = dynamics.propagate(state, Step(k, step_s))
    t = 5000.0
    along = 4 * a / n**2 * (1 - np.cos(n * t)) - 1.5 * a * t**2
    radial = 2 * a / n**2 * (n * t - np.sin(n * t))
    assert np.allclose(state[0, :2], [radial, along], rtol=1e-9)


@pytest.mark.parametrize("kind", ["spherical", "cartesian"])
def test_the_jacobian_is_the_derivative(kind):
    rng = np.random.default_rng(2)
    extra = extended(ALL)
    measurement = measured(extra, radar(kind))
    states = np.concatenate([rng.normal(size=(4, 3)) * 3000, rng.normal(size=(4, 3))], axis=1)
    # Errors of half a degree, so that what they do to the derivatives shows.
    states = np.concatenate([states, extra.sigma * rng.normal(size=(4, 7)) * 5], axis=1)
    numeric = MeasurementDefaults.jacobian(measurement, states, 0)
    analytic = measurement.jacobian(states, 0)
    assert analytic.shape == (4, 3, 13)
    width = np.cbrt(np.finfo(float).eps)
    # Central differences: rounding of the readings over the step, and the third derivative times the step squared.
    rounding = 10 * np.finfo(float).eps * np.abs(measurement.predict(states, 0)).max(axis=0)[:, None] / width
    truncation = 10 * width**2 * np.abs(numeric).max(axis=(0, 1))
    assert (np.abs(analytic - numeric) <= rounding + truncation).all()
    assert not analytic[:, :, 7].any(), "drag is not measured"


def test_both_forms_of_the_measurement_tell_the_same():
    rng = np.random.default_rng(3)
    extra = extended(ALL)
    b = extra.sigma * rng.normal(size=(5, 7))
    z = np.array([12000.0, 1.0, -0.3]) + rng.normal(size=(5, 3)) * [100, 0.5, 0.5]
    plain = radar("spherical")
    by_angles = plain.position(RadarDistortion(errors_of(extra)).apply(z, b), 0)
    by_position = RadarDistortion(errors_of(extra), MOUNTING @ NADIR_FROM_RTN).apply(plain.position(z, 0), b)
    assert np.allclose(by_angles, by_position, rtol=0, atol=1e-8)
    assert np.abs(by_angles - plain.position(z, 0)).max() > 1


def test_an_attitude_error_moves_the_sight_as_the_attitude_noise_does():
    """The derivative by the three angles is the G of the white attitude error in R: G P G^T."""
    extra = extended([AttitudeErrorOptions(sigma_arcsec=10)])
    state = np.zeros((1, 9))
    state[0, :3] = [300.0, 9000.0, 2000.0]
    P = np.diag([1.0, 2.0, 3.0]) * 1e-9
    sigmas = np.array([4.0, 1e-3, 1e-3])
    noise = SightNoise(np.ones(1), sigmas[None], sigmas, MOUNTING @ P @ MOUNTING.T)
    spherical = SphericalRadar(MOUNTING, noise)
    G = measured(extra, spherical).jacobian(state, 0)[0, :, 6:]
    attitude_part = spherical.noise(state, 0)[0] - np.diag(sigmas**2)
    assert np.allclose(G @ P @ G.T, attitude_part, rtol=1e-10, atol=1e-20)
    cartesian = measured(extra, ConvertedRadar(MOUNTING, noise)).jacobian(state, 0)[0, :, 6:]
    r = MOUNTING.T @ MOUNTING @ NADIR_FROM_RTN @ state[0, :3]
    expected = NADIR_FROM_RTN.T @ np.stack([np.cross(r, axis) for axis in np.eye(3)], axis=1)
    assert np.allclose(cartesian, expected, rtol=1e-12, atol=1e-9)


def test_states_that_the_reading_depends_on():
    extra = extended(ALL)
    measurement = measured(extra, radar("spherical"))
    assert measurement.depends_on == (0, 1, 2, 6, 8, 9, 10, 11, 12)
    linear = AugmentedMeasurement(LinearMeasurement(np.eye(2, 3), np.eye(2)), 3, AdditiveBias([[0, 1], [0, 0]]))
    assert linear.depends_on == (0, 1, 4)
