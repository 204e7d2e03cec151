"""A target that flies through the sensor's z axis, on which there is no azimuth: tangent angles do not mind."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from relnav_sim import LinearDynamics, create_filter, run_filter
from relnav_sim.astro.line_of_sight import spherical_of
from relnav_sim.astro.tangent_plane import deflected, unit
from relnav_sim.dynamics.clohessy_wiltshire import cw_transition
from relnav_sim.measurements.sight import Sight
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar
from relnav_sim.measurements.tangent_sight import TangentSight

RUNS, EPOCHS, STEP_S, N = 200, 200, 30.0, 0.0011
SIGMAS = np.array([1.0, np.radians(0.3), np.radians(0.3)])
NOISE = SightNoise(np.ones(1), SIGMAS[None], SIGMAS, np.zeros((3, 3)))
OWN = Sight(np.eye(3), "chief", None)
F = cw_transition(N, STEP_S)


def seen(states):
    """The line of sight in the sensor's axes, by component."""
    return tuple(np.moveaxis(states[..., :3] @ OWN.sensor_from_rtn.T, -1, 0))


def flown():
    """Once round the chief in its orbital plane, 2:1, starting straight above it: on the axis, and again below it."""
    states = [np.array([250.0, 0.0, 0.0, 0.0, -2 * N * 250.0, 0.0])]
    for _ in range(EPOCHS - 1):
        states.append(F @ states[-1])
    return np.array(states)


def history(form, name="ekf"):
    """Filter readings whose noise is of the given form, with a filter that is told so."""
    truth, generator = flown(), np.random.default_rng(21)
    v = generator.normal(size=(RUNS, EPOCHS, 3)) * SIGMAS
    sight = seen(truth)
    distance, azimuth, elevation = spherical_of(sight)
    z = v.copy()
    z[..., 0] += distance
    if form == "tangent":
        _, z[..., 1], z[..., 2] = spherical_of(deflected(unit(sight), v[..., 1], v[..., 2]))
        model = TangentSight(OWN, NOISE)
    else:
        z[..., 1:] += np.stack([azimuth, elevation], axis=-1)
        model = SphericalRadar(np.eye(3), NOISE)
    P0 = np.diag(np.square([5.0, 5, 5, 0.01, 0.01, 0.01]))
    mean0 = np.linalg.solve(F, truth[0]) + generator.normal(size=(RUNS, 6)) @ np.sqrt(P0)
    filter = create_filter(name, LinearDynamics(F, np.zeros((6, 6))), model)
    return truth, run_filter(filter, z, mean0, P0, step_s=STEP_S)


def nees(truth, made):
    error = made.mean - truth
    return np.einsum("bki,bki->bk", error, np.linalg.solve(made.covariance, error[..., None])[..., 0])


def bands(degrees, looks):
    """Two-sided bounds of the mean over the runs that all looks keep to together in 999 of 1000 experiments."""
    tail = 1e-3 / looks / 2
    return chi2.ppf([tail, 1 - tail], degrees * RUNS) / RUNS


@pytest.mark.parametrize("name", ["ekf", "ukf", "iekf"])
def test_tangent_angles_are_consistent_all_the_way_round(name):
    truth, made = history("tangent", name)
    low, high = bands(6, EPOCHS)
    anees = nees(truth, made).mean(axis=0)
    assert low < anees.min()
    assert anees.max() < high
    low, high = bands(3, EPOCHS)
    nis = made.nis.mean(axis=0)
    assert low < nis.min()
    assert nis.max() < high
    # All epochs together, innovations being independent.
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 3 * RUNS * EPOCHS) / (RUNS * EPOCHS)
    assert low < nis.mean() < high


@pytest.mark.filterwarnings("ignore:.*:RuntimeWarning")
def test_azimuth_and_elevation_err_there():
    truth, made = history("spherical")
    _, high = bands(6, EPOCHS)
    assert np.nanmax(nees(truth, made).mean(axis=0)) > 3 * high
    rms, better = (
        np.sqrt(np.nanmean(np.square(found.mean - truth)[:, -20:, :3].sum(axis=-1)))
        for found in (made, history("tangent")[1])
    )
    assert rms > 3 * better


def test_away_from_the_axis_both_are_the_same_to_second_order():
    """The same errors near the boresight: the two filters' estimates differ by a small part of their sigma."""
    off = np.array([0.0, 800.0, 0.0, 0.0, 0.0, 0.0])
    generator = np.random.default_rng(22)
    v = generator.normal(size=(20, 60, 3)) * SIGMAS
    sight = seen(np.broadcast_to(off, (60, 6)))
    z = v.copy()
    z[..., 0] += spherical_of(sight)[0]
    tangent = v.copy()
    tangent[..., 0] = z[..., 0]
    _, tangent[..., 1], tangent[..., 2] = spherical_of(deflected(unit(sight), v[..., 1], v[..., 2]))
    P0 = np.diag(np.square([5.0, 5, 5, 0.01, 0.01, 0.01]))
    made = [
        run_filter(create_filter("ekf", LinearDynamics(F, np.zeros((6, 6))), model), read, off, P0, step_s=STEP_S)
        for model, read in ((TangentSight(OWN, NOISE), tangent), (SphericalRadar(np.eye(3), NOISE), z))
    ]
    sigma = np.sqrt(np.diagonal(made[0].covariance, axis1=-2, axis2=-1))
    assert np.abs((made[0].mean - made[1].mean) / sigma).max() < 0.02
