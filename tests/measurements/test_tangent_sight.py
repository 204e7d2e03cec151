"""Tangent angles as filters see them: derivatives, noise, missing readings, and no direction that is special."""

from __future__ import annotations

import numpy as np
import pytest

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import cross_matrix, mounting_matrix, sight_vector, spherical_of
from relnav_sim.astro.tangent_plane import across, deflected, unit
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.measurements.augmented import AdditiveBias, AugmentedMeasurement
from relnav_sim.measurements.converted_tangent_radar import ConvertedTangentRadar, tangent_shrinkage
from relnav_sim.measurements.delayed import Delayed
from relnav_sim.measurements.sight import Sight
from relnav_sim.measurements.spherical_radar import SightNoise, first_fix
from relnav_sim.measurements.tangent_sight import TangentSight, camera

ORBIT = ChiefOrbit(7.0e6, 0.0, 0.5, 0.8, 0.5, 0.0, 3.986004418e14, 6378137.0, 1.08263e-3)
ANGLE = np.radians(0.05)
ATTITUDE = (2e-4) ** 2 * np.array([[4.0, 1.0, 0.5], [1.0, 9.0, -2.0], [0.5, -2.0, 5.0]])
MOUNTINGS = {
    "ahead": mounting_matrix(0, 0, 0),
    "behind": mounting_matrix(180, 0, 0),
    "on the axis": mounting_matrix(0, 90, 0),
    "oblique": mounting_matrix(35, -20, 50),
}


def noise(channels=2, assumed="total", attitude=ATTITUDE, weights=(1.0,), scales=(1.0,)):
    deviations = np.outer(scales, [4.0, ANGLE, ANGLE][3 - channels :])
    return SightNoise(np.array(weights), deviations, deviations[0], attitude, assumed)


def sight(mounting="oblique", host="chief"):
    return Sight(MOUNTINGS[mounting], host, ORBIT)


def states(runs=30, seed=1):
    return np.random.default_rng(seed).normal(size=(runs, 6)) * [900, 900, 900, 0.4, 0.4, 0.4]


def seen(own, at):
    """The line of sight of states (..., n) in the sensor's axes, by component."""
    positions = own.positions(at, 0)[:, :3].reshape(*at.shape[:-1], 3)
    return tuple(np.moveaxis(positions @ own.sensor_from_rtn.T, -1, 0))


def angles_of(own, at, errors=0.0):
    """Azimuth and elevation of states (..., n) read off by errors (..., 2)."""
    u = deflected(unit(seen(own, at)), *np.moveaxis(np.broadcast_to(errors, (*at.shape[:-1], 2)), -1, 0))
    return np.stack(spherical_of(u)[1:], axis=-1)


def differences(measurement, at, epoch, velocity_width):
    width = np.array([1e-2] * 3 + [velocity_width] * 3 + [1e-6] * 5)[: at.shape[-1]]
    columns = []
    for j, w in enumerate(width):
        step = w * np.eye(at.shape[-1])[j]
        columns.append((measurement.predict(at + step, epoch) - measurement.predict(at - step, epoch)) / (2 * w))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("host", ["chief", "deputy"])
@pytest.mark.parametrize("channels", [2, 3])
@pytest.mark.parametrize("late", [False, True])
def test_jacobian_is_the_derivative_far_from_the_reading_too(host, channels, late):
    own, x = sight(host=host), states()
    base = TangentSight(own, noise(channels))
    biases = np.zeros((channels, 5))
    biases[-2:, :2] = np.eye(2)
    turns = np.hstack([np.zeros((3, 2)), MOUNTINGS["oblique"]])
    plain = Delayed(base, 3.0) if late else base
    augmented = AugmentedMeasurement(plain, 6, AdditiveBias(biases, turns))
    assert augmented.depends_on == (*range(6 if late or host == "deputy" else 3), 6, 7, 8, 9, 10)
    off = np.random.default_rng(2).normal(size=(30, 2))
    z = np.full((30, 3, channels), np.nan)
    z[:, 1, -2:] = angles_of(own, x, off)
    augmented.take(z, 4)
    extended = np.hstack([x, 1e-4 * np.random.default_rng(3).normal(size=(30, 5))])
    many = extended[:, None] + np.random.default_rng(5).normal(size=(1, 7, 11)) * 1e-3
    for model, at in ((plain, x), (augmented, extended), (augmented, many)):
        H = model.jacobian(at, 5)
        expected = differences(model, at, 5, 3e-3 if late else 1.0)  # of a latency the velocity moves the position
        scale = np.abs(expected).max(axis=tuple(range(expected.ndim - 2)))
        scale = np.maximum(scale, 1e-4 * scale[:, :6].max(axis=1, keepdims=True))  # rounding of the differences
        np.testing.assert_allclose(H / scale, expected / scale, atol=2e-6)


def test_residuals_are_the_noise_whatever_the_direction_and_the_size():
    """Of isotropic noise the length of the residual is that of the error, to rounding."""
    own, x = sight(), states(200)
    v = np.random.default_rng(4).normal(size=(200, 2)) * np.geomspace(1e-6, 1.2, 200)[:, None]
    model = TangentSight(own, noise(attitude=np.zeros((3, 3))))
    taken = model.take(angles_of(own, x, v)[:, None], 0)
    np.testing.assert_array_equal(taken, 0)
    residual = model.residual(taken[:, 0], model.predict(x, 0))
    np.testing.assert_allclose(np.hypot(*residual.T), np.hypot(*v.T), rtol=1e-7, atol=1e-15)
    small = slice(0, 80)  # below 3 mrad the axes at both ends are the same
    np.testing.assert_allclose(residual[small], v[small], atol=2e-5)


def test_a_residual_points_the_right_way_up_to_half_a_turn():
    """Turning the predicted line of sight by the residual brings it to the reading, however far that is."""
    u = unit(tuple(np.random.default_rng(6).normal(size=(3, 300))))
    own = Sight(np.eye(3), "chief", None)
    for angle in (0.1, 1.0, 2.0, 3.1):
        bearing = np.random.default_rng(7).uniform(0, 2 * np.pi, 300)
        predicted = deflected(u, angle * np.cos(bearing), angle * np.sin(bearing))
        # RTN is (-z, x, -y) of the nadir frame.
        state = np.zeros((300, 6))
        state[:, :3] = 500 * np.stack([-predicted[2], predicted[0], -predicted[1]], axis=-1)
        model = TangentSight(own, noise())
        z = model.take(np.stack(spherical_of(u)[1:], axis=-1)[:, None], 0)[:, 0]
        residual = z - model.predict(state, 0)
        # A quarter of the way back along the great circle, seen from the reading.
        nearer = deflected(u, *(0.75 * -residual.T))
        before, after = (sum(a * b for a, b in zip(u, p, strict=True)) for p in (predicted, nearer))
        np.testing.assert_allclose(np.arccos(np.clip(before, -1, 1)), angle, atol=1e-7)
        np.testing.assert_allclose(np.arccos(np.clip(after, -1, 1)), 0.75 * angle, atol=1e-7)


@pytest.mark.parametrize("mounting", MOUNTINGS)
@pytest.mark.parametrize("host", ["chief", "deputy"])
def test_noise_is_that_of_the_angles_and_of_the_turned_line_of_sight(mounting, host):
    own, x = sight(mounting, host), states()
    for channels in (2, 3):
        model = TangentSight(own, noise(channels))
        model.take(np.concatenate([np.ones((30, channels - 2)), angles_of(own, x)], axis=-1)[:, None], 9)
        R = model.noise(x + 50.0, 9)
        for run in range(30):
            u = np.array([part[run] for part in unit(seen(own, x))])
            E = np.array(across(tuple(u)))
            expected = ANGLE**2 * np.eye(2) + E @ cross_matrix(u) @ ATTITUDE @ cross_matrix(u).T @ E.T
            np.testing.assert_allclose(R[run, -2:, -2:], expected, rtol=1e-9, atol=1e-18)
        if channels == 3:
            np.testing.assert_array_equal(R[:, 0], np.broadcast_to([16.0, 0, 0], (30, 3)))


def test_a_mixture_has_the_components_and_their_sum_is_the_total():
    own, x = sight(), states()
    told = noise(3, "mixture", weights=(0.7, 0.3), scales=(1.0, 5.0))
    model = TangentSight(own, told)
    mixture = model.mixture(x, 0)
    total = np.einsum("k,bkij->bij", mixture.weights, mixture.covariances)
    np.testing.assert_allclose(model.noise(x, 0), total, rtol=1e-12)
    assert TangentSight(own, noise(3)).mixture(x, 0) is None


def test_missing_angles_leave_the_range_and_one_angle_is_no_direction():
    own, x = sight(), states(4)
    model = TangentSight(own, noise(3))
    z = np.concatenate([np.full((4, 1), 900.0), angles_of(own, x)], axis=-1)
    z[1, 1] = np.nan
    z[2, 2] = np.nan
    z[3, 0] = np.nan
    taken = model.take(z[:, None], 0)[:, 0]
    nan = np.nan
    np.testing.assert_array_equal(taken, [[900, 0, 0], [900, nan, nan], [900, nan, nan], [nan, 0, 0]])
    assert np.isfinite(model.predict(x, 0)).all()
    assert np.isfinite(model.jacobian(x, 0)).all()
    # Without a reading a run is seen from its own state.
    np.testing.assert_allclose(model.predict(x, 0)[1:3, 1:], 0, atol=1e-15)
    np.testing.assert_allclose(model.predict(x, 7)[:, 1:], 0, atol=1e-15)
    assert model.predict(states(9), 0).shape == (9, 3)


N, STEP_S = ORBIT.mean_motion_rad_s, 10.0


def flight(own, runs=20, epochs=150, seed=8):
    """A deputy that flies round the chief in CW motion, readings of it, and priors."""
    generator = np.random.default_rng(seed)
    F = cw_transition(N, STEP_S)
    truth = np.empty((epochs, 6))
    truth[0] = [300.0, 0.0, 200.0, 0.1, -2 * N * 300.0, -0.2]
    for k in range(1, epochs):
        truth[k] = F @ truth[k - 1]
    P0 = np.diag(np.square([30.0, 30, 30, 0.05, 0.05, 0.05]))
    before = np.linalg.solve(F, truth[0])
    mean0 = before + generator.normal(size=(runs, 6)) @ np.sqrt(P0)
    every = np.broadcast_to(truth, (runs, epochs, 6))
    z = angles_of(own, every, ANGLE * generator.normal(size=(runs, epochs, 2)))
    return LinearDynamics(F, 1e-10 * np.eye(6)), z, mean0, P0, truth


@pytest.mark.parametrize("name", ["ekf", "iekf", "ukf", "ckf", "sr_ukf"])
def test_no_filter_notices_where_the_axes_of_the_camera_point(name):
    """The same errors across the line of sight, read by cameras in other attitudes: the same estimates."""
    means = []
    for mounting in MOUNTINGS:
        own = sight(mounting)
        dynamics, _, mean0, P0, truth = flight(own)
        every = np.broadcast_to(truth, (20, 150, 6))
        # One error of direction, in RTN, turned into each camera's own angles.
        off = 1 + np.random.default_rng(9).normal(size=(20, 150, 3)) * ANGLE
        seen = every.copy()
        seen[..., :3] *= off
        z = angles_of(own, seen)
        filter = create_filter(name, dynamics, TangentSight(own, noise(attitude=np.zeros((3, 3)))))
        means.append(run_filter(filter, z, mean0, P0, step_s=STEP_S))
    for other in means[1:]:
        np.testing.assert_allclose(other.mean, means[0].mean, atol=1e-4)
        np.testing.assert_allclose(other.nis, means[0].nis, rtol=1e-4, atol=1e-6)


def test_runs_and_chunks_do_not_depend_on_each_other():
    own = sight("on the axis")
    dynamics, z, mean0, P0, _ = flight(own)
    z[3, 10:20] = np.nan
    made = create_filter("ekf", dynamics, camera(angle_sigma_deg=0.05, mounting_deg=(0, 90, 0)))
    whole = run_filter(made, z, mean0, P0, step_s=STEP_S)
    alone = run_filter(made, z[3:4], mean0[3:4], P0, step_s=STEP_S)
    np.testing.assert_array_equal(alone.mean[0], whole.mean[3])
    first = run_filter(made, z[:, :70], mean0, P0, step_s=STEP_S)
    second = run_filter(made, z[:, 70:], first.mean[:, -1], first.covariance[:, -1], step_s=STEP_S)
    np.testing.assert_array_equal(second.mean, whole.mean[:, 70:])


def test_the_first_fix_of_range_and_angles_is_where_they_point():
    """Its covariance is that of the range along the line of sight and a round one across it."""
    x = states()
    x[:, 3:] = 0
    distance = np.linalg.norm(x[:, :3], axis=1)
    for host in ("chief", "deputy"):
        own = sight("on the axis", host)
        z = np.concatenate([distance[:, None], angles_of(own, x)], axis=-1)
        position, covariance = first_fix(TangentSight(own, noise(3, attitude=np.zeros((3, 3)))), z)
        np.testing.assert_allclose(position, x[:, :3], atol=1e-6)
        if host == "chief":
            u = x[:, :3] / distance[:, None]
            along = u[:, :, None] * u[:, None]
            across_it = (distance**2 * ANGLE**2)[:, None, None] * (np.eye(3) - along)
            np.testing.assert_allclose(covariance, 16.0 * along + across_it, rtol=1e-7, atol=1e-7)


def test_a_converted_position_is_unbiased_and_has_the_covariance_it_states():
    """Against sampling, angles of 20 and 12 deg that tell the two apart, straight at the pole of azimuth."""
    mounting, count = MOUNTINGS["on the axis"], 400_000
    deviations = np.array([[30.0, 0.35, 0.2], [60.0, 0.5, 0.4]])
    weights = np.array([0.8, 0.2])
    told = SightNoise(weights, deviations, deviations[0], np.zeros((3, 3)), "mixture")
    state = np.array([[20.0, 900.0, -10.0, 0, 0, 0]])
    own = Sight(mounting, "chief", None)
    generator = np.random.default_rng(10)
    scale = deviations[generator.choice(2, size=count, p=weights)]
    v = generator.normal(size=(count, 3)) * scale
    direction = tuple(float(part[0]) for part in unit(seen(own, state)))
    u = deflected(direction, v[:, 1], v[:, 2])
    read = (np.linalg.norm(state[0, :3]) + v[:, 0]) / tangent_shrinkage(weights, deviations)
    error = own.position(tuple(read * part for part in u), 0) - state[:, :3]
    model = ConvertedTangentRadar(mounting, told)
    R = model.noise(state, 0)[0]
    assert (np.abs(error.mean(axis=0)) < 5 * np.sqrt(np.diag(R) / count)).all()
    moments = error[:, :, None] * error[:, None]
    spread = moments.std(axis=0) / np.sqrt(count)
    assert (np.abs(moments.mean(axis=0) - R) < 5 * spread).all()
    mixture = model.mixture(state, 0)
    np.testing.assert_allclose(np.einsum("k,kij->ij", mixture.weights, mixture.covariances[0]), R, rtol=1e-12)


def test_bad_options_of_the_own_data_camera():
    with pytest.raises(ValueError, match="between 0 and 90"):
        camera(angle_sigma_deg=0.0)
    with pytest.raises(ValueError, match="needs the chief's nominal orbit"):
        camera(angle_sigma_deg=0.1, host="deputy")


def test_readings_are_not_written_into():
    z = np.full((2, 3, 2), 0.1)
    z.flags.writeable = False
    camera(angle_sigma_deg=0.1).take(z, 0)
    assert (z == 0.1).all()
    assert sight_vector(np.ones(()), z[0, 0, 0], z[0, 0, 1])[0] < 1
