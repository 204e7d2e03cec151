"""The radar as filters see it, against inertial geometry, finite differences, published formulas and sampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import multivariate_normal

from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import half_open, mounting_matrix, sight_vector, spherical_of
from relnav_sim.measurements.converted_radar import ConvertedRadar, conversion
from relnav_sim.measurements.interface import MeasurementDefaults
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar, first_fix

R_C = 7.0e6
ORBIT = ChiefOrbit(R_C, 0.0, 0.5, 0.8, 0.5, 0.0, 3.986004418e14, 6378137.0, 1.08263e-3)
DEG = np.pi / 180
MOUNTINGS = {
    "aligned": mounting_matrix(0, 0, 0),
    "oblique": mounting_matrix(35, -20, 50),
    "wei": mounting_matrix(0, 0, -90),
}
ANGLE = 0.0667 * DEG
# Attitude errors as large as the radar's own, correlated between the axes, so that every term shows.
ATTITUDE = (2e-4) ** 2 * np.array([[4.0, 1.0, 0.5], [1.0, 9.0, -2.0], [0.5, -2.0, 5.0]])


def noise(assumed="total", attitude=ATTITUDE, sigmas=(4.0, ANGLE, ANGLE), weights=(0.7, 0.3), scales=(1.0, 2.0)):
    deviations = np.outer(scales, sigmas)
    return SightNoise(np.array(weights), deviations, deviations[0], attitude, assumed)


def states(runs=40, seed=1, spread=(900.0, 900.0, 900.0, 0.4, 0.4, 0.4)):
    return np.random.default_rng(seed).normal(size=(runs, 6)) * spread


def body_axes(position, velocity):
    """Nadir frame from one inertial state, written out: rows along-track, minus normal, nadir."""
    up = position / np.linalg.norm(position)
    normal = np.cross(position, velocity)
    normal /= np.linalg.norm(normal)
    return np.array([np.cross(normal, up), -normal, -up])


@pytest.mark.parametrize(
    ("angles", "x_axis", "y_axis"),
    [
        ((90, 0, 0), (0, 1, 0), (-1, 0, 0)),
        ((0, 90, 0), (0, 0, -1), (0, 1, 0)),
        ((0, 0, 90), (1, 0, 0), (0, 0, 1)),
        ((90, 0, 90), (0, 1, 0), (0, 0, 1)),
    ],
)
def test_mounting_turns_about_the_named_axes(angles, x_axis, y_axis):
    C = mounting_matrix(*angles)
    np.testing.assert_array_equal(C[0], x_axis)
    np.testing.assert_array_equal(C[1], y_axis)


def test_mounting_agrees_with_scipy():
    body_from_radar = Rotation.from_euler("ZYX", [35, -20, 50], degrees=True).as_matrix()
    np.testing.assert_allclose(mounting_matrix(35, -20, 50), body_from_radar.T, atol=1e-15)


def test_polar_and_sight_vector_are_inverses():
    sight = tuple(np.random.default_rng(0).normal(size=(3, 200)) * 1e4)
    for there, back in zip(sight, sight_vector(*spherical_of(sight)), strict=True):
        np.testing.assert_allclose(back, there, atol=1e-11)


def test_half_open_angles():
    angle = np.array([np.pi, -np.pi, 0.3, -3.0, np.pi + 0.1, -np.pi - 0.1, 7.0, np.nan])
    expected = [np.pi, np.pi, 0.3, -3.0, 0.1 - np.pi, np.pi - 0.1, 7.0 - 2 * np.pi, np.nan]
    np.testing.assert_allclose(half_open(angle), expected, rtol=1e-14)
    np.testing.assert_array_equal(half_open(angle)[:4], expected[:4])


@pytest.mark.parametrize("mounting", MOUNTINGS)
@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_prediction_is_the_geometry_of_two_craft_in_inertial_space(host, mounting):
    radar = SphericalRadar(MOUNTINGS[mounting], noise(), host, ORBIT)
    n = ORBIT.mean_motion_rad_s
    turn = Rotation.from_euler("zxz", [20, 70, 130], degrees=True).as_matrix()
    chief = turn @ [R_C, 0, 0], turn @ [0, n * R_C, 0]
    x = states()
    for state, z in zip(x, radar.predict(x, 0), strict=True):
        position = chief[0] + turn @ state[:3]
        velocity = chief[1] + turn @ (state[3:] + np.cross([0, 0, n], state[:3]))
        if host == "chief":
            sight = MOUNTINGS[mounting] @ body_axes(*chief) @ (position - chief[0])
        else:
            sight = MOUNTINGS[mounting] @ body_axes(position, velocity) @ (chief[0] - position)
        np.testing.assert_allclose(z[0], np.linalg.norm(sight), rtol=1e-12)
        np.testing.assert_allclose(z[1], np.arctan2(sight[1], sight[0]), atol=1e-9)
        np.testing.assert_allclose(z[2], np.arcsin(-sight[2] / z[0]), atol=1e-9)


def test_deputy_at_rest_sees_what_the_corrected_formulas_of_wei_2012_say():
    """Wei, Song and Zhang (2012), eq. 4 without its misprints: alpha and beta in the deputy's axes R, T, N."""
    x, y, z = states(seed=2)[:, :3].T
    r_d = np.sqrt((R_C + x) ** 2 + y**2 + z**2)
    r_p = np.sqrt((R_C + x) ** 2 + y**2)
    x_c = (R_C * (R_C + x) - r_d**2) / r_d
    y_c = -y * R_C / r_p
    z_c = -R_C * (R_C + x) * z / (r_d * r_p)
    expected = np.stack(
        [np.sqrt(x**2 + y**2 + z**2), np.arctan2(x_c, y_c), np.arctan2(z_c, np.hypot(x_c, y_c))], axis=-1
    )
    at_rest = np.stack([x, y, z, 0 * x, 0 * x, 0 * x], axis=-1)
    predicted = SphericalRadar(MOUNTINGS["wei"], noise(), "deputy", ORBIT).predict(at_rest, 0)
    np.testing.assert_allclose(predicted, expected, rtol=1e-9, atol=3e-8)


@pytest.mark.parametrize("mounting", MOUNTINGS)
@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_jacobian_agrees_with_finite_differences(host, mounting):
    radar = SphericalRadar(MOUNTINGS[mounting], noise(), host, ORBIT)
    x = states()
    analytic = radar.jacobian(x, 0)
    numeric = MeasurementDefaults.jacobian(radar, x, 0)
    np.testing.assert_allclose(analytic[:, 0], numeric[:, 0], atol=1e-7)
    np.testing.assert_allclose(analytic[:, 1:, :3], numeric[:, 1:, :3], rtol=2e-5, atol=2e-9)
    # The default steps suit metres; the angles turn so slowly with the velocity that they need a longer one.
    step = 0.5
    for j in (3, 4, 5):
        ahead, behind = x.copy(), x.copy()
        ahead[:, j] += step
        behind[:, j] -= step
        change = radar.residual(radar.predict(ahead, 0), radar.predict(behind, 0)) / (2 * step)
        np.testing.assert_allclose(analytic[:, :, j], change, rtol=1e-5, atol=1e-10)
    if host == "chief":
        assert not analytic[:, :, 3:].any()
    else:
        assert np.abs(analytic[:, 1:, 3:]).max() > 1e-5


def test_extra_states_and_particle_axes():
    radar = SphericalRadar(MOUNTINGS["oblique"], noise(), "deputy", ORBIT)
    x = np.concatenate([states(24).reshape(4, 6, 6), np.ones((4, 6, 2))], axis=-1)
    z, H = radar.predict(x, 0), radar.jacobian(x, 0)
    assert z.shape == (4, 6, 3)
    assert H.shape == (4, 6, 3, 8)
    assert not H[..., 6:].any()
    np.testing.assert_array_equal(z[2, 3], radar.predict(x[2:3, 3, :6], 0)[0])
    np.testing.assert_array_equal(H[2, 3, :, :6], radar.jacobian(x[2:3, 3, :6], 0)[0])


@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_attitude_noise_is_that_of_a_turned_line_of_sight(host):
    """Turn the sight by many small angles of covariance P and look at the angles."""
    radar = SphericalRadar(MOUNTINGS["oblique"], noise(), host, ORBIT)
    x = states(6, seed=3)
    z = radar.predict(x, 0)
    sight = np.stack(sight_vector(*z.T), axis=-1)
    # Second order in the angle is 1e-8 at 1e-4 rad; symmetric points take out the rest, so this is exact.
    factor = np.linalg.cholesky(ATTITUDE)
    total = np.zeros((6, 3, 3))
    for column in factor.T:
        for sign in (1, -1):
            turned = Rotation.from_rotvec(sign * column).apply(sight)
            d = radar.residual(np.stack(spherical_of(tuple(turned.T)), axis=-1), z)
            total += np.einsum("bi,bj->bij", d, d) / 2
    diagonal = np.diag([0.7 + 0.3 * 4] * 3) * np.square([4.0, ANGLE, ANGLE])
    np.testing.assert_allclose(radar.noise(x, 0), total + diagonal, rtol=1e-5, atol=1e-14)


def test_perfect_attitude_gives_one_matrix_for_all():
    radar = SphericalRadar(MOUNTINGS["aligned"], noise("nominal", np.zeros((3, 3))))
    np.testing.assert_allclose(radar.noise(states(), 0), np.diag(np.square([4.0, ANGLE, ANGLE])))


@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_what_is_assumed(host):
    x = states(5)
    make = {
        assumed: SphericalRadar(MOUNTINGS["oblique"], noise(assumed), host, ORBIT)
        for assumed in ("nominal", "total", "mixture")
    }
    assert make["nominal"].mixture(x, 0) is make["total"].mixture(x, 0) is None
    mixture = make["mixture"].mixture(x, 0)
    np.testing.assert_allclose(mixture.covariances[:, 0], make["nominal"].noise(x, 0))
    np.testing.assert_allclose(
        np.einsum("k,bkij->bij", mixture.weights, mixture.covariances), make["total"].noise(x, 0)
    )
    np.testing.assert_array_equal(make["mixture"].noise(x, 0), make["total"].noise(x, 0))


def test_log_likelihood_of_the_mixture():
    radar = SphericalRadar(MOUNTINGS["oblique"], noise("mixture"))
    x = states(3)
    points = np.stack([x, x + 1.0], axis=1)
    z = radar.predict(x, 0) + np.array([3.0, ANGLE, -2 * ANGLE])
    centre = points.mean(axis=1)
    mixture = radar.mixture(centre, 0)
    measured = radar.log_likelihood(z, points, 0)
    for b in range(3):
        for p in range(2):
            residual = radar.residual(z[b], radar.predict(points, 0)[b, p])
            density = sum(
                w * multivariate_normal.pdf(residual, cov=R)
                for w, R in zip(mixture.weights, mixture.covariances[b], strict=True)
            )
            assert measured[b, p] == pytest.approx(np.log(density), rel=1e-10)


def sampled_conversion(radar_noise, mounting, position, size=400_000, seed=5):
    """Errors of converted positions, RTN, by drawing range, angles and attitude and converting each."""
    rng = np.random.default_rng(seed)
    to_radar = mounting @ np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    truth = np.array(spherical_of(tuple(to_radar @ position)))
    component = rng.choice(len(radar_noise.weights), p=radar_noise.weights, size=size)
    z = truth + rng.normal(size=(size, 3)) * radar_noise.deviations[component]
    factors = conversion(radar_noise.weights, radar_noise.deviations)
    converted = np.stack(sight_vector(*z.T), axis=-1) / [factors.level, factors.level, factors.height]
    if radar_noise.attitude.any():
        turns = rng.multivariate_normal(np.zeros(3), radar_noise.attitude, size=size)
        converted = Rotation.from_rotvec(turns).apply(converted)
    return converted @ to_radar - position, component


def assert_same_covariance(sampled, expected, sigmas=5.0):
    """Compare in whitened axes, where the sampling error of every entry is known from the sample's own spread."""
    L = np.linalg.inv(np.linalg.cholesky(expected))
    white = sampled @ L.T
    products = np.einsum("si,sj->sij", white, white)
    error = products.std(axis=0) / np.sqrt(len(sampled))
    assert (np.abs(products.mean(axis=0) - np.eye(3)) < sigmas * error).all()
    assert (np.abs(white.mean(axis=0)) < sigmas / np.sqrt(len(sampled))).all()


@pytest.mark.parametrize(
    ("mounting", "position", "angle_deg", "attitude"),
    [
        ("aligned", [100.0, 12000.0, -300.0], 0.0667, np.zeros((3, 3))),
        ("oblique", [700.0, -400.0, 500.0], 0.0667, ATTITUDE),
        # Angles so noisy that the first-order covariance is off by half.
        ("oblique", [700.0, -400.0, 500.0], 20.0, np.zeros((3, 3))),
    ],
)
def test_converted_covariance_is_that_of_sampled_conversions(mounting, position, angle_deg, attitude):
    radar_noise = noise("mixture", attitude, sigmas=(4.0, angle_deg * DEG, 0.6 * angle_deg * DEG))
    radar = ConvertedRadar(MOUNTINGS[mounting], radar_noise)
    mean = np.array([[*position, 0.0, 0.0, 0.0]])
    errors, component = sampled_conversion(radar_noise, MOUNTINGS[mounting], np.array(position))
    assert_same_covariance(errors, radar.noise(mean, 0)[0])
    mixture = radar.mixture(mean, 0)
    np.testing.assert_allclose(
        np.einsum("k,bkij->bij", mixture.weights, mixture.covariances), radar.noise(mean, 0), rtol=1e-9
    )
    if angle_deg < 1:
        for k in range(2):
            assert_same_covariance(errors[component == k], mixture.covariances[0, k])


def test_converted_covariance_to_first_order():
    """J diag(s^2) J^T + [r x] P [r x]^T at 12 km: second-order terms are below 1e-4 of it."""
    radar_noise = noise("nominal")
    mounting = MOUNTINGS["oblique"]
    mean = np.array([[300.0, 12000.0, -500.0, 0, 0, 0]])
    converted = ConvertedRadar(mounting, radar_noise)
    H = SphericalRadar(mounting, radar_noise).jacobian(mean, 0)[0, :, :3]
    to_radar = mounting @ np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    J = np.linalg.inv(H)
    r = mean[0, :3]
    cross = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
    expected = J @ np.diag(radar_noise.nominal**2) @ J.T + cross @ to_radar.T @ ATTITUDE @ to_radar @ cross.T
    np.testing.assert_allclose(converted.noise(mean, 0)[0], expected, rtol=1e-4, atol=1e-4 * expected.max())
    np.testing.assert_array_equal(converted.predict(mean, 0), mean[:, :3])
    np.testing.assert_array_equal(converted.jacobian(mean, 0), np.eye(3, 6))


@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_first_fix_inverts_the_reading(host):
    radar = SphericalRadar(MOUNTINGS["oblique"], noise(), host, ORBIT)
    x = states()
    x[:, 3:] = 0
    position, covariance = first_fix(radar, radar.predict(x, 0))
    np.testing.assert_allclose(position, x[:, :3], atol=1e-7)
    H = radar.jacobian(x, 0)[:, :, :3]
    np.testing.assert_allclose(H @ covariance @ H.swapaxes(1, 2), radar.noise(x, 0), rtol=1e-5, atol=1e-12)
    missing = radar.predict(x, 0)
    missing[3] = np.nan
    position, covariance = first_fix(radar, missing)
    assert np.isnan(position[3]).all()
    assert np.isnan(covariance[3]).all()
    assert np.isfinite(np.delete(position, 3, axis=0)).all()


@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_bits_do_not_depend_on_the_block(host):
    mounting = MOUNTINGS["oblique"]
    spherical = SphericalRadar(mounting, noise("mixture"), host, ORBIT)
    converted = ConvertedRadar(mounting, noise("mixture"))
    x = states(203)
    functions = [
        lambda s: spherical.predict(s, 0),
        lambda s: spherical.jacobian(s, 0),
        lambda s: spherical.noise(s, 0),
        lambda s: spherical.mixture(s, 0).covariances,
        lambda s: converted.noise(s, 0),
    ]
    for function in functions:
        whole = function(x)
        for runs in ([0], [202], [5, 77, 3]):
            np.testing.assert_array_equal(function(x[runs]), whole[runs])
    position, covariance = first_fix(spherical, spherical.predict(x, 0))
    alone = first_fix(spherical, spherical.predict(x[9:10], 0))
    np.testing.assert_array_equal(alone[0][0], position[9])
    np.testing.assert_array_equal(alone[1][0], covariance[9])


def test_residual_wraps_across_the_seam():
    radar = SphericalRadar(MOUNTINGS["aligned"], noise())
    difference = radar.residual(np.array([[10.0, np.pi - 1e-3, 0.1]]), np.array([[9.0, 1e-3 - np.pi, 0.0]]))
    np.testing.assert_allclose(difference, [[1.0, -2e-3, 0.1]], atol=1e-15)


def test_a_radar_on_the_deputy_needs_the_orbit():
    with pytest.raises(ValueError, match="chief's nominal orbit"):
        SphericalRadar(MOUNTINGS["wei"], noise(), "deputy")
