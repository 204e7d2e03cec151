"""NIS and readings by sensor against plain NumPy, SciPy's chi-square and closed forms."""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from relnav_sim.results.block import BySensor
from relnav_sim.statistics.consistency import at_common_dof
from relnav_sim.statistics.errors import ErrorAccumulator, ScoringRules
from relnav_sim.statistics.intervals import chi_square_band, lag1_band, sum_band
from relnav_sim.statistics.readings import NisOfSensors

EPOCHS = 300
RULES = ScoringRules(
    step_s=0.2, epochs=EPOCHS + 1, store_every=10, settle_s=20.0, convergence_m=5.0, convergence_hold_s=2.0
)
SETTLED = 99


def mixed(runs: int, seed: int = 0) -> NisOfSensors:
    """A radar whose readings have 0 to 3 channels, and a camera at every seventh epoch; both consistent."""
    rng = np.random.default_rng(seed)
    camera = np.zeros((runs, EPOCHS), dtype=np.int64)
    camera[:, 6::7] = 2
    dof = {"radar": rng.integers(0, 4, (runs, EPOCHS)), "camera": camera}
    return NisOfSensors(
        {name: np.where(d > 0, rng.chisquare(np.maximum(d, 1)), np.nan) for name, d in dof.items()}, dof
    )


def whole(radar_alone: NisOfSensors) -> np.ndarray:
    read = np.any([d > 0 for d in radar_alone.dof.values()], axis=0)
    return np.where(read, np.nansum(list(radar_alone.nis.values()), axis=0), np.nan)


def counted(given: NisOfSensors, chunk: int = 64, lost: int | None = None, tell: bool = True) -> ErrorAccumulator:
    """Return what an accumulator makes of it; the first run fails at epoch ``lost``."""
    nis = whole(given)
    runs = len(nis)
    accumulator = ErrorAccumulator(runs, RULES)
    error = np.zeros((runs, EPOCHS, 6))
    if lost is not None:
        error[0, lost - 1 :] = np.nan
    for start in range(0, EPOCHS, chunk):
        part = slice(start, min(start + chunk, EPOCHS))
        K = part.stop - part.start
        inner = NisOfSensors(*({name: v[:, part] for name, v in of.items()} for of in (given.nis, given.dof)))
        accumulator.add(
            RULES.step_s * (1 + start + np.arange(K)), error[:, part], np.broadcast_to(np.eye(6), (runs, K, 6, 6)),
            nis[:, part], np.zeros((runs, K)), by_sensor=inner if tell else None,
        )  # fmt: skip
    return accumulator


def told(accumulator: ErrorAccumulator) -> BySensor:
    found = accumulator.result().by_sensor
    assert found is not None
    return found


def test_sums_against_plain_numpy() -> None:
    given = mixed(4)
    found = told(counted(given))
    assert found.names == ("radar", "camera")
    for place, name in enumerate(found.names):
        nis, dof = given.nis[name], given.dof[name]
        for span, part in enumerate((slice(None), slice(SETTLED, None))):
            np.testing.assert_allclose(found.nis_sum[:, span, place], np.nansum(nis[:, part], axis=1), rtol=1e-13)
            np.testing.assert_array_equal(found.dof_sum[:, span, place], dof[:, part].sum(axis=1))
            np.testing.assert_array_equal(found.updates[:, span, place], (dof[:, part] > 0).sum(axis=1))
        np.testing.assert_array_equal(found.nis[:, 1:, place], nis[:, 9::10].astype(np.float32))
        np.testing.assert_array_equal(found.dof[:, 1:, place], dof[:, 9::10])
    # Between two stored epochs lie ten, the later of the two among them.
    read = np.stack([d > 0 for d in given.dof.values()], axis=-1).reshape(4, EPOCHS // 10, 10, 2)
    np.testing.assert_array_equal(found.readings[:, 1:], read.sum(axis=2))
    assert (found.readings[:, 0] == 0).all() and (found.dof[:, 0] == 0).all()


def test_autocorrelation_is_that_of_numpy_on_common_degrees() -> None:
    given = mixed(3)
    for place, name in enumerate(given.nis):
        lag1 = told(counted(given)).nis_lag1[:, 0, place]
        for run in range(3):
            d = given.dof[name][run][given.dof[name][run] > 0].astype(float)
            x = (given.nis[name][run][given.dof[name][run] > 0] - d) / np.sqrt(2 * d)
            x -= x.mean()
            assert lag1[run] == pytest.approx((x[1:] @ x[:-1]) / (x @ x), rel=1e-9)


def test_alternating_dimensions_are_no_correlation() -> None:
    """Readings of one and of six channels in turn: the plain NIS is correlated by that, the NIS alike is white."""
    rng = np.random.default_rng(5)
    dof = np.tile([1, 6], (40, EPOCHS // 2))
    nis = rng.chisquare(dof)
    found = counted(NisOfSensors({"radar": nis}, {"radar": dof})).result()
    plain = nis - nis.mean(axis=1, keepdims=True)
    raw = (plain[:, 1:] * plain[:, :-1]).sum(axis=1) / (plain**2).sum(axis=1)
    lag1 = found.summary["nis_lag1"][:, 0]
    band = lag1_band(40 * EPOCHS, level=0.999)
    assert raw.mean() < -0.3
    assert band.low < lag1.mean() < band.high
    np.testing.assert_array_equal(lag1, found.by_sensor.nis_lag1[:, 0, 0])


def test_common_degrees_have_their_mean_and_variance() -> None:
    """x = NIS sqrt(c/d) - (sqrt(c d) - c), with E NIS = d and var NIS = 2 d, has mean c and variance 2 c."""
    for d in (1, 2, 3, 6):
        ends = at_common_dof(np.array([[0.0, 1.0]]), np.array([[d, d]]), np.array([3]))[0]
        slope = ends[1] - ends[0]
        assert slope * d + ends[0] == pytest.approx(3, rel=1e-14)
        assert slope**2 * 2 * d == pytest.approx(6, rel=1e-14)
    nis = np.random.default_rng(0).chisquare(3, (1, 1000))
    assert at_common_dof(nis, np.full((1, 1000), 3), np.array([3])).tobytes() == nis.tobytes()


def test_one_sensor_of_constant_dimension_changes_no_bit_of_the_rest() -> None:
    dof = np.where(np.arange(EPOCHS) % 3 == 2, 0, 3) * np.ones((5, 1), dtype=np.int64)
    nis = np.where(dof > 0, np.random.default_rng(1).chisquare(3, dof.shape), np.nan)
    given = NisOfSensors({"radar": nis}, {"radar": dof})
    plain, by_sensor = counted(given, tell=False).result(), counted(given).result()
    assert plain.by_sensor is None and by_sensor.by_sensor is not None
    for (name, one), other in zip(plain.arrays().items(), by_sensor.arrays().values(), strict=True):
        assert one.tobytes() == other.tobytes(), name
    assert by_sensor.by_sensor.nis_lag1[..., 0].tobytes() == by_sensor.summary["nis_lag1"].tobytes()


def test_a_run_has_the_same_bits_in_any_block() -> None:
    """Also one whose readings are complete, beside runs whose readings are not."""
    given = mixed(4)
    given.dof["radar"][2] = 3
    given.nis["radar"][2] = np.random.default_rng(8).chisquare(3, EPOCHS)
    given.dof["camera"][2] = 0
    given.nis["camera"][2] = np.nan
    together = counted(given).result()
    for run in range(4):
        one = NisOfSensors(*({name: v[[run]] for name, v in of.items()} for of in (given.nis, given.dof)))
        alone = counted(one).result()
        for (name, ours), theirs in zip(
            alone.arrays(alone.columns).items(), together.arrays(together.columns).values(), strict=True
        ):
            assert ours[0].tobytes() == theirs[run].tobytes(), name


def test_a_failure_ends_the_nis_but_not_the_readings() -> None:
    given = mixed(2)
    found, before = told(counted(given, lost=151)), slice(0, 150)
    assert found.dof_sum[0, 0].tolist() == [int(d[0, before].sum()) for d in given.dof.values()]
    assert np.isnan(found.nis[0, 16:]).all() and (found.dof[0, 16:] == 0).all()
    np.testing.assert_array_equal(found.readings, told(counted(given)).readings)


def test_band_of_mixed_degrees_in_closed_form() -> None:
    dof = np.concatenate([np.full(700, 3), np.full(200, 2), np.full(100, 1)])
    band = sum_band(dof.sum(), dof.sum())
    np.testing.assert_allclose([band.low, band.high], stats.chi2.ppf([0.025, 0.975], 2600) / 2600, rtol=1e-12)
    assert dataclasses.astuple(sum_band(3 * 50, 50)) == dataclasses.astuple(chi_square_band(50, 3, normalised=False))
    with pytest.raises(ValueError, match="at least one degree"):
        sum_band(0, 1)


def test_the_band_holds_95_percent_of_consistent_campaigns() -> None:
    """Means per degree of freedom over partial readings, 2000 campaigns: 95 % within four standard errors."""
    rng = np.random.default_rng(2)
    dof = rng.integers(1, 4, (2000, 30))
    total, degrees = rng.chisquare(dof).sum(axis=1), dof.sum(axis=1)
    bands = {d: sum_band(d, d) for d in np.unique(degrees).tolist()}
    inside = np.mean([bands[d].low <= s / d <= bands[d].high for s, d in zip(total, degrees.tolist(), strict=True)])
    assert abs(inside - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 2000)
