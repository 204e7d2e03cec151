"""GNSS receiver and star tracker: their error laws in the axes they are stated in."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from relnav_sim.astro.attitude import nadir_axes, quaternion_from_axes
from relnav_sim.sensors import SensorSuite
from relnav_sim.sensors.star_tracker import ARCSEC

RUNS, EPOCHS = 60, 400


def read(scene, name, epochs=EPOCHS, runs=RUNS, **options):
    defaults = scene.GNSS if name == "gnss" else scene.STAR_TRACKER
    suite = SensorSuite(scene.sensors(**{name: {**defaults, **options}}), scene.source(runs), scene.STEP_S)
    truth = scene.truth([0.0, 12000.0, 0.0], epochs)
    return suite.measure(truth, 0)[name], truth


def random_rotations(size=500):
    return Rotation.random(size, random_state=np.random.default_rng(4))


def test_quaternions_agree_with_scipy():
    body_to_eci = random_rotations()
    rows = np.moveaxis(body_to_eci.as_matrix(), -1, 1)  # C, ECI to body: its rows are the body's axes
    q = np.stack(quaternion_from_axes(tuple(tuple(row.T) for row in np.moveaxis(rows, 1, 0))), axis=-1)
    np.testing.assert_allclose(q, body_to_eci.as_quat(canonical=True), atol=1e-14)


def test_gnss_errors_are_white_with_the_stated_sigmas(scene):
    z, truth = read(scene, "gnss")
    error = (z - truth.chief) / np.repeat([30.0, 0.15], 3)
    size = RUNS * EPOCHS
    assert z.shape == (RUNS, EPOCHS, 6)
    covariance = np.einsum("bki,bkj->ij", error, error) / size
    assert (np.abs(covariance - np.eye(6)) < 5 * np.sqrt((1 + np.eye(6)) / size)).all()


def test_receiver_and_tracker_are_on_the_radars_carrier(scene):
    options = scene.sensors(
        radar={"carrier": "deputy"}, gnss=scene.GNSS, star_tracker={**scene.STAR_TRACKER, "boresight_body": [0, 0, -1]}
    )
    truth = scene.truth([0.0, 300_000.0, 0.0], 5)
    z = SensorSuite(options, scene.source(3), scene.STEP_S).measure(truth, 0)
    assert (np.abs(z["gnss"] - truth.deputy)[..., :3] < 200).all()
    down = Rotation.from_quat(z["star_tracker"].reshape(-1, 4)).apply([0, 0, 1]).reshape(3, 5, 3)
    r = truth.deputy[..., :3]
    np.testing.assert_allclose(down, np.broadcast_to(-r / np.linalg.norm(r, axis=-1)[..., None], down.shape), atol=1e-3)


@pytest.mark.parametrize("boresight", [[0, 1, 0], [1, 0, 0], [0.3, -2.0, 0.7]])
def test_tracker_turns_more_about_its_boresight(scene, boresight):
    z, truth = read(scene, "star_tracker", boresight_body=boresight)
    axes = np.stack([np.stack(axis, axis=-1) for axis in nadir_axes(truth.chief)], axis=-2)[0]
    true_body_to_eci = Rotation.from_matrix(np.tile(axes.swapaxes(-1, -2), (RUNS, 1, 1)))
    measured = Rotation.from_quat(z.reshape(-1, 4))
    error = (true_body_to_eci.inv() * measured).as_rotvec() / ARCSEC
    assert (z[..., 3] >= 0).mean() > 0.99
    unit = np.array(boresight) / np.linalg.norm(boresight)
    expected = 10.0**2 * np.eye(3) + (33.3**2 - 10.0**2) * np.outer(unit, unit)
    L = np.linalg.inv(np.linalg.cholesky(expected))
    white = error @ L.T
    size = len(white)
    assert (np.abs(white.T @ white / size - np.eye(3)) < 5 * np.sqrt((1 + np.eye(3)) / size)).all()
    assert (np.abs(white.mean(axis=0)) < 5 / np.sqrt(size)).all()


def test_correlated_share(scene):
    parts = [{"kind": "gaussian", "scale": 0.8}, {"kind": "gauss_markov", "tau_s": 2.0, "scale": 0.6}]
    z, truth = read(scene, "gnss", noise=parts, epochs=100, runs=1500)
    error = (z - truth.chief)[..., 0] / 30.0
    for lag, expected in ((0, 0.64 + 0.36), (1, 0.36 * np.exp(-0.1)), (20, 0.36 * np.exp(-2.0))):
        product = error[:, 40] * error[:, 40 + lag]
        assert abs(product.mean() - expected) < 5 * product.std() / np.sqrt(1500)


@pytest.mark.parametrize(
    ("section", "says"),
    [
        ({"gnss": {"position_sigma_m": 0, "velocity_sigma_m_s": 0.1}}, "greater than 0"),
        ({"star_tracker": {"cross_boresight_sigma_arcsec": 10, "about_boresight_sigma_arcsec": -1}}, "greater than 0"),
        (
            {
                "star_tracker": {
                    "cross_boresight_sigma_arcsec": 10,
                    "about_boresight_sigma_arcsec": 30,
                    "boresight_body": [0, 0, 0],
                }
            },
            "it is a direction",
        ),
    ],
)
def test_bad_options_are_refused(scene, section, says):
    with pytest.raises(ValidationError, match=says):
        scene.sensors(**section)
