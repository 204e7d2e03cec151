"""What every registered filter makes of readings with channels missing, and of several sensors."""

from functools import cache

import numpy as np
import pytest
from every_filter import KINDS, small_options
from radar_problem import SIGMAS, polar, polar_jacobian, radar_problem
from scipy.stats import chi2

from relnav_sim import (
    FunctionMeasurement,
    LinearDynamics,
    LinearMeasurement,
    MixtureNoise,
    create_filter,
    run_filter,
)

ARRAYS = ("mean", "covariance", "nis", "log_likelihood", "dof")

# Options under which channels enter an algorithm in another way than under its defaults.
FURTHER = {
    "kf": [{"r_scale": 2.0}],
    "ekf": [{"gate_probability": 0.9}],
    "adaptive_alpha_kf": [{"scheme": "student_t", "per_channel": False}, {"scheme": "responsibilities"}],
    "student_t": [{"per_channel": False}],
    "alpha_kf": [{"proposal": "posterior"}, {"proposal": "posterior", "likelihood": "mixture"}],
    "particle": [{"mcmc_steps": 2}],
}
WAYS = [(kind, options) for kind in KINDS for options in ({}, *FURTHER.get(kind, []))]
every_way = pytest.mark.parametrize(
    "kind, options", WAYS, ids=["-".join([kind, *map(str, options.values())]) for kind, options in WAYS]
)


def build(kind, dynamics, measurement, **options):
    return create_filter(kind, dynamics, measurement, **{**small_options(kind), **options})


def apart(one, other):
    """Largest difference of two histories, states in posterior sigmas."""
    sigma = np.sqrt(np.einsum("...ii->...i", other.covariance))
    return max(
        np.abs((one.mean - other.mean) / sigma).max(),
        np.abs((one.covariance - other.covariance) / (sigma[..., :, None] * sigma[..., None, :])).max(),
        np.nanmax(np.abs(one.nis - other.nis)),
        np.abs(one.log_likelihood - other.log_likelihood).max(),
    )


# ----------------------------------------------------------------------------------------------- a radar


@cache
def radar():
    return radar_problem(runs=4, steps=15)


CORRELATIONS = np.array([[1, 0.3, 0.2], [0.3, 1, -0.4], [0.2, -0.4, 1]])
BOTH = np.stack([np.diag(SIGMAS**2), np.diag(25 * SIGMAS**2)])
NOISES = {
    "independent": np.diag(SIGMAS**2),
    "correlated": np.diag(SIGMAS) @ CORRELATIONS @ np.diag(SIGMAS),
    "one switch": MixtureNoise(np.array([0.8, 0.2]), BOTH, shared=True),
    "switch by channel": MixtureNoise(np.array([0.8, 0.2]), BOTH, shared=False),
}


def channels_of_radar(channels, noise):
    """The radar's model made for some of its channels."""
    chosen = list(channels)

    def cut(covariance):
        return covariance[..., chosen, :][..., chosen]

    noise = (
        MixtureNoise(noise.weights, cut(noise.covariances), noise.shared)
        if isinstance(noise, MixtureNoise)
        else cut(noise)
    )
    return FunctionMeasurement(
        lambda states, epoch: polar(states)[..., chosen],
        noise,
        lambda states, epoch: polar_jacobian(states)[..., chosen, :],
        angles=[place for place, channel in enumerate(chosen) if channel > 0],
    )


def radar_run(kind, options, z, noise, channels=range(3), rows=slice(None), runs=None):
    problem = radar()
    filter = build(kind, problem.dynamics, channels_of_radar(channels, noise), **options)
    return run_filter(filter, z[rows], problem.mean0[rows], problem.cov0, seed=1, runs=runs)


@every_way
@pytest.mark.parametrize("noise", NOISES)
def test_an_absent_channel_is_as_if_the_sensor_did_not_have_it(kind, options, noise):
    """The two filters draw the same random numbers. The two-step filter is only alike: y holds g(x) of all channels."""
    absent = {"correlated": 0, "one switch": 1, "switch by channel": 1}.get(noise, 2)
    present = [channel for channel in range(3) if channel != absent]
    z = radar().z.copy()
    z[..., absent] = np.nan
    partial = radar_run(kind, options, z, NOISES[noise])
    selected = radar_run(kind, options, radar().z[..., present], NOISES[noise], present)
    assert (partial.dof == 2).all()
    if "two_step" in kind:
        sigma = np.sqrt(np.einsum("...ii->...i", selected.covariance))
        assert np.abs((partial.mean - selected.mean) / sigma).max() < 0.1
        return
    assert apart(partial, selected) < 1e-11
    for name, value in selected.extras.items():
        assert np.allclose(partial.extras[name], value, rtol=1e-9, atol=1e-9, equal_nan=True), name


@every_way
@pytest.mark.parametrize("noise", ["independent", "one switch", "switch by channel"])
def test_an_absent_channel_changes_nothing_else(kind, options, noise):
    z = radar().z[:, :10].copy()
    z[1, 3] = np.nan  # a run that is missing altogether, in the epoch of the other's missing channel
    before = radar_run(kind, options, z, NOISES[noise])
    z[2, 3, 1] = np.nan
    after = radar_run(kind, options, z, NOISES[noise])
    for name in ARRAYS:
        was, now = getattr(before, name), getattr(after, name)
        assert np.array_equal(was[[0, 1, 3]], now[[0, 1, 3]], equal_nan=True), f"{name} of the other runs"
        assert np.array_equal(was[2, :3], now[2, :3], equal_nan=True), f"{name} of the epochs before"
    assert not np.array_equal(before.mean[2, 3], after.mean[2, 3])


@every_way
@pytest.mark.parametrize("noise", NOISES)
def test_same_bits_whatever_the_block(kind, options, noise):
    z = radar().z[:, :10].copy()
    z[0, 2, 0] = z[2, 2, 1:] = z[3, 5, 2] = z[1, 5] = np.nan
    whole = radar_run(kind, options, z, NOISES[noise])
    for rows in ([0], [1], [2, 3]):
        part = radar_run(kind, options, z, NOISES[noise], rows=rows, runs=rows)
        for name in ARRAYS:
            assert np.array_equal(getattr(part, name), getattr(whole, name)[rows], equal_nan=True), name


# ---------------------------------------------------------------------------------------- linear, two sensors


@cache
def linear():
    rng = np.random.default_rng(1)
    F = np.eye(4) + 0.1 * rng.standard_normal((4, 4))
    F /= 1.05 * np.abs(np.linalg.eigvals(F)).max()
    H, R = rng.standard_normal((3, 4)), np.diag([1.0, 0.5, 2.0])
    runs, epochs = 40, 30
    x, z = rng.standard_normal((runs, 4)), np.empty((runs, epochs, 3))
    for k in range(epochs):
        x = x @ F.T + np.sqrt(0.05) * rng.standard_normal((runs, 4))
        z[:, k] = x @ H.T + rng.standard_normal((runs, 3)) @ np.sqrt(R)
    z[rng.random(z.shape) < 0.2] = np.nan
    z[:, 7, :1] = np.nan
    return LinearDynamics(F, 0.05 * np.eye(4)), H, R, z


def two_sensors(kind, options, noise=None, rows=slice(None), runs=None):
    dynamics, H, R, z = linear()
    noise = R if noise is None else noise
    sensors = {"a": LinearMeasurement(H[:1], noise[:1, :1]), "b": LinearMeasurement(H[1:], noise[1:, 1:])}
    readings = {"a": z[rows, :, :1], "b": z[rows, :, 1:]}
    return run_filter(build(kind, dynamics, sensors, **options), readings, np.zeros(4), np.eye(4), seed=2, runs=runs)


def one_sensor(kind, options):
    dynamics, H, R, z = linear()
    filter = build(kind, dynamics, LinearMeasurement(H, R), **options)
    return run_filter(filter, z, np.zeros(4), np.eye(4), seed=2)


@cache
def kalman():
    return one_sensor("kf", {})


def distance_to_kalman(history):
    sigma = np.sqrt(np.einsum("...ii->...i", kalman().covariance))
    return np.sqrt(np.square((history.mean - kalman().mean) / sigma).mean())


@every_way
def test_one_after_the_other_is_all_at_once(kind, options):
    """To rounding where the filter is linear; where it is not, as near to the optimum, which is the Kalman filter."""
    if "gate_probability" in options:
        pytest.skip("a gate judges each sensor by itself")
    at_once, in_turn = one_sensor(kind, options), two_sensors(kind, options)
    assert np.array_equal(in_turn.dof, at_once.dof)
    if apart(at_once, kalman()) < 1e-10 or kind in ("kf", "two_step"):
        assert apart(in_turn, at_once) < 1e-12
    assert distance_to_kalman(in_turn) <= 1.5 * distance_to_kalman(at_once) + 1e-12


@every_way
def test_the_mean_nis_is_the_number_of_channels_read(kind, options):
    z = linear()[3]
    history = two_sensors(kind, options)
    assert np.array_equal(history.dof, (~np.isnan(z)).sum(axis=2))
    assert np.array_equal(history.dof_by["a"], (~np.isnan(z[..., :1])).sum(axis=2))
    assert np.array_equal(history.dof_by["b"], (~np.isnan(z[..., 1:])).sum(axis=2))
    for nis, dof in ((history.nis, history.dof), *((history.nis_by[name], history.dof_by[name]) for name in "ab")):
        assert np.array_equal(np.isnan(nis), dof == 0)
        channels, total = dof.sum(), np.nansum(nis)
        if apart(one_sensor(kind, options), kalman()) < 1e-10:
            low, high = chi2.ppf([0.0005, 0.9995], channels)
            assert low < total < high
        else:
            assert 0.5 < total / channels < 1.3
    read = [np.nan_to_num(history.nis_by[name]) for name in "ab"]
    assert np.array_equal(np.nan_to_num(history.nis), read[0] + read[1])


@every_way
def test_same_bits_of_several_sensors_whatever_the_block(kind, options):
    whole = two_sensors(kind, options)
    for rows in ([3], [0, 17, 31]):
        part = two_sensors(kind, options, rows=rows, runs=rows)
        for name in ARRAYS:
            assert np.array_equal(getattr(part, name), getattr(whole, name)[rows], equal_nan=True), name
