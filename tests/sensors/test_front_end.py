"""The chain from radar frame to orbit frame, against the covariance formulas that filters are given."""

from __future__ import annotations

import numpy as np
import pytest

from relnav_sim.astro.line_of_sight import mounting_matrix, sight_vector
from relnav_sim.sensors import SensorSuite, attitude_covariance, filter_inputs, sensor_measurement

RUNS, EPOCHS = 400, 100
NO_NOISE = {"range_sigma_m": 1e-6, "angle_sigma_deg": 1e-9}


def run(scene, relative, runs=RUNS, epochs=EPOCHS, **sections):
    options = scene.sensors(**sections)
    truth = scene.truth(relative, epochs)
    readings = SensorSuite(options, scene.source(runs), scene.STEP_S).measure(truth, 0)
    return options, filter_inputs(options, readings, truth)["radar"], readings


def whitened_is_standard(error, covariance, degrees=None):
    """Whether errors (N, m) have this covariance: every entry within 5 of its own standard errors."""
    values, vectors = np.linalg.eigh(covariance)
    keep = slice(-(degrees or len(values)), None)
    white = error @ (vectors[:, keep] / np.sqrt(values[keep]))
    products = np.einsum("si,sj->sij", white, white)
    standard_error = products.std(axis=0) / np.sqrt(len(white))
    return (np.abs(products.mean(axis=0) - np.eye(white.shape[1])) < 5 * standard_error).all()


def test_without_gnss_and_star_tracker_the_attitude_is_perfect(scene):
    _, inputs, readings = run(scene, [100.0, 5000.0, -200.0], runs=3, radar=NO_NOISE)
    assert inputs["spherical"] is readings["radar"]
    expected = np.broadcast_to([100.0, 5000.0, -200.0], inputs["cartesian"].shape)
    np.testing.assert_allclose(inputs["cartesian"], expected, atol=1e-4)


@pytest.mark.parametrize("links", [("gnss",), ("star_tracker",), ("gnss", "star_tracker")])
@pytest.mark.parametrize("boresight", [[0, 1, 0], [0.4, -0.3, 1.0]])
def test_chain_error_has_the_stated_covariance(scene, links, boresight):
    """A perfect radar: what is left is [r x] P [r x]^T, of rank 2."""
    chosen = {"gnss": scene.GNSS, "star_tracker": {**scene.STAR_TRACKER, "boresight_body": boresight}}
    position = np.array([3000.0, 12000.0, -5000.0])
    options, inputs, _ = run(
        scene, position, radar={**NO_NOISE, "mounting_deg": [10, 20, 30]}, **{name: chosen[name] for name in links}
    )
    to_nadir = np.array([[0, 1, 0], [0, 0, -1], [-1, 0, 0]])
    P = to_nadir.T @ attitude_covariance(options, scene.ORBIT, "chief") @ to_nadir
    cross = np.array([[0, -position[2], position[1]], [position[2], 0, -position[0]], [-position[1], position[0], 0]])
    error = inputs["cartesian"].reshape(-1, 3) - position
    assert whitened_is_standard(error, cross @ P @ cross.T, degrees=2)
    length = np.linalg.norm(inputs["cartesian"], axis=-1)
    np.testing.assert_allclose(length, np.linalg.norm(position), atol=1e-4)


def test_chain_error_has_the_published_size(scene):
    """12 km along-track, the tracker across the orbit: 1.94 m in the orbit plane, 0.58 and 0.24 m across it."""
    _, tracker, _ = run(scene, [0.0, 12000.0, 0.0], radar=NO_NOISE, star_tracker=scene.STAR_TRACKER)
    _, gnss, _ = run(scene, [0.0, 12000.0, 0.0], radar=NO_NOISE, gnss=scene.GNSS)
    spread = 5 / np.sqrt(2 * RUNS * EPOCHS)
    np.testing.assert_allclose(tracker["cartesian"][..., [0, 2]].std(axis=(0, 1)), [1.94, 0.58], rtol=spread + 5e-3)
    np.testing.assert_allclose(gnss["cartesian"][..., [0, 2]].std(axis=(0, 1)), [0.050, 0.241], rtol=spread + 8e-3)


@pytest.mark.parametrize("noise", [{"kind": "gaussian"}, {"kind": "mixture", "scale": 5, "fraction": 0.2}])
@pytest.mark.parametrize("mounting", [[0, 0, 0], [25, -40, 60]])
def test_inputs_have_the_covariance_that_filters_are_told(scene, noise, mounting):
    # An attitude as bad as the radar, so that both shares count.
    tracker = {"cross_boresight_sigma_arcsec": 150, "about_boresight_sigma_arcsec": 400, "boresight_body": [1, 1, 0.5]}
    position = [2000.0, 6000.0, -1500.0]
    options, inputs, _ = run(
        scene,
        position,
        radar={"noise": noise, "mounting_deg": mounting},
        gnss=scene.GNSS,
        star_tracker=tracker,
    )
    state = np.array([[*position, 0.0, 0.0, 0.0]])
    for form in ("spherical", "cartesian"):
        model = sensor_measurement("radar", options, scene.ORBIT, scene.STEP_S, form)
        residual = model.residual(inputs[form].reshape(-1, 3), model.predict(state, 0))
        R = model.noise(state, 0)
        assert whitened_is_standard(residual, R[0] if R.ndim == 3 else R)
        assert (np.abs(residual.mean(axis=0)) < 5 * residual.std(axis=0) / np.sqrt(len(residual))).all()


def test_correlated_attitude_errors_are_not_told(scene):
    parts = [{"kind": "gaussian", "scale": 0.6}, {"kind": "gauss_markov", "tau_s": 60, "scale": 0.8}]
    white = scene.sensors(star_tracker=scene.STAR_TRACKER, gnss=scene.GNSS)
    shared = scene.sensors(
        star_tracker={**scene.STAR_TRACKER, "noise": parts}, gnss={**scene.GNSS, "noise": {"kind": "gaussian"}}
    )
    gnss = scene.sensors(gnss=scene.GNSS)
    told = [attitude_covariance(options, scene.ORBIT, "chief") for options in (white, shared, gnss)]
    np.testing.assert_allclose(told[1] - told[2], 0.36 * (told[0] - told[2]))


def test_deputy_carrier_gives_spherical_only(scene):
    """The reading in the deputy's measured frame matches the filter's exact model to the attitude's error."""
    relative = [300.0, -371.0, -400.0]
    options, inputs, _ = run(
        scene,
        relative,
        radar={**NO_NOISE, "carrier": "deputy", "mounting_deg": [0, 0, -90]},
        gnss=scene.GNSS,
        star_tracker=scene.STAR_TRACKER,
    )
    assert set(inputs) == {"spherical"}
    model = sensor_measurement("radar", options, scene.ORBIT, scene.STEP_S)
    # scene.truth holds the deputy at rest in the chief's frame.
    state = np.array([[*relative, 0.0, 0.0, 0.0]])
    residual = model.residual(inputs["spherical"].reshape(-1, 3), model.predict(state, 0))[:, 1:]
    assert whitened_is_standard(residual, model.noise(state, 0)[0, 1:, 1:])
    with pytest.raises(ValueError, match="take spherical"):
        sensor_measurement("radar", options, scene.ORBIT, scene.STEP_S, "cartesian")


def test_missing_links_are_missing_readings(scene):
    outage = [{"kind": "gaussian"}, {"kind": "outage", "windows_s": [[2.0, 4.0]]}]
    _, inputs, readings = run(
        scene,
        [0.0, 5000.0, 0.0],
        runs=2,
        gnss={**scene.GNSS, "noise": outage},
        star_tracker={**scene.STAR_TRACKER, "noise": [outage[0], {"kind": "outage", "windows_s": [[8.0, 9.0]]}]},
    )
    out = np.zeros(EPOCHS, dtype=bool)
    out[10:20] = out[40:45] = True
    assert np.isfinite(readings["radar"]).all()
    assert np.isnan(inputs["cartesian"][:, out]).all()
    assert np.isnan(inputs["spherical"][:, out, 1:]).all()
    np.testing.assert_array_equal(inputs["spherical"][..., 0], readings["radar"][..., 0])  # it needs no direction
    assert np.isfinite(inputs["spherical"][:, ~out]).all()


def test_one_link_alone_needs_the_truth(scene):
    options = scene.sensors(gnss=scene.GNSS)
    truth = scene.truth([0.0, 5000.0, 0.0], 4)
    readings = SensorSuite(options, scene.source(2), scene.STEP_S).measure(truth, 0)
    with pytest.raises(ValueError, match="needs the truth"):
        filter_inputs(options, readings)


def test_spherical_and_cartesian_tell_the_same(scene):
    """Both inputs come from one reading: the Cartesian one is the spherical one, enlarged by the unbiasing factors."""
    mounting = [25, -40, 60]
    _, inputs, _ = run(
        scene,
        [2000.0, 6000.0, -1500.0],
        runs=5,
        radar={"angle_sigma_deg": 1.0, "mounting_deg": mounting},
        gnss=scene.GNSS,
        star_tracker=scene.STAR_TRACKER,
    )
    sight = np.stack(sight_vector(*np.moveaxis(inputs["spherical"], -1, 0)), axis=-1)
    nadir = sight @ mounting_matrix(*mounting)
    plain = np.stack([-nadir[..., 2], nadir[..., 0], -nadir[..., 1]], axis=-1)
    stretch = np.linalg.norm(inputs["cartesian"], axis=-1) / np.linalg.norm(plain, axis=-1)
    single = np.exp(np.radians(1.0) ** 2 / 2)
    assert (stretch > single * (1 - 1e-9)).all()
    assert (stretch < single**2 * (1 + 1e-9)).all()


def test_no_radar_no_inputs(scene):
    options = scene.sensors(radar=None)
    assert filter_inputs(options, {}) == {}
