"""What every registered filter makes of readings with channels missing, and of several sensors."""

from functools import cache

import numpy as np
import pytest
from every_filter import CAUSAL, KINDS, small_options
from radar_problem import SIGMAS, polar, polar_jacobian, radar_problem
from scipy.stats import binom, chi2
from taking_turns import taking_turns

from relnav_sim import (
    FunctionMeasurement,
    LinearDynamics,
    LinearMeasurement,
    MixtureNoise,
    create_filter,
    run_filter,
)
from relnav_sim.measurements.several import JoinedMeasurement

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
CAUSAL_WAYS = [way for way in WAYS if way[0] in CAUSAL]


def each_of(ways):
    names = ["-".join([kind, *map(str, options.values())]) for kind, options in ways]
    return pytest.mark.parametrize("kind, options", ways, ids=names)


every_way = each_of(WAYS)
every_causal_way = each_of(CAUSAL_WAYS)


def build(kind, dynamics, measurement, **options):
    fewer = {"skf": {"samples": 64}, "gaussian_sum": {"components": 2}}.get(kind, {})
    return create_filter(kind, dynamics, measurement, **{**small_options(kind), **fewer, **options})


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


@pytest.mark.parametrize("kind, options, noise", taking_turns(WAYS, list(NOISES)))
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


@pytest.mark.parametrize(
    "kind, options, noise", taking_turns(CAUSAL_WAYS, ["independent", "one switch", "switch by channel"])
)
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


@pytest.mark.parametrize("kind, options, noise", taking_turns(WAYS, list(NOISES)))
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
    runs, epochs = 40, 13
    x, z = rng.standard_normal((runs, 4)), np.empty((runs, epochs, 3))
    for k in range(epochs):
        x = x @ F.T + np.sqrt(0.05) * rng.standard_normal((runs, 4))
        z[:, k] = x @ H.T + rng.standard_normal((runs, 3)) @ np.sqrt(R)
    z[rng.random(z.shape) < 0.2] = np.nan
    z[:, 7, :1] = np.nan
    return LinearDynamics(F, 0.05 * np.eye(4)), H, R, z


GLINT = np.stack([np.diag([1.0, 0.5, 2.0]), np.diag([9.0, 8.0, 18.0])])


def sensors(noise):
    """Two sensors whose noises are independent: Gaussian, or mixtures with one switch a sensor or one a channel."""
    _, H, R, _ = linear()
    if noise == "gaussian":
        return {"a": LinearMeasurement(H[:1], R[:1, :1]), "b": LinearMeasurement(H[1:], R[1:, 1:])}
    weights, shared = np.array([0.8, 0.2]), noise == "one switch"
    return {
        "a": LinearMeasurement(H[:1], MixtureNoise(weights, GLINT[:, :1, :1], shared)),
        "b": LinearMeasurement(H[1:], MixtureNoise(weights, GLINT[:, 1:, 1:], shared)),
    }


def two_sensors(kind, options, noise="gaussian", rows=slice(None), epochs=slice(None), runs=None):
    """The filter of both sensors on the linear problem, or some of its runs and epochs."""
    dynamics, z = linear()[0], linear()[3][rows][:, epochs]
    filter = build(kind, dynamics, sensors(noise), **options)
    return run_filter(filter, {"a": z[..., :1], "b": z[..., 1:]}, np.zeros(4), np.eye(4), seed=2, runs=runs)


def one_sensor(kind, options):
    """The filter of all channels at once on the linear problem."""
    dynamics, H, R, z = linear()
    filter = build(kind, dynamics, LinearMeasurement(H, R), **options)
    return run_filter(filter, z, np.zeros(4), np.eye(4), seed=2)


@cache
def both_ways(kind, options):
    """All at once, and one after the other; options as items."""
    return one_sensor(kind, dict(options)), two_sensors(kind, dict(options))


def kalman():
    return both_ways("kf", ())[0]


def distance_to_kalman(history):
    sigma = np.sqrt(np.einsum("...ii->...i", kalman().covariance))
    return np.sqrt(np.square((history.mean - kalman().mean) / sigma).mean())


@every_way
def test_one_after_the_other_is_all_at_once(kind, options):
    """To rounding where the filter is linear; where it is not, as near to the optimum, which is the Kalman filter."""
    if "gate_probability" in options:
        pytest.skip("a gate judges each sensor by itself")
    at_once, in_turn = both_ways(kind, tuple(options.items()))
    assert np.array_equal(in_turn.dof, at_once.dof)
    if apart(at_once, kalman()) < 1e-10 or kind in ("kf", "two_step"):
        assert apart(in_turn, at_once) < 1e-12
    assert distance_to_kalman(in_turn) <= 1.5 * distance_to_kalman(at_once) + 1e-12


@every_causal_way
def test_the_mean_nis_is_the_number_of_channels_read(kind, options):
    z = linear()[3]
    at_once, history = both_ways(kind, tuple(options.items()))
    assert np.array_equal(history.dof, (~np.isnan(z)).sum(axis=2))
    assert np.array_equal(history.dof_by["a"], (~np.isnan(z[..., :1])).sum(axis=2))
    assert np.array_equal(history.dof_by["b"], (~np.isnan(z[..., 1:])).sum(axis=2))
    for nis, dof in ((history.nis, history.dof), *((history.nis_by[name], history.dof_by[name]) for name in "ab")):
        assert np.array_equal(np.isnan(nis), dof == 0)
        channels, total = dof.sum(), np.nansum(nis)
        if apart(at_once, kalman()) < 1e-10:
            low, high = chi2.ppf([0.0005, 0.9995], channels)
            assert low < total < high
        else:
            assert 0.5 < total / channels < 1.3
    read = [np.nan_to_num(history.nis_by[name]) for name in "ab"]
    assert np.array_equal(np.nan_to_num(history.nis), read[0] + read[1])


@pytest.mark.parametrize("kind, options, noise", taking_turns(WAYS, ["gaussian", "one switch", "switch by channel"]))
def test_same_bits_of_several_sensors_whatever_the_block(kind, options, noise):
    block, epochs = [0, 3, 17, 31], slice(4, 12)
    whole = two_sensors(kind, options, noise, block, epochs, block)
    for places in ([1], [0, 2, 3]):
        rows = [block[place] for place in places]
        part = two_sensors(kind, options, noise, rows, epochs, rows)
        for name in ARRAYS:
            assert np.array_equal(getattr(part, name), getattr(whole, name)[places], equal_nan=True), name


@pytest.mark.parametrize("noise", ["one switch", "switch by channel"])
@pytest.mark.parametrize("kind, options, epochs", [("imm", {}, 13), ("gaussian_sum", {"components": 16}, 1)])
def test_mixtures_one_after_the_other_are_all_at_once(kind, options, epochs, noise):
    """Exact for the bank of models, and for the Gaussian sum until it has to merge."""
    dynamics, z = linear()[0], linear()[3][:, :epochs]
    in_turn = two_sensors(kind, options, noise, epochs=slice(epochs))
    joined = build(kind, dynamics, JoinedMeasurement(list(sensors(noise).values())), **options)
    at_once = run_filter(joined, z, np.zeros(4), np.eye(4))
    assert np.allclose(in_turn.mean, at_once.mean, rtol=0, atol=1e-12)
    assert np.allclose(in_turn.covariance, at_once.covariance, rtol=0, atol=1e-12)
    assert np.allclose(in_turn.log_likelihood, at_once.log_likelihood, rtol=0, atol=1e-12)


def test_gates_are_as_wide_as_the_channels_read():
    """Under the filter's own model each gate rejects its share, whichever channels are there."""
    share = 0.1
    history = two_sensors("kf", {"gate_probability": 1 - share})
    three = one_sensor("kf", {"gate_probability": 1 - share})
    for rejected, dof in (
        *((history.extras_by[name]["rejected"], history.dof_by[name]) for name in "ab"),
        (three.extras["rejected"], three.dof),
    ):
        for channels in range(1, dof.max() + 1):
            taken = rejected[dof == channels]
            assert len(taken) > 50
            # A gate that rejects good readings makes the next ones a little larger.
            low, high = binom.ppf([0.0005, 0.9995], len(taken), share) / len(taken)
            assert low - 0.02 < taken.mean() < high + 0.02
