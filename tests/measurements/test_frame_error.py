"""Readings in a frame that errs: what it adds to R, constant or told with each reading."""

import numpy as np
import pytest

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import NADIR_FROM_RTN, mounting_matrix
from relnav_sim.measurements.frame_error import FrameError, with_frame
from relnav_sim.measurements.given_noise import MixtureNoise
from relnav_sim.measurements.relative_state import relative_gnss, relative_state
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar

ORBIT = ChiefOrbit(7.137e6, 0.0, 0.7, 0.0, 0.0, 0.0, 3.986004418e14, 6378137.0, 1.08263e-3)
MOUNTING = mounting_matrix(20.0, -30.0, 10.0)


def turn_covariance(seed=1):
    L = np.random.default_rng(seed).normal(size=(6, 6)) * np.repeat([1e-3, 1e-6], 3)[:, None]
    return L @ L.T


def states(runs=7):
    return np.array([500.0, 5000.0, -700.0, 0.3, -0.2, 0.5]) * np.random.default_rng(2).uniform(0.5, 1.5, (runs, 6))


def radar(turn, host="chief", assumed="total"):
    noise = SightNoise(
        np.array([0.9, 0.1]),
        np.array([[2.0, 1e-3, 1e-3], [9.0, 5e-3, 5e-3]]),
        np.array([2.0, 1e-3, 1e-3]),
        MOUNTING @ NADIR_FROM_RTN @ turn @ NADIR_FROM_RTN.T @ MOUNTING.T,
        assumed,
    )
    return SphericalRadar(MOUNTING, noise, host, ORBIT)


@pytest.mark.parametrize(("host", "atol"), [("chief", 1e-9), ("deputy", 2e-3)])
def test_a_radar_gains_what_an_error_of_its_attitude_adds(host, atol):
    """Its own model of the attitude is written by angles; both must agree: from the deputy to |r| over the radius."""
    P = turn_covariance()
    x = states()
    still = np.zeros((3, 3))
    wrapped, own = FrameError(radar(still, host), P), radar(P[:3, :3], host)
    alone, got, expected = (model.noise(x, 0) for model in (radar(still, host), wrapped, own))
    alone = np.broadcast_to(alone, got.shape)
    scale = np.sqrt(np.einsum("rii->ri", expected))
    units = scale[:, :, None] * scale[:, None]
    np.testing.assert_allclose((got - alone) / units, (expected - alone) / units, atol=atol)
    assert (np.einsum("rii->ri", expected - 1.1 * alone)[:, 1:] > 0).all()


def test_each_component_of_a_mixture_gains_the_same():
    P, x, still = turn_covariance(), states(), np.zeros((3, 3))
    got = FrameError(radar(still, assumed="mixture"), P).mixture(x, 0)
    expected = radar(P[:3, :3], assumed="mixture").mixture(x, 0)
    np.testing.assert_array_equal(got.weights, expected.weights)
    np.testing.assert_allclose(got.covariances, expected.covariances, rtol=1e-9, atol=1e-15)


def test_a_relative_state_gains_what_turned_frames_do_to_it():
    """By turning the state itself a little at random, many times."""
    P, x = turn_covariance(), states(1)
    rng = np.random.default_rng(3)
    theta, phi = np.split(rng.multivariate_normal(np.zeros(6), P, 40_000), 2, axis=1)
    r, v = np.split(x[0], 2)
    seen = np.concatenate([np.cross(r, theta), np.cross(v, theta) + np.cross(r, phi)], axis=1)
    R = relative_state(np.eye(6) * 1e-12, P).noise(x, 0)[0]
    scale = np.sqrt(np.diag(R))
    np.testing.assert_allclose(np.cov(seen.T) / np.outer(scale, scale), R / np.outer(scale, scale), atol=0.03)


def test_told_covariances_count_at_their_own_run_and_epoch():
    rng = np.random.default_rng(4)
    x, z = states(5), rng.normal(size=(5, 3, 6))
    P = np.stack([[turn_covariance(10 * run + k) for k in range(3)] for run in range(5)])
    base = relative_state(np.eye(6))
    told = FrameError(base)
    np.testing.assert_array_equal(told.take(with_frame(z, P), first_epoch=40), z)
    for k in range(3):
        R = told.noise(x, 40 + k)
        for run in range(5):
            alone = FrameError(base, P[run, k]).noise(x[run : run + 1], 0)[0]
            np.testing.assert_array_equal(R[run], alone)


def test_a_relative_state_is_linear_and_may_have_mixture_noise():
    noise = MixtureNoise(np.array([0.9, 0.1]), np.stack([np.eye(3), 25 * np.eye(3)]))
    model = relative_state(noise, turn_covariance())
    x = states()
    np.testing.assert_array_equal(model.jacobian(x, 0), np.eye(3, 6))
    np.testing.assert_array_equal(model.predict(x, 0), x[:, :3])
    mixture = model.mixture(x, 0)
    total = np.einsum("k,rkij->rij", mixture.weights, mixture.covariances)
    np.testing.assert_allclose(total, model.noise(x, 0), rtol=1e-12)


def test_another_number_of_channels_is_refused():
    with pytest.raises(ValueError, match=r"noise has shape \(2, 2\); it must be for a position \(3\) or"):
        relative_state(np.eye(2))


def test_for_own_data_by_sigmas_or_by_the_formal_covariance():
    x = states()
    by_sigmas = relative_gnss(position_sigma_m=2.0, velocity_sigma_m_s=0.1)
    formal = np.diag([4.0, 4.0, 4.0, 0.01, 0.01, 0.01])
    np.testing.assert_allclose(by_sigmas.noise(x, 0), formal, rtol=1e-12)
    np.testing.assert_array_equal(relative_gnss(covariance=formal).noise(x, 0), formal)
    turned = relative_gnss(position_sigma_m=2.0, frame_sigma_deg=0.1).noise(x, 0)
    r = x[:, :3]
    across = (r**2).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None]
    np.testing.assert_allclose(turned, 4 * np.eye(3) + np.radians(0.1) ** 2 * across, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    "given",
    [{}, {"position_sigma_m": 1.0, "covariance": np.eye(3)}, {"velocity_sigma_m_s": 1.0}, {"position_sigma_m": 0}],
)
def test_sigmas_and_covariance_are_one_or_the_other(given):
    with pytest.raises(ValueError, match="position_sigma_m"):
        relative_gnss(**given)
