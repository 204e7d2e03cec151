"""Several sensors and measurements with channels missing: what is asked of whom, told, and refused."""

import doctest
import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from radar_problem import polar, polar_jacobian, radar_problem

from relnav_sim import (
    FilterHistory,
    FunctionMeasurement,
    LinearDynamics,
    LinearMeasurement,
    MixtureNoise,
    create_filter,
    run_filter,
    smooth,
)
from relnav_sim.filters.belief import Gaussian
from relnav_sim.filters.ekf import ExtendedKalmanFilter
from relnav_sim.filters.kalman import GaussianFilterOptions
from relnav_sim.filters.run import advance
from relnav_sim.measurements.augmented import AdditiveBias, AugmentedMeasurement
from relnav_sim.measurements.delayed import Delayed
from relnav_sim.measurements.interface import MeasurementDefaults
from relnav_sim.measurements.several import JoinedMeasurement
from relnav_sim.streams import RandomSource

F, Q = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.01 * np.array([[1 / 3, 0.5], [0.5, 1.0]])
DYNAMICS = LinearDynamics(F, Q)
H = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
Z = np.random.default_rng(1).normal(1, 1, (3, 20, 3))


def sensors():
    return {"range": LinearMeasurement(H[:1], np.eye(1)), "rate": LinearMeasurement(H[1:], 0.5 * np.eye(2))}


def both(z=Z):
    return {"range": z[..., :1], "rate": z[..., 1:]}


def run(measurement, z, kind="kf", **options):
    return run_filter(create_filter(kind, DYNAMICS, measurement, **options), z, np.zeros(2), np.eye(2))


@pytest.mark.parametrize(
    ("measurement", "z", "sentence"),
    [
        (sensors(), Z, "z is one array, the filter has the sensors 'range', 'rate'; give the measurements by sensor"),
        ({"range": sensors()["range"]}, Z[..., :1], "z is one array, the filter has the sensors 'range'"),
        (
            sensors()["range"],
            {"range": Z[..., :1]},
            "z gives measurements by sensor, the filter has one",
        ),
        (
            sensors(),
            {**both(), "camera": Z},
            "z has measurements of 'camera', the filter's sensors are 'range', 'rate'",
        ),
        (
            sensors(),
            {"range": Z[..., :1]},
            "z has no measurements of 'rate'; where there are none give an array of NaN",
        ),
        (sensors(), {**both(), "rate": Z[:, :9, 1:]}, "z['rate'] has 3 runs of 9 epochs, z['range'] 3 runs of 20"),
        (sensors(), {**both(), "rate": Z[:2, :, 1:]}, "z['rate'] has 2 runs of 20 epochs, z['range'] 3 runs of 20"),
        (sensors(), {**both(), "rate": Z}, "z['rate'] has 3 components, the measurement 2"),
        (
            sensors(),
            {**both(), "rate": Z[0, :, 1:]},
            "z['rate'] has shape (20, 2); it must be (runs, T, m)",
        ),
        (
            sensors(),
            {**both(), "rate": np.full((3, 20, 2), np.inf)},
            "z['rate'] is infinite at run 0, epoch 0, channel 0",
        ),
        ({}, {}, "the mapping of measurements is empty"),
        ({"": sensors()["range"]}, {}, "'' can't be the name of a sensor"),
        ({1: sensors()["range"]}, {}, "1 can't be the name of a sensor"),
        (
            {**sensors(), "third": LinearMeasurement(np.ones((1, 3)), np.eye(1))},
            {},
            "the measurement of sensor 'third' (columns of H) is for 3 states, the dynamics have 2",
        ),
        (
            {**sensors(), "late": LinearMeasurement(H[:1], np.ones((19, 1, 1)))},
            {**both(), "late": Z[..., :1]},
            "19 epochs",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(measurement, z, sentence):
    with pytest.raises(ValueError) as refused:
        run(measurement, z)
    assert sentence in str(refused.value)
    assert "\n" not in str(refused.value)


class Counting(LinearMeasurement):
    """A linear measurement that takes down the epochs at which its functions are called."""

    def __init__(self, *given):
        super().__init__(*given)
        self.epochs = []

    def predict(self, states, epoch):
        self.epochs.append(epoch)
        return super().predict(states, epoch)


@pytest.mark.parametrize("kind, always", [("kf", False), ("imm", False), ("gaussian_sum", False), ("particle", True)])
def test_a_sensor_that_no_run_reads_is_not_asked(kind, always):
    z = Z.copy()
    z[:, 5:9, 0] = np.nan
    counting = {"range": Counting(H[:1], np.eye(1)), "rate": Counting(H[1:], np.eye(2))}
    filter = create_filter(kind, DYNAMICS, counting)
    belief = filter.start(Gaussian(np.zeros((3, 2)), np.tile(np.eye(2), (3, 1, 1))), RandomSource(1, (0, 1, 2)))
    advance(filter, belief, both(z), 0, 1.0)
    assert set(counting["rate"].epochs) == set(range(20))
    assert set(counting["range"].epochs) == set(range(20)) - (set() if always else {5, 6, 7, 8})


def test_the_numbers_of_an_epoch_and_those_of_its_sensors():
    z = Z.copy()
    z[0, 3, 0], z[1, 4], z[2, 5, 1] = 30.0, np.nan, np.nan
    history = run(sensors(), both(z), gate_probability=0.95)
    assert sorted(history.nis_by) == sorted(history.dof_by) == ["range", "rate"]
    assert history.dof[1, 4] == 0 and np.isnan(history.nis[1, 4]) and history.log_likelihood[1, 4] == 0
    assert history.dof[2, 5] == 2 and history.dof_by["rate"][2, 5] == 1
    rejected = {name: extras["rejected"] for name, extras in history.extras_by.items()}
    assert rejected["range"][0, 3] == 1 and np.isnan(rejected["range"][1, 4])
    read = ~np.isnan(history.nis)
    assert np.array_equal(history.extras["rejected"][read], (rejected["range"] + rejected["rate"])[read])


def test_log_likelihood_is_that_of_the_channels_read():
    """Against the joint density of the whole series, from the covariance of all measurements of one run."""
    z = Z[:1, :6].copy()
    z[0, 1, 0], z[0, 2, 1:], z[0, 3, 2], z[0, 4] = (np.nan,) * 4
    history = run(sensors(), both(z))
    P_at = [np.eye(2)]
    for _ in range(6):
        P_at.append(F @ P_at[-1] @ F.T + Q)
    full = np.zeros((18, 18))
    for i in range(6):
        for j in range(i + 1):
            block = H @ np.linalg.matrix_power(F, i - j) @ P_at[j + 1] @ H.T
            full[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = block
            full[3 * j : 3 * j + 3, 3 * i : 3 * i + 3] = block.T
    full += np.kron(np.eye(6), np.diag([1.0, 0.5, 0.5]))
    values = z[0].ravel()
    there = ~np.isnan(values)
    S, nu = full[np.ix_(there, there)], values[there]
    expected = -0.5 * (nu @ np.linalg.solve(S, nu) + np.linalg.slogdet(S)[1] + len(nu) * np.log(2 * np.pi))
    assert history.log_likelihood.sum() == pytest.approx(expected, rel=1e-12)
    assert history.nis[~np.isnan(history.nis)].sum() == pytest.approx(nu @ np.linalg.solve(S, nu), rel=1e-12)


@pytest.mark.parametrize("kind", ["kf", "imm", "gaussian_sum", "particle", "adaptive_two_step"])
def test_chunks_of_epochs_do_not_show(kind):
    z = Z.copy()
    z[1, 3, 0] = z[0, 9, 2] = z[2, 10, 1:] = z[1, 12] = np.nan
    filter = create_filter(kind, DYNAMICS, sensors())
    prior = Gaussian(np.zeros((3, 2)), np.tile(np.eye(2), (3, 1, 1)))
    start = RandomSource(1, (0, 1, 2))
    whole = advance(filter, filter.start(prior, start), both(z), 0, 1.0)[1]
    belief, parts = filter.start(prior, start), []
    for first, last in ((0, 10), (10, 20)):
        belief, part = advance(filter, belief, both(z[:, first:last]), first, 1.0)
        parts.append(part)
    for name in ("mean", "covariance", "nis", "log_likelihood", "dof"):
        joined = np.concatenate([getattr(part, name) for part in parts], axis=1)
        assert np.array_equal(joined, getattr(whole, name), equal_nan=True), name


def test_masked_entries_are_channels_missing():
    z = Z.copy()
    z[1, 3, 1] = np.nan
    masked = np.ma.masked_invalid(z)
    one = LinearMeasurement(H, np.diag([1.0, 0.5, 0.5]))
    assert np.array_equal(run(one, masked).mean, run(one, z).mean)
    assert run(one, masked).dof[1, 3] == 2


def test_one_sensor_with_a_name_is_the_same_to_the_bit():
    one = LinearMeasurement(H, np.diag([1.0, 0.5, 0.5]))
    plain, named = run(one, Z), run({"radar": one}, {"radar": Z})
    assert np.array_equal(plain.mean, named.mean) and np.array_equal(plain.nis, named.nis_by["radar"])
    assert not plain.nis_by


def test_the_smoother_takes_the_history_of_several_sensors():
    joined = smooth(run(LinearMeasurement(H, np.diag([1.0, 0.5, 0.5])), Z), DYNAMICS)
    apart = smooth(run(sensors(), both()), DYNAMICS)
    assert np.allclose(apart.mean, joined.mean, rtol=0, atol=1e-12)
    assert np.allclose(apart.covariance, joined.covariance, rtol=0, atol=1e-12)


def test_a_failed_run_has_no_numbers_by_sensor_any_more():
    z = Z.copy()
    z[1, 6, 1] = 1e200
    with pytest.warns(RuntimeWarning, match="run 1 at epoch"):
        history = run(sensors(), both(z), kind="particle", particles=50)
    [failure] = history.failures
    lost = 1, slice(failure.epoch, None)
    assert np.isnan(history.nis_by["rate"][lost]).all() and (history.dof_by["rate"][lost] == 0).all()
    assert (history.dof[lost] == 0).all() and history.dof[1, failure.epoch - 1] == 3


# --------------------------------------------------------------------------------- measurements of all kinds


class Whole(LinearMeasurement):
    whole = True


class Heavy(LinearMeasurement):
    """A measurement with a density of its own, of all channels."""

    def log_likelihood(self, z, states, epoch):
        e = np.abs(self.residual(z[:, None], self.predict(states, epoch)))
        return -e.sum(axis=-1)


def partial_z():
    z = Z.copy()
    z[1, 3, 1] = np.nan
    return z


def test_a_whole_reading_with_a_channel_missing_is_missing():
    z, gone = partial_z(), Z.copy()
    gone[1, 3] = np.nan
    R = np.diag([1.0, 0.5, 0.5])
    history, missing = run(Whole(H, R), z), run(LinearMeasurement(H, R), gone)
    assert history.dof[1, 3] == 0
    assert np.array_equal(history.mean, missing.mean)


def test_a_density_of_the_users_own_is_asked_for_whole_readings_only():
    R = np.diag([1.0, 0.5, 0.5])
    with pytest.raises(ValueError, match=r"at epoch 3 has channels missing.*no density.*`whole = True`"):
        run(Heavy(H, R), partial_z(), kind="particle", particles=50)
    # What was refused leaves nothing behind.
    filter = create_filter("particle", DYNAMICS, Heavy(H, R), particles=50)
    with pytest.raises(ValueError, match="no density"):
        run_filter(filter, partial_z(), np.zeros(2), np.eye(2))
    again = run_filter(filter, Z[:2], np.zeros(2), np.eye(2))
    fresh = run(Heavy(H, R), Z[:2], kind="particle", particles=50)
    assert np.array_equal(again.mean, fresh.mean)
    # A filter that takes R alone has no use for the density.
    assert run(Heavy(H, R), partial_z()).dof[1, 3] == 2


def test_a_density_of_the_users_own_among_several_sensors():
    """The particle filter with Heavy(range) and a Gaussian rate has the joint density of both."""
    pair = {"range": Heavy(H[:1], np.eye(1)), "rate": LinearMeasurement(H[1:], 0.5 * np.eye(2))}
    states = np.random.default_rng(2).normal(size=(3, 5, 2))
    joined = JoinedMeasurement(list(pair.values()))
    expected = pair["range"].log_likelihood(Z[:, 0, :1], states, 0) + pair["rate"].log_likelihood(
        Z[:, 0, 1:], states, 0
    )
    assert np.allclose(joined.log_likelihood(Z[:, 0], states, 0), expected, rtol=1e-14)
    history = run(pair, both(), kind="particle", particles=400)
    assert np.isfinite(history.log_likelihood).all() and not history.failures


def test_joined_mixtures_have_every_combination():
    """Against the product of the two densities, with one switch for both channels and with one for each."""
    for shared in (True, False):
        glint = MixtureNoise(np.array([0.7, 0.3]), np.stack([np.eye(2), 9 * np.eye(2)]), shared)
        a, b = LinearMeasurement(H[:1], np.eye(1)), LinearMeasurement(H[1:], glint)
        joined, states = JoinedMeasurement([a, b]), np.random.default_rng(2).normal(size=(3, 5, 2))
        apart = a.log_likelihood(Z[:, 0, :1], states, 0) + b.log_likelihood(Z[:, 0, 1:], states, 0)
        assert np.allclose(joined.log_likelihood(Z[:, 0], states, 0), apart, rtol=1e-12)
        mixture = joined.mixture(states[:, 0], 0)
        assert len(mixture.weights) == (2 if shared else 4) and mixture.weights.sum() == pytest.approx(1)
        total = np.einsum("k,kij->ij", mixture.weights, mixture.covariances)
        assert np.allclose(total, joined.noise(states[:, 0], 0))


class Learning(LinearMeasurement):
    """A measurement that turns its measurements' signs and takes down which epochs it was told of."""

    def __init__(self, *given):
        super().__init__(*given)
        self.told = []

    def take(self, z, first_epoch):
        self.told.append((first_epoch, z.shape))
        return -z


@pytest.mark.parametrize("wrap", [lambda m: m, lambda m: AugmentedMeasurement(m, 2, AdditiveBias(np.zeros((1, 0))))])
def test_a_measurement_is_told_of_its_readings_once_a_chunk(wrap):
    learning = Learning(H[:1], np.eye(1))
    history = run(wrap(learning), Z[..., :1])
    assert learning.told == [(0, (3, 20, 1))]
    assert np.array_equal(history.mean, run(LinearMeasurement(H[:1], np.eye(1)), -Z[..., :1]).mean)
    learning.told.clear()
    run({"range": wrap(learning), "rate": sensors()["rate"]}, both())
    assert learning.told == [(0, (3, 20, 1))]


@pytest.mark.parametrize("wrap", ["delayed", "augmented", "guarded"])
def test_wrapped_measurements_have_partial_readings_too(wrap):
    problem = radar_problem(runs=3, steps=12)

    class Foreign(MeasurementDefaults):
        """Nothing but what a foreign measurement must have, which `create_filter` guards."""

        def __init__(self, channels):
            self._base = FunctionMeasurement(
                lambda x, k: polar(x)[..., channels],
                problem.R[np.ix_(channels, channels)],
                lambda x, k: polar_jacobian(x)[..., channels, :],
                angles=[i for i, c in enumerate(channels) if c],
            )
            self.dimension, self.angles = len(channels), self._base.angles
            self.predict, self.jacobian, self.noise = self._base.predict, self._base.jacobian, self._base.noise

    def measurement(channels):
        base = Foreign(channels)
        if wrap == "delayed":
            return Delayed(base, 0.5)
        return (
            AugmentedMeasurement(base, 6, AdditiveBias(np.zeros((len(channels), 0)))) if wrap == "augmented" else base
        )

    z = problem.z.copy()
    z[..., 1] = np.nan
    partial = run_filter(create_filter("ekf", problem.dynamics, measurement([0, 1, 2])), z, problem.mean0, problem.cov0)
    chosen = run_filter(
        create_filter("ekf", problem.dynamics, measurement([0, 2])), z[..., [0, 2]], problem.mean0, problem.cov0
    )
    assert np.allclose(partial.mean, chosen.mean, rtol=1e-12, atol=0)
    assert np.allclose(partial.log_likelihood, chosen.log_likelihood, rtol=1e-12)


def test_a_filter_that_was_not_made_by_name_takes_readings_as_a_whole():
    """Its measurement can't be told which channels are present."""
    filter = ExtendedKalmanFilter(DYNAMICS, LinearMeasurement(H, np.eye(3)), GaussianFilterOptions())
    history = run_filter(filter, partial_z(), np.zeros(2), np.eye(2))
    assert history.dof[1, 3] == 0 and np.isnan(history.nis[1, 3])


# --------------------------------------------------------------------------------------- what filters learn


def test_a_window_of_innovations_has_as_many_degrees_as_channels_were_read():
    """White innovations of the right size, half of the channels missing: the factor on R stays near one."""
    rng = np.random.default_rng(5)
    runs, epochs = 40, 300
    x = np.zeros((runs, 1))
    z = np.empty((runs, epochs, 3))
    for k in range(epochs):
        x = 0.9 * x + 0.05 * rng.standard_normal((runs, 1))
        z[:, k] = x + 2 * rng.standard_normal((runs, 3))
    z[rng.random(z.shape) < 0.5] = np.nan
    dynamics, measurement = (
        LinearDynamics(0.9 * np.eye(1), 0.0025 * np.eye(1)),
        LinearMeasurement(np.ones((3, 1)), np.eye(3)),
    )
    filter = create_filter("adaptive_alpha_kf", dynamics, measurement, scheme="windowed_nis", window=100)
    alpha = run_filter(filter, z, np.zeros(1), np.eye(1)).extras["alpha"][:, 200:]
    # True variance 4 in units of R; a window of about 150 channels knows it to sqrt(2 / 150) = 12 %, 40 runs to 2 %.
    assert np.nanmean(1 / alpha) == pytest.approx(4, rel=0.06)


@pytest.mark.parametrize("channels", ["independent", "joint"])
def test_the_noise_of_a_channel_is_not_learned_while_it_is_absent(channels):
    rng = np.random.default_rng(6)
    z = np.sqrt([4.0, 1.0, 9.0]) * rng.standard_normal((20, 300, 3))
    z[:, 50:250, 1] = np.nan
    measurement = LinearMeasurement(np.ones((3, 1)), np.eye(3))
    filter = create_filter("adaptive_two_step", LinearDynamics([[0.5]], [[0.01]]), measurement, channels=channels)
    history = run_filter(filter, z, np.zeros(1), np.eye(1))
    sigma = np.stack([history.extras[f"noise_sigma_ratio_{i}"] for i in range(3)], axis=-1)
    assert np.allclose(sigma[:, 51:250, 1], sigma[:, 50:51, 1], rtol=1e-12)
    assert np.allclose(sigma[:, 200:].mean(axis=(0, 1))[[0, 2]], [2, 3], rtol=0.06)


@pytest.mark.parametrize("documented", [create_filter, run_filter, FilterHistory])
def test_the_examples_of_the_public_functions_run(documented):
    tests = doctest.DocTestFinder(recurse=False).find(documented, globs={})
    assert sum(len(test.examples) for test in tests) >= 4, "there is an example"
    for test in tests:
        runner = doctest.DocTestRunner()
        runner.run(test)
        assert runner.failures == 0
    assert inspect.getdoc(documented)


def test_the_example_of_the_page_runs():
    page = (Path(__file__).parents[2] / "docs" / "filters.md").read_text(encoding="utf-8")
    [example] = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names = {}
    exec(example, names)
    assert names["history"].dof.tolist() == [[2, 1, 2]]
