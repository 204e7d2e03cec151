"""The camera and the tangent form: what is read, in which light, and that filters are told the truth about it."""

from __future__ import annotations

import json

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from relnav_sim.astro.constants import RADIUS_M
from relnav_sim.astro.line_of_sight import sight_vector, spherical_of
from relnav_sim.measurements.augmented import AugmentedMeasurement
from relnav_sim.sensors import ErrorShares, Sensed, SensorSuite, filter_inputs, sensor_measurement
from relnav_sim.sensors.camera import CameraOptions

SIGMA_DEG = 0.5
PLACES = {
    "ahead": [30.0, 2000.0, -50.0],
    "straight behind": [0.0, -2000.0, 0.0],
    "on the axis of azimuth": [2000.0, 0.0, 0.0],
    "beside that axis": [-2000.0, 8.0, 3.0],
}


def camera(**values):
    return {"camera": {"angle_sigma_deg": SIGMA_DEG, **values}}


def run(scene, relative, runs=300, epochs=100, chunk=None, **sections):
    """Options, truth, readings and filter inputs."""
    options = scene.sensors(**{"radar": None, **sections})
    suite = SensorSuite(options, scene.source(runs), scene.STEP_S)
    parts = []
    for first in range(0, epochs, chunk or epochs):
        truth = scene.truth(relative, chunk or epochs, first)
        z = suite.measure(truth, first)
        parts.append((z, filter_inputs(options, z, truth)))
    readings = {name: np.concatenate([part[0][name] for part in parts], axis=1) for name in parts[0][0]}
    inputs = {name: np.concatenate([part[1][name]["spherical"] for part in parts], axis=1) for name in parts[0][1]}
    return options, readings, inputs


def within_chi_square(squares, degrees):
    """Whether squares that should be chi-square add up to what they may, in 999 of 1000 experiments."""
    low, high = chi2.ppf([5e-4, 1 - 5e-4], degrees * squares.size)
    return low < squares.sum() < high


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("mounting", [[0, 0, 0], [35, -20, 50]])
def test_the_noise_is_two_small_turns_in_every_direction(scene, place, mounting):
    _, readings, _ = run(scene, PLACES[place], **camera(mounting_deg=mounting))
    read = np.stack(sight_vector(np.ones(()), *np.moveaxis(readings["camera"], -1, 0)), axis=-1).reshape(-1, 3)
    radial, along, normal = PLACES[place]
    body = Rotation.from_euler("ZYX", mounting, degrees=True).inv().apply([along, -normal, -radial])
    u = body / np.linalg.norm(body)
    angle = np.arctan2(np.linalg.norm(np.cross(u, read), axis=1), read @ u)
    assert within_chi_square(np.square(angle / np.radians(SIGMA_DEG)), 2)
    # The bearing of the error about the line of sight is uniform: its two halves and its quarters alike.
    side = np.cross(u, [0.3, -0.5, 0.8])
    side /= np.linalg.norm(side)
    bearing = np.arctan2(read @ np.cross(u, side), read @ side)
    for harmonic in (1, 2, 4):
        mean = np.exp(1j * harmonic * bearing).mean()
        assert abs(mean) < np.sqrt(-np.log(5e-4) / len(read))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("host", ["chief", "deputy"])
@pytest.mark.parametrize("kind", ["camera", "radar"])
def test_true_states_have_the_residuals_that_filters_are_told(scene, place, host, kind):
    """Through the whole chain: attitude and orbit as measured, noise with outliers, any direction."""
    own = {"host": host, "noise": {"kind": "mixture", "scale": 3, "fraction": 0.2}, "mounting_deg": [10, 20, 30]}
    section = camera(**own) if kind == "camera" else {"radar": {"form": "tangent", **own}}
    if kind == "camera":
        section["camera"]["angle_sigma_deg"] = 0.01
    tracker = {"cross_boresight_sigma_arcsec": 60.0, "about_boresight_sigma_arcsec": 200.0}
    options, _, inputs = run(scene, PLACES[place], gnss=scene.GNSS, star_tracker=tracker, **section)
    model = sensor_measurement(kind, options, scene.ORBIT, scene.STEP_S)
    runs, epochs = inputs[kind].shape[:2]
    states = np.broadcast_to([*PLACES[place], 0.0, 0.0, 0.0], (runs, 6))
    z = model.take(inputs[kind], 0)
    squares, moments = [], 0.0
    for k in range(epochs):
        residual = z[:, k] - model.predict(states, k)
        R = np.broadcast_to(model.noise(states, k), (runs, residual.shape[1], residual.shape[1]))
        white = np.linalg.solve(np.linalg.cholesky(R), residual[..., None])[..., 0]
        squares.append(white)
        moments = moments + white.T @ white
    white = np.concatenate(squares)
    size = len(white)
    # Of a mixture the fourth moment is larger than a Gaussian's; it sets the spread of the second.
    spread = np.sqrt((np.square(white)[:, :, None] * np.square(white)[:, None]).mean(axis=0) / size)
    assert (np.abs(moments / size - np.eye(white.shape[1])) < 5 * spread).all()
    assert (np.abs(white.mean(axis=0)) < 5 / np.sqrt(size)).all()


def test_spherical_form_is_the_radars_angles(scene):
    """The same random numbers: azimuth and elevation of camera and radar differ by nothing."""
    noise = [{"kind": "gaussian"}]
    place = PLACES["ahead"]
    options, _, inputs = run(scene, place, **camera(form="spherical", noise=noise), gnss=scene.GNSS)
    model = sensor_measurement("camera", options, scene.ORBIT, scene.STEP_S)
    whole = scene.sensors(radar={"angle_sigma_deg": SIGMA_DEG}, gnss=scene.GNSS)
    radar = sensor_measurement("radar", whole, scene.ORBIT, scene.STEP_S)
    states = np.array([[*place, 0.3, 0.2, 0.1]])
    np.testing.assert_array_equal(model.predict(states, 0), radar.predict(states, 0)[:, 1:])
    np.testing.assert_array_equal(model.jacobian(states, 0), radar.jacobian(states, 0)[:, 1:])
    np.testing.assert_array_equal(model.noise(states, 0), radar.noise(states, 0)[:, 1:, 1:])
    assert model.angles == (0, 1)
    white = (inputs["camera"] - model.predict(states, 0)) / np.radians(SIGMA_DEG)
    assert within_chi_square(np.square(white), 1)
    sensed = Sensed(np.zeros(1), scene.truth(place, 1).chief, scene.truth(place, 1).deputy, None, 1.0)
    assert options["camera"].off_pole(sensed) is not None
    assert scene.sensors(radar=None, **camera())["camera"].off_pole(sensed) is None


@pytest.mark.parametrize("place", ["ahead", "on the axis of azimuth", "beside that axis"])
@pytest.mark.parametrize("kind", ["camera", "radar"])
def test_augmented_biases_are_the_turns_that_the_noise_makes(scene, place, kind):
    """Read with a bias of 0.1 and -0.2 deg and next to no noise, told of it by the augmented states."""
    bias = np.radians([0.1, -0.2])
    small = {"kind": "gaussian", "scale": 1e-6}
    values = [1.0, -2.0] if kind == "camera" else [0.0, 1.0, -2.0]
    own = {"form": "tangent", "angle_sigma_deg": 0.1, "noise": [small, {"kind": "bias", "value": values}]}
    section = {"camera": own} if kind == "camera" else {"radar": own}
    options, _, inputs = run(scene, PLACES[place], runs=2, epochs=3, **section)
    model = sensor_measurement(kind, options, scene.ORBIT, scene.STEP_S)
    shares = ErrorShares({"azimuth": np.array([1.0, 0.0]), "elevation": np.array([0.0, 1.0])}, np.zeros((3, 2)))
    told = AugmentedMeasurement(model, 6, options[kind].distortion(shares, "spherical"))
    z = told.take(inputs[kind], 0)
    state = np.broadcast_to([*PLACES[place], 0.0, 0.0, 0.0, *bias], (2, 8))
    # The axes at both ends differ by the bias times the tangent of half the angle off the boresight.
    np.testing.assert_allclose((z[:, 1] - told.predict(state, 1))[:, -2:], 0, atol=np.square(bias).sum())
    untold = state * ([1.0] * 6 + [0.0] * 2)
    np.testing.assert_allclose((z[:, 1] - told.predict(untold, 1))[:, -2:], [bias] * 2, atol=np.square(bias).sum())


@pytest.mark.parametrize("form", ["tangent", "spherical"])
@pytest.mark.parametrize("kind", ["camera", "radar"])
@pytest.mark.parametrize("latency_s", [0.0, 0.4])
def test_an_augmented_turn_of_the_host_moves_what_is_read(scene, form, kind, latency_s):
    """The body turned by scipy, about the nadir frame's axes, against what the augmented states say."""
    mounting, dtheta = [35, -20, 50], np.array([3e-4, -2e-4, 1e-4])
    own = {"form": form, "mounting_deg": mounting, "latency_s": latency_s}
    options = scene.sensors(radar=None, **camera(**own)) if kind == "camera" else scene.sensors(radar=own)
    model = sensor_measurement(kind, options, scene.ORBIT, scene.STEP_S)
    told = AugmentedMeasurement(model, 6, options[kind].distortion(ErrorShares({}, np.eye(3)), "spherical"))
    radial, along, normal = 60.0, 900.0, -250.0
    nadir = np.array([along, -normal, -radial])
    seen = Rotation.from_euler("ZYX", mounting, degrees=True).inv().apply(Rotation.from_rotvec(-dtheta).apply(nadir))
    z = np.stack(spherical_of(tuple(seen)))[1 if kind == "camera" else 0 :]
    taken = told.take(np.broadcast_to(z, (1, 1, len(z))), 0)[:, 0]
    state = np.array([[radial, along, normal, 0, 0, 0, *dtheta]])
    np.testing.assert_allclose((taken - told.predict(state, 0))[:, -2:], 0, atol=3e-7)
    assert np.abs((taken - told.predict(state * ([1] * 6 + [0] * 3), 0))[:, -2:]).max() > 1e-4


def test_bits_do_not_depend_on_chunks_or_on_the_other_runs(scene):
    section = camera(field_of_view_deg=[60, 60], period_s=0.6)
    _, whole, _ = run(scene, PLACES["ahead"], runs=4, epochs=60, **section)
    _, split, _ = run(scene, PLACES["ahead"], runs=4, epochs=60, chunk=20, **section)
    _, alone, _ = run(scene, PLACES["ahead"], runs=(2,), epochs=60, **section)
    np.testing.assert_array_equal(split["camera"], whole["camera"])
    np.testing.assert_array_equal(alone["camera"][0], whole["camera"][2])
    read = np.isfinite(whole["camera"]).all(axis=-1)
    assert (read == (np.arange(60) % 3 == 0)).all()


def test_a_target_outside_the_field_of_view_is_not_seen(scene):
    _, readings, _ = run(scene, PLACES["straight behind"], runs=2, **camera(field_of_view_deg=[30, 30]))
    assert np.isnan(readings["camera"]).all()


def test_without_attitude_there_is_no_direction(scene):
    tracker = {**scene.STAR_TRACKER, "noise": [{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[2.0, 4.0]]}]}
    _, _, inputs = run(scene, PLACES["ahead"], runs=2, star_tracker=tracker, **camera())
    assert (np.isnan(inputs["camera"]).all(axis=-1) == ((np.arange(100) >= 10) & (np.arange(100) < 20))).all()


def looks(scene, target, host=(7e6, 0.0, 0.0), **values):
    """Whether a camera on a host sees a target, ECI positions."""
    options = CameraOptions.model_validate_json(json.dumps({"angle_sigma_deg": 0.1, **values}))
    moving = [0.0, 7500.0, 0.0]
    states = [np.array([[[*place, *moving]]]) for place in (host, target)]
    return bool(options.in_reach(Sensed(np.zeros(1), *states, None, 1.0)))


def test_a_target_in_the_earths_shadow_is_not_seen(scene):
    sun = {"sun_direction": [2.0, 0.0, 0.0], "sunlit": True}
    edge = RADIUS_M
    assert looks(scene, [7e6, 0, 0], host=[7e6, 100.0, 0], **sun)  # noon
    assert not looks(scene, [-7e6, 0, 0], host=[-7e6, 100.0, 0], **sun)
    assert not looks(scene, [-3e6, edge - 1, 0], host=[-3e6, edge + 99, 0], **sun)
    assert looks(scene, [-3e6, edge + 1, 0], host=[-3e6, edge - 99, 0], **sun)  # the host's own light is no matter
    assert looks(scene, [3e6, 0, edge - 1], host=[3e6, 0, edge + 99], **sun)
    assert looks(scene, [-7e6, 0, 0], host=[-7e6, 100.0, 0], sun_direction=[2.0, 0.0, 0.0])


def test_a_target_near_the_sun_is_not_seen(scene):
    for off_deg, seen in ((29.9, False), (30.1, True), (150.0, True)):
        sun = [0.0, np.cos(np.radians(off_deg)), np.sin(np.radians(off_deg))]
        assert looks(scene, [7e6, 500.0, 0.0], sun_direction=sun, sun_exclusion_deg=30.0) is seen


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"sunlit": True}, "sunlit needs the Sun's direction"),
        ({"sun_exclusion_deg": 30}, "sun_exclusion_deg needs the Sun's direction"),
        ({"sun_direction": [0, 0, 0]}, "points nowhere"),
        ({"angle_sigma_deg": 0}, "greater than 0"),
        ({"noise": {"kind": "gauss_markov", "tau_s": 10}}, "needs a gaussian or mixture part"),
        ({"noise": [{"kind": "gaussian"}, {"kind": "bias", "value": [1, 2, 3]}]}, "this sensor has 2 channels"),
        ({"form": "polar"}, "'spherical' or 'tangent'"),
    ],
)
def test_bad_options_are_refused(values, said):
    with pytest.raises(ValidationError, match=said):
        CameraOptions.model_validate_json(json.dumps({"angle_sigma_deg": 0.1, **values}))


def test_a_frame_that_errs_between_fixes_still_lets_the_host_turn(scene):
    """GNSS fixes now and then: the frame's error joins R, and the augmented turn goes through it."""
    gnss = {**scene.GNSS, "period_s": 2.0}
    options = scene.sensors(radar=None, gnss=gnss, **camera(latency_s=0.4))
    told, plain = (
        sensor_measurement("camera", options, scene.ORBIT, scene.STEP_S, frame=frame) for frame in ("told", "perfect")
    )
    state = np.array([[60.0, 900.0, -250.0, 0.3, 0.1, -0.2]])
    distortion = options["camera"].distortion(ErrorShares({}, np.eye(3)), "spherical")
    H = [
        AugmentedMeasurement(each, 6, distortion).jacobian(np.hstack([state, np.zeros((1, 3))]), 0)
        for each in (told, plain)
    ]
    np.testing.assert_array_equal(H[0], H[1])
    assert H[0][..., 6:].any()
