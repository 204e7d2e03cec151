"""Residuals by channel at full rate, in chunks, against plain NumPy over whole series and against `whiteness`."""

import numpy as np
import pytest
from scipy import stats

from relnav_sim.results import layout
from relnav_sim.statistics.channel_whiteness import ChannelWhiteness, campaign_checks, pooled_whiteness
from relnav_sim.statistics.whiteness import whiteness

LAGS = len(layout.LAGS)
NAMES = ("radar range", "camera azimuth")


def _gathered(x, failed, settled=100, chunk=64):
    one = ChannelWhiteness(len(x), NAMES, settled)
    for first in range(0, x.shape[1], chunk):
        one.add(first, x[:, first : first + chunk], failed)
    return one.result()


def _series(runs=4, epochs=400, seed=0):
    x = np.random.default_rng(seed).standard_normal((runs, epochs, 2)) + 0.2
    x[:, 2::3, 1] = np.nan
    x[:, 0] = np.nan
    return x


def test_against_plain_numpy() -> None:
    x, failed = _series(), np.array([-1, 250, -1, 30])
    found = _gathered(x, failed)
    assert found.names == NAMES
    for run, end in enumerate(np.where(failed < 0, x.shape[1], failed)):
        for span, first in enumerate((1, 100)):
            for c in range(2):
                own = x[run, first:end, c]
                own = own[np.isfinite(own)]
                assert found.count[run, span, c] == len(own)
                if not len(own):
                    assert np.isnan(found.mean[run, span, c]) and np.isnan(found.product[run, span, c]).all()
                    continue
                assert found.mean[run, span, c] == pytest.approx(own.mean(), rel=1e-12)
                for lag in range(LAGS):
                    pairs = own[lag:] * own[: max(0, len(own) - lag)]
                    expected = pairs.mean() if len(pairs) else np.nan
                    assert found.product[run, span, c, lag] == pytest.approx(expected, rel=1e-9, nan_ok=True)


def test_bits_depend_on_no_chunk_and_no_block() -> None:
    x, failed = _series(), np.array([-1, 250, -1, 30])
    whole = _gathered(x, failed)
    other = _gathered(x, failed, chunk=17)
    alone = [_gathered(x[[run]], failed[[run]]) for run in range(4)]
    for part in ("count", "mean", "product"):
        assert getattr(whole, part).tobytes() == getattr(other, part).tobytes()
        assert np.concatenate([getattr(one, part) for one in alone]).tobytes() == getattr(whole, part).tobytes()


def test_pooled_as_whole_series_would_be() -> None:
    """The ends of the runs are all that is left out: terms of lag / n of the mean times a residual."""
    x = _series(epochs=2000)
    found = _gathered(x, np.full(4, -1), settled=1)
    for c in range(2):
        expected = whiteness([run[np.isfinite(run)] for run in x[..., c]], LAGS - 1)
        pooled = pooled_whiteness(found.count[:, 0, c], found.mean[:, 0, c], found.product[:, 0, c])
        assert pooled.count == expected.count and pooled.lags == expected.lags == LAGS - 1
        np.testing.assert_allclose(pooled.correlation, expected.correlation, atol=2e-3)
        assert pooled.bound == expected.bound
        assert pooled.p_value == pytest.approx(expected.p_value, abs=0.05)


def test_white_residuals_are_called_white_as_often_as_they_should_be() -> None:
    """300 campaigns of 5 runs: Ljung and Box's p is uniform, by Kolmogorov's test at 0.1 %, fixed seed."""
    p = []
    for seed in range(300):
        x = np.random.default_rng(seed).standard_normal((5, 300, 2))
        found = _gathered(x, np.full(5, -1), settled=1, chunk=300)
        p.append(pooled_whiteness(found.count[:, 0, 0], found.mean[:, 0, 0], found.product[:, 0, 0]).p_value)
    assert stats.kstest(p, "uniform").pvalue > 0.001


def test_a_correlated_channel_is_found_and_the_other_is_not() -> None:
    rng = np.random.default_rng(5)
    x = rng.standard_normal((6, 1000, 2))
    for k in range(1, 1000):
        x[:, k, 1] = 0.3 * x[:, k - 1, 1] + np.sqrt(1 - 0.09) * x[:, k, 1]
    found = _gathered(x, np.full(6, -1), settled=1)
    range_, azimuth = campaign_checks(found, np.ones(6, dtype=bool), 0)
    assert (range_.name, azimuth.name) == NAMES
    assert not range_.is_correlated(0.025) and azimuth.is_correlated(0.025)
    assert azimuth.whiteness.correlation[:2] == pytest.approx([0.3, 0.09], abs=4 / np.sqrt(6000))
    assert azimuth.normalised_sigma == pytest.approx(np.sqrt(np.mean(x[:, 1:, 1] ** 2)), rel=1e-12)
    assert azimuth.normalised_mean == pytest.approx(x[:, 1:, 1].mean(), rel=1e-9)


def test_nothing_read() -> None:
    found = _gathered(np.full((3, 200, 2), np.nan), np.full(3, -1))
    check = campaign_checks(found, np.ones(3, dtype=bool), 0)[0]
    assert check.count == 0 and check.whiteness.lags == 0 and np.isnan(check.normalised_sigma)
    assert not campaign_checks(found, np.zeros(3, dtype=bool), 0)[0].is_correlated(0.05)
