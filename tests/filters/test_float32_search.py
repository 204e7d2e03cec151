"""Searching, reweighting and sampling filters in float32: beside float64, beside one another, and where they end."""

import numpy as np
import pytest
from joseph_128 import distance, of_filter, problem, reference
from radar_problem import radar_problem

from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian, in_kind
from relnav_sim.linalg import SINGLE
from relnav_sim.streams import RandomSource

EPS = float(np.finfo(np.float32).eps)
SEARCHED = [("iekf", {}), ("two_step", {}), ("adaptive_two_step", {})]
SCALED = [
    ("adaptive_alpha_kf", {}),
    ("adaptive_alpha_kf", {"scheme": "gate"}),
    ("adaptive_alpha_kf", {"scheme": "windowed_nis", "window": 10}),
    ("adaptive_alpha_kf", {"scheme": "responsibilities"}),
]
SAMPLED = [
    ("alpha_kf", {"samples": 256, "sampling": "fixed"}),
    ("mkf", {"samples": 512, "sampling": "antithetic", "proposal": "posterior"}),
    ("skf", {"samples": 64, "iterations": 5}),
]
EACH = [*SEARCHED, *SCALED, *SAMPLED]
NAMES = ["-".join([kind, *map(str, options.values())]) for kind, options in EACH]


@pytest.fixture(scope="module")
def radar():
    made = radar_problem(runs=5, steps=17)
    made.z[1, 4:8] = made.z[2, 10, 1] = made.z[:, 15] = np.nan
    return made


def history(made, kind, rows=slice(None), **options):
    flt = create_filter(kind, made.dynamics, made.measurement, **options)
    return run_filter(flt, made.z[rows], made.mean0[rows], made.cov0, runs=np.arange(len(made.z))[rows].tolist())


@pytest.mark.parametrize("kind, options", EACH, ids=NAMES)
def test_float32_is_near_and_independent_of_the_block(kind, options, radar):
    """The means' distance is what the roundings of state and reading add up to, and where a search may stop."""
    whole, double = history(radar, kind, arithmetic="float32", **options), history(radar, kind, **options)
    sigma = np.sqrt(np.einsum("...ii->...i", double.covariance))
    coarse = (EPS * np.abs(double.mean) / sigma).max()
    mean = np.abs((whole.mean - double.mean) / sigma).max()
    assert 1e-7 < mean < 2 * radar.z.shape[1] * coarse + EPS**0.5
    scale = sigma[..., :, None] * sigma[..., None, :]
    assert np.abs((whole.covariance - double.covariance) / scale).max() < 1e-3
    assert np.nanmax(np.abs(whole.nis - double.nis)) < 30 * mean + 1e-3
    for found in (whole.mean, whole.covariance):
        np.testing.assert_array_equal(found.astype(np.float32), found)
    assert not whole.failures
    for rows in ([1], [2, 4]):
        part = history(radar, kind, rows, arithmetic="float32", **options)
        for name in ("mean", "covariance", "nis"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[rows])


@pytest.mark.parametrize("kind, options", EACH, ids=NAMES)
def test_nothing_of_an_update_comes_back_in_float64(kind, options, radar):
    """An array of float64 anywhere on the way would make the result one."""
    flt = create_filter(kind, radar.dynamics, radar.measurement, arithmetic="float32", **options)
    prior = Gaussian(radar.mean0, np.repeat(radar.cov0[None], 5, axis=0))
    belief = flt.predict(flt.start(prior, RandomSource(0, tuple(range(5)))), Step(0))
    for k in range(2):
        given, z = in_kind(belief, SINGLE), radar.z[:, k].astype(np.float32)
        corrected, _ = flt.correct(given, z, Step(k))
        numbers = [value for value in vars(corrected).values() if value.dtype.kind == "f"]
        assert {value.dtype for value in numbers} == {SINGLE}
        belief = flt.predict(in_kind(corrected, np.dtype(float)), Step(k + 1))


@pytest.mark.parametrize("kind, options", EACH, ids=NAMES)
def test_the_errors_are_those_of_float64(kind, options):
    """RMS of the position over runs: the paired difference is far below what the runs themselves scatter."""
    made = radar_problem(runs=24, steps=25)
    errors = []
    for arithmetic in ("float32", "float64"):
        found = history(made, kind, arithmetic=arithmetic, **options)
        off = np.square(found.mean - made.truth)[..., 10:, :3] if made.truth.shape == found.mean.shape else None
        errors.append(off.sum(axis=2).mean(axis=1))
    single, double = errors
    paired = single - double
    assert np.abs(paired.mean()) <= 3 * paired.std(ddof=1) / len(paired) ** 0.5 + 1e-3 * double.mean()
    assert np.abs(paired).max() < 0.05 * double.mean()


@pytest.mark.parametrize("kind", ["iekf", "two_step"])
def test_a_search_stops_where_float32_tells_nothing_nearer(kind):
    """From a prior as wide as the range: fewer steps than in float64, and as near as the root of the rounding."""
    made = radar_problem(runs=20, steps=1, range_m=400.0)
    made = type(made)(**{**vars(made), "cov0": np.diag([100.0] * 3 + [0.1] * 3) ** 2})
    each = [history(made, kind, arithmetic=arithmetic) for arithmetic in ("float32", "float64")]
    steps = [found.extras["iterations"].max() for found in each]
    assert 2 <= steps[0] <= steps[1] < 20
    sigma = np.sqrt(np.einsum("...ii->...i", each[1].covariance))
    coarse = (EPS * np.abs(each[1].mean) / sigma).max()
    # What a step leaves over is by the last ratio of steps, below a half, shorter than the tolerance.
    readings = EPS * (400 / 4 + 2 * 4 / 1.2e-3)
    assert (np.abs(each[0].mean - each[1].mean) / sigma).max() < EPS**0.5 + readings + 4 * coarse


@pytest.mark.parametrize("kind", ["iekf", "two_step", "adaptive_alpha_kf"])
def test_noise_is_needed_in_every_channel(kind):
    flow, sensor = LinearDynamics(np.eye(2), 0.1 * np.eye(2)), LinearMeasurement([[1.0, 0.2]], [[0.0]])
    with pytest.warns(RuntimeWarning, match="needs noise in every channel"):
        found = run_filter(
            create_filter(kind, flow, sensor, arithmetic="float32"), np.ones((1, 3, 1)), [0, 0], np.eye(2)
        )
    assert found.failures[0].epoch == 0


def test_a_state_in_two_numbers_is_met_in_every_direction():
    """At 1e8, where one number of float32 for a state of 1e4 loses more than 1e-3 of the least sigma."""
    for seed, worse in ((1, True), (3, True), (5, False)):
        given = problem(1e8, seed)
        exact = reference(given)
        two, sound = of_filter("ud_ekf", given, "float32", compensated=True)
        one, _ = of_filter("ud_ekf", given, "float32")
        assert sound and distance(two, exact).mean < 1e-3
        assert (distance(one, exact).mean > 1e-3) == worse
        for (_, held), (_, plain) in zip(two, one, strict=True):
            assert held() == plain()


def test_two_numbers_a_state_need_float32():
    with pytest.raises(ValueError, match="compensated is for arithmetic: float32"):
        create_filter(
            "ud_ekf", LinearDynamics(np.eye(2), np.eye(2)), LinearMeasurement(np.eye(2), np.eye(2)), compensated=True
        )
