"""Streaming statistics against plain NumPy over whole arrays."""

import dataclasses

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from relnav_sim.results import layout
from relnav_sim.results.block import Failure
from relnav_sim.statistics.errors import ErrorAccumulator, ScoringRules

EPOCHS = 301
RULES = ScoringRules(
    step_s=0.2, epochs=EPOCHS, store_every=10, settle_s=20.0, convergence_m=5.0, convergence_hold_s=2.0
)
SETTLED = 99  # the first settled epoch is 100, at index 99 of epochs 1, 2, ...


def _plain(error, span):
    """Return the error with its norms over a span, (runs, K, 8)."""
    part = error[:, span]
    norms = [np.linalg.norm(part[..., :3], axis=-1), np.linalg.norm(part[..., 3:], axis=-1)]
    return np.concatenate([part, np.stack(norms, axis=-1)], axis=-1)


@pytest.mark.parametrize("chunk", [1, 64, 300])
def test_against_plain_numpy(draw_estimates, accumulated, chunk) -> None:
    one = draw_estimates(4, EPOCHS - 1)
    summary = accumulated(one, RULES, chunk).result(cpu_us_per_step=1.5).summary
    nees = {
        block: np.einsum(
            "bki,bki->bk",
            one.error[..., s],
            np.linalg.solve(one.covariance[..., s, s], one.error[..., s, None])[..., 0],
        )
        for block, s in zip(layout.BLOCKS, (slice(0, 6), slice(0, 3), slice(3, 6)), strict=True)
    }
    from scipy.stats import chi2

    for i, span in enumerate((slice(0, None), slice(SETTLED, None))):
        plain = _plain(one.error, span)
        close = {"rtol": 1e-12, "atol": 1e-13}
        np.testing.assert_allclose(summary["mean"][:, i], plain.mean(axis=1), **close)
        np.testing.assert_allclose(summary["std"][:, i], plain.std(axis=1), **close)
        np.testing.assert_allclose(summary["rms"][:, i], np.sqrt((plain**2).mean(axis=1)), **close)
        np.testing.assert_allclose(summary["max"][:, i], np.abs(plain).max(axis=1), **close)
        assert (summary["epochs"][:, i] == plain.shape[1]).all()
        quantiles = np.quantile(plain[..., 6:], layout.PROBABILITIES, axis=1, method="inverted_cdf")
        assert (np.abs(summary["quantile"][:, i] / quantiles.transpose(1, 2, 0) - 1) < 1 / 32).all()
        for b, (block, size) in enumerate(zip(layout.BLOCKS, layout.BLOCK_SIZES, strict=True)):
            part = nees[block][:, span]
            np.testing.assert_allclose(summary["anees"][:, i, b], part.mean(axis=1) / size, rtol=1e-9)
            inside = part[..., None] <= chi2.ppf(layout.LEVELS, size)
            np.testing.assert_array_equal(summary["coverage"][:, i, b], inside.mean(axis=1))
        for run in range(4):
            nis = one.nis[run, span]
            nis = nis[~np.isnan(nis)]
            assert summary["updates"][run, i] == len(nis)
            d = nis - nis.mean()
            np.testing.assert_allclose(summary["nis_mean"][run, i], nis.mean(), **close)
            np.testing.assert_allclose(summary["nis_lag1"][run, i], (d[1:] @ d[:-1]) / (d @ d), rtol=1e-9)
        np.testing.assert_allclose(summary["log_likelihood"][:, i], one.log_likelihood[:, span].sum(axis=1), **close)
    assert (summary["cpu_per_step"] == 1.5).all() and (summary["failed"] == 0).all()


def test_small_spread_on_a_large_mean_keeps_its_digits(draw_estimates, accumulated) -> None:
    one = draw_estimates(2, EPOCHS - 1)
    one.error[...] = 1e6 + 1e-3 * np.sin(np.arange(EPOCHS - 1))[:, None]
    std = accumulated(one, RULES).result().summary["std"][:, 0, :6]
    np.testing.assert_allclose(std, 1e-3 * np.sin(np.arange(EPOCHS - 1)).std(), rtol=1e-6)


def test_stored_series_and_the_start(draw_estimates, same_bits) -> None:
    one = draw_estimates(3, EPOCHS)
    one.error[:, 0] = 1e9
    with_start, without = ErrorAccumulator(3, RULES), ErrorAccumulator(3, RULES)
    times = 0.2 * np.arange(EPOCHS)
    with_start.add(times, one.error, one.covariance, one.nis, one.log_likelihood)
    late = one.part(slice(None), slice(1, None))
    without.add(times[1:], late.error, late.covariance, late.nis, late.log_likelihood)
    a, b = with_start.result(), without.result()
    np.testing.assert_array_equal(a.error, one.error[:, ::10].astype(np.float32))
    sigma = np.sqrt(np.diagonal(one.covariance, axis1=-2, axis2=-1))[:, ::10]
    np.testing.assert_array_equal(a.sigma, sigma.astype(np.float32))
    np.testing.assert_array_equal(a.nis, one.nis[:, ::10].astype(np.float32))
    assert RULES.stored_s.tolist() == times[::10].tolist() and a.nees.shape == (3, 31)
    for name in ("mean", "quantile", "coverage", "convergence", "nis_lag1"):
        assert np.asarray(a.summary[name]).tobytes() == np.asarray(b.summary[name]).tobytes()
    assert np.isnan(b.error[:, 0]).all()


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_split_of_the_runs_gives_the_same_bits(draw_estimates, accumulated, same_bits, data) -> None:
    runs = 6
    one = draw_estimates(runs, EPOCHS - 1, seed=data.draw(st.integers(0, 10)))
    one.nis[1] = np.nan
    one.nis[2, ::7] = np.nan
    if data.draw(st.booleans()):
        one.error[3, 140, 2] = np.nan
        one.covariance[4, 20] -= 100 * np.eye(6)
    chunk = data.draw(st.sampled_from([17, 128, 300]))
    whole = _everything(accumulated(one, RULES, chunk).result())
    cuts = sorted(data.draw(st.sets(st.integers(1, runs - 1))))
    blocks = [list(range(a, b)) for a, b in zip([0, *cuts], [*cuts, runs], strict=True)]
    for block in [*blocks, *[[run] for run in range(runs)]]:
        part = _everything(accumulated(one.part(block), RULES, chunk).result())
        assert part.keys() == whole.keys()
        for name, array in part.items():
            assert array.tobytes() == np.ascontiguousarray(whole[name][block]).tobytes(), (name, block)


def _everything(result):
    return result.arrays() | dict(result.diagnostics)


def test_diagnostics_are_means_over_updates(draw_estimates, accumulated) -> None:
    one = draw_estimates(4, EPOCHS - 1)
    one.nis[3] = np.nan
    result = accumulated(one, RULES, 64).result()
    assert set(result.diagnostics) == {"rejected", "nis"}
    known = one.nis[:3, [k for k in range(EPOCHS - 1) if k % 3 != 2]]
    np.testing.assert_array_equal(result.diagnostics["rejected"][:3], (known > 5).mean(axis=1))
    np.testing.assert_allclose(result.diagnostics["nis"], result.summary["nis_mean"][:, 0], rtol=1e-12)
    assert np.isnan(result.diagnostics["rejected"][3])


def test_the_last_half_outside_the_widest_ellipsoid(draw_estimates, accumulated) -> None:
    one = draw_estimates(3, EPOCHS - 1)
    one.error[1, 200:] *= 100
    one.error[2, :100] *= 100
    outside = accumulated(one, RULES, 64).result().summary["outside_late"]
    late = EPOCHS - EPOCHS // 2  # epochs from the middle on; those from 201 are outside
    assert outside[0] <= 2 / late and outside[2] <= 2 / late
    assert outside[1] == pytest.approx((EPOCHS - 201) / late, abs=2 / late)


def test_memory_order_of_the_input_does_not_show(draw_estimates, accumulated, same_bits) -> None:
    one = draw_estimates(5, EPOCHS - 1)
    turned = dataclasses.replace(
        one, **{name: np.asfortranarray(getattr(one, name)) for name in one.__dataclass_fields__}
    )
    same_bits(accumulated(one, RULES).result(), accumulated(turned, RULES).result())


@pytest.mark.parametrize("chunk", [50, 300])
def test_failures_end_their_own_run_only(draw_estimates, accumulated, chunk) -> None:
    one = draw_estimates(6, EPOCHS - 1)
    clean = accumulated(one, RULES, chunk).result().arrays()
    one.error[1, 149, 4] = np.nan
    one.covariance[2, 149, 3, 3] = np.inf
    one.covariance[3, 149] -= 1e4 * np.eye(6)
    one.error[3, 151] = np.inf
    one.error[4, :] = np.inf
    with np.errstate(all="raise"):
        accumulator = accumulated(one, RULES, chunk)
        result = accumulator.result()
    assert accumulator.failed_epoch.tolist() == [-1, 150, 150, 150, 1, -1]
    assert accumulator.failures("ekf", range(10, 16)) == (
        Failure(11, "ekf", 150, "non-finite mean"),
        Failure(12, "ekf", 150, "non-finite covariance"),
        Failure(13, "ekf", 150, "covariance not positive definite"),
        Failure(14, "ekf", 1, "non-finite mean"),
    )
    arrays = result.arrays()
    assert arrays["failed"].tolist() == [0, 1, 1, 1, 1, 0]
    for run in (0, 5):
        assert all(arrays[name][run].tobytes() == clean[name][run].tobytes() for name in arrays)
    for run in (1, 2, 3):
        assert arrays["epochs"][run].tolist() == [149, 50]
        assert arrays["updates"][run].tolist() == [
            np.isfinite(one.nis[run, :149]).sum(),
            np.isfinite(one.nis[run, 99:149]).sum(),
        ]
        plain = _plain(one.error[[run]], slice(0, 149))
        np.testing.assert_allclose(arrays["std"][run, 0], plain.std(axis=1)[0], rtol=1e-12)
        assert np.isfinite(arrays["error"][run, 1:15]).all() and np.isnan(arrays["error"][run, 15:]).all()
        assert np.isnan(arrays["sigma"][run, 15:]).all() and np.isnan(arrays["nees"][run, 15:]).all()
        assert np.isnan(arrays["convergence_final"][run])
    assert arrays["epochs"][4].tolist() == [0, 0]
    for name in ("mean", "rms", "max", "quantile", "anees", "coverage", "nis_mean", "log_likelihood", "convergence"):
        assert np.isnan(arrays[name][4]).all(), name


def test_a_run_that_never_settles_has_no_settled_figures(draw_estimates, accumulated) -> None:
    rules = dataclasses.replace(RULES, settle_s=1e4)
    summary = accumulated(draw_estimates(2, EPOCHS - 1), rules).result().summary
    assert np.isfinite(summary["rms"][:, 0]).all() and np.isnan(summary["rms"][:, 1]).all()
    assert (summary["epochs"][:, 1] == 0).all() and np.isnan(summary["convergence_relative"]).all()


@pytest.mark.parametrize(("settle_s", "epoch"), [(0.0, 1), (0.2, 1), (0.6, 3), (0.61, 4), (100.0, 500)])
def test_the_settled_span_begins_at_the_first_epoch_not_before_settle_s(settle_s: float, epoch: int) -> None:
    assert dataclasses.replace(RULES, settle_s=settle_s).settled_epoch == epoch


def test_chunks_must_continue_and_fit(draw_estimates) -> None:
    one = draw_estimates(2, 10)
    arrays = (one.error, one.covariance, one.nis, one.log_likelihood)
    accumulator = ErrorAccumulator(2, dataclasses.replace(RULES, epochs=15))
    with pytest.raises(ValueError, match="begins at epoch 2, not at the start"):
        accumulator.add(0.2 * np.arange(2, 12), *arrays)
    accumulator.add(0.2 * np.arange(1, 11), *arrays)
    with pytest.raises(ValueError, match="begins at epoch 10, not at 11"):
        accumulator.add(0.2 * np.arange(10, 20), *arrays)
    with pytest.raises(ValueError, match="beyond the run's 15 epochs"):
        accumulator.add(0.2 * np.arange(11, 21), *arrays)
    with pytest.raises(ValueError, match="for 3 runs, 10 epochs"):
        ErrorAccumulator(3, RULES).add(0.2 * np.arange(10), *arrays)


def test_a_diverged_but_finite_run_is_counted_without_a_warning(draw_estimates, accumulated) -> None:
    one = draw_estimates(2, EPOCHS - 1)
    one.error[0, 200:] = 1e200
    with np.errstate(all="raise"):
        summary = accumulated(one, RULES).result().summary
    assert summary["failed"].tolist() == [0, 0]
    assert summary["max"][0, 0, 0] == 1e200 and not np.isfinite(summary["rms"][0, 0, 6])
    assert np.isfinite(summary["rms"][1]).all()


def test_covariances_are_stored_whole_where_they_are_asked_for(draw_estimates, accumulated) -> None:
    rules = dataclasses.replace(RULES, store_covariance=True)
    one = draw_estimates(3, EPOCHS - 1)
    one.error[1, 150, 2] = np.nan
    found = accumulated(one, rules, 64).result()
    assert found.covariance_root.dtype == np.float32
    stored = np.arange(10, EPOCHS, 10)
    expected = np.linalg.cholesky(one.covariance[:, stored - 1])[..., *np.tril_indices(6)]
    good = np.ones((3, len(stored)), dtype=bool)
    good[1, stored > 150] = False
    roots = found.covariance_root[:, 1:]
    np.testing.assert_allclose(roots[good], expected[good], rtol=2e-7, atol=1e-7)
    assert np.isnan(roots[~good]).all()
    parts = [accumulated(one.part([run]), rules, 37).result().covariance_root[0] for run in range(3)]
    assert np.array(parts).tobytes() == found.covariance_root.tobytes()
    assert accumulated(one, RULES, 64).result().covariance_root is None
