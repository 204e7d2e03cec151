"""Whole campaigns: the same bits however the work is cut, extended, resumed; changes refused, nothing lost."""

import shutil
from typing import ClassVar

import numpy as np
import pytest
from small_campaign import assert_same_bits, data_of
from threadpoolctl import threadpool_info, threadpool_limits

from relnav_sim import open_results, run_campaign
from relnav_sim.filters import registry
from relnav_sim.filters.kalman import GaussianFilterOptions, KalmanFilter
from relnav_sim.results.block import RefusedError
from relnav_sim.results.changes import changed_keys


@pytest.fixture(scope="module")
def computed(make_campaign, tmp_path_factory):
    """A folder with the whole campaign, shards and all."""
    folder = tmp_path_factory.mktemp("computed")
    run_campaign(make_campaign(), folder / "reference.h5", backend="sequential")
    return folder


@pytest.fixture
def reference(computed, tmp_path):
    shutil.copytree(computed, tmp_path, dirs_exist_ok=True)
    return tmp_path / "reference.h5"


@pytest.mark.parametrize(
    "workers, backend",
    [
        (2, "loky"),
        *(pytest.param(*other, marks=pytest.mark.slow) for other in ((2, "sequential"), (1, "loky"), (4, "loky"))),
    ],
)
def test_workers_and_backend_do_not_show(campaign, tmp_path, reference, workers, backend):
    out = run_campaign(campaign(), tmp_path / "out.h5", workers=workers, backend=backend)
    assert_same_bits(reference, out)


@pytest.mark.parametrize("size", [1, *(pytest.param(size, marks=pytest.mark.slow) for size in (2, 5, 6))])
def test_the_block_does_not_show(campaign, tmp_path, reference, size):
    out = run_campaign(campaign(f"block_runs={size}"), tmp_path / "out.h5", backend="sequential")
    assert_same_bits(reference, out)


def test_more_runs_filters_and_cases_leave_what_is_there(campaign, tmp_path):
    out = tmp_path / "out.h5"
    small = campaign("runs=3", "grid={sensors.radar.noise: [{kind: gaussian}]}")
    run_campaign(small, out, backend="sequential")
    before = data_of(out)
    for grown in (
        campaign("runs=5", "grid={sensors.radar.noise: [{kind: gaussian}]}"),
        campaign("runs=5"),
        campaign("runs=5", "filters.wide={kind: kf, r_scale: 4}"),
    ):
        said = []
        run_campaign(grown, out, backend="sequential", say=said.append)
        assert any("finished blocks found" in sentence for sentence in said)
        after = data_of(out)
        for key, array in before.items():
            if len(key) == 3 and key[1]:
                assert after[key][: len(array)].tobytes() == array.tobytes(), key
    fresh = run_campaign(grown, tmp_path / "fresh.h5", backend="sequential")
    assert_same_bits(out, fresh)


def test_a_torn_or_missing_shard_is_computed_again(campaign, tmp_path, reference):
    folder = reference.with_name("reference.h5.shards")
    shards = sorted(folder.glob("*.h5"))
    shards[0].write_bytes(shards[0].read_bytes()[:5000])
    shards[1].unlink()
    kept = tmp_path / "kept.h5"
    kept.write_bytes(reference.read_bytes())
    said = []
    run_campaign(campaign(), reference, backend="sequential", say=said.append)
    assert_same_bits(kept, reference)
    assert any(str(shards[0]) in sentence and "computing it again" in sentence for sentence in said)


def test_a_result_without_its_shards_is_never_written_over(campaign, tmp_path, reference):
    for shard in (tmp_path / "reference.h5.shards").glob("*.h5"):
        shard.unlink()
    before = reference.read_bytes()
    with pytest.raises(RefusedError, match="its shards are gone"):
        run_campaign(campaign("runs=7"), reference, backend="sequential")
    assert reference.read_bytes() == before


@pytest.mark.parametrize(
    "change, key",
    [
        ("sensors.radar.range_sigma_m=3", "sensors.radar.range_sigma_m"),
        ("seed=6", "seed"),
        ("filters.kf.r_scale=2", "filters.kf.r_scale"),
        ("clock.step_s=2", "clock.step_s"),
    ],
)
def test_a_changed_campaign_is_refused_with_the_key_named(campaign, tmp_path, reference, change, key):
    before = reference.read_bytes()
    with pytest.raises(RefusedError, match=key):
        run_campaign(campaign(change), reference, backend="sequential")
    assert reference.read_bytes() == before


def test_fresh_moves_the_old_result_aside(campaign, tmp_path, reference):
    before = reference.read_bytes()
    run_campaign(campaign("seed=6"), reference, backend="sequential", fresh=True)
    (aside,) = tmp_path.glob("reference.h5.before-*")
    assert aside.read_bytes() == before


def test_parts_of_a_campaign_merge_to_the_whole(campaign, tmp_path, reference):
    out = tmp_path / "out.h5"
    run_campaign(campaign("block_runs=1"), out, backend="sequential", part=(1, 2))
    with open_results(out) as results:
        assert results.missing()
    run_campaign(campaign("block_runs=1"), out, backend="sequential", part=(2, 2))
    assert_same_bits(reference, out)


@pytest.fixture(autouse=True)
def bad_filters(monkeypatch):
    """Register the bad filters for one test only: they are no kinds that a schema should list."""
    registry.filter_kinds()
    monkeypatch.setattr(registry, "_KINDS", dict(registry._KINDS))
    for name, bad in (("test_raises", Raises), ("test_diverges", Diverges)):
        registry.register_filter(name, GaussianFilterOptions)(bad)


class Raises(KalmanFilter):
    """A filter that raises an exception in run 3."""

    def __init__(self, dynamics, measurement, options):
        super().__init__(dynamics, measurement, type("Options", (), {"gate_probability": None, "r_scale": 1.0}))

    def start(self, prior, source):
        self.cursed = 3 in source.runs
        return prior

    def correct(self, belief, z, step):
        if self.cursed and step.epoch == 12:
            raise ZeroDivisionError("the state became too interesting")
        return super().correct(belief, z, step)


class CountsThreads(Raises):
    """A filter that notes on how many threads the libraries of linear algebra compute."""

    seen: ClassVar[list[int]] = []

    def correct(self, belief, z, step):
        self.seen.extend(library["num_threads"] for library in threadpool_info())
        return KalmanFilter.correct(self, belief, z, step)


def test_a_block_computes_on_one_thread(campaign, tmp_path, monkeypatch):
    monkeypatch.setattr(CountsThreads, "seen", [])
    registry.register_filter("counts_threads", GaussianFilterOptions)(CountsThreads)
    of_one = campaign("filters={counts: {kind: counts_threads}}", "runs=1", "bound=false")
    with threadpool_limits(2):
        before = [library["num_threads"] for library in threadpool_info()]
        run_campaign(of_one, tmp_path / "out.h5", backend="sequential")
        assert [library["num_threads"] for library in threadpool_info()] == before
    assert 2 in before and set(CountsThreads.seen) == {1}


class Diverges(Raises):
    """A filter whose covariance becomes infinite in run 3."""

    def correct(self, belief, z, step):
        belief, innovation = KalmanFilter.correct(self, belief, z, step)
        if self.cursed and step.epoch == 12:
            belief.covariance[3 % len(z)] = np.inf
        return belief, innovation


def test_one_bad_run_costs_only_itself(campaign, tmp_path, reference):
    out = tmp_path / "out.h5"
    run_campaign(campaign("filters.bad={kind: test_raises}", "bound=false"), out, backend="sequential")
    with open_results(out) as results, open_results(reference) as good:
        for case in range(2):
            failures = [failure for _, failure in results.failures(case)]
            assert [(f.run, f.filter) for f in failures] == [(3, "bad")]
            words = "ZeroDivisionError: the state became too interesting (test_run_campaign.py:"
            assert failures[0].reason.startswith(words)
            assert results.statistic(case, "bad", "failed").tolist() == [0, 0, 0, 1, 0, 0]
            rms = results.statistic(case, "bad", "rms")
            assert np.isfinite(np.delete(rms, 3, axis=0)).all()
            for name in ("kf", "ekf"):
                assert np.array_equal(results.statistic(case, name, "rms"), good.statistic(case, name, "rms"))


def test_a_filter_that_becomes_infinite_fails_at_its_epoch(campaign, tmp_path):
    out = tmp_path / "out.h5"
    run_campaign(campaign("filters.bad={kind: test_diverges}", "bound=false"), out, backend="sequential")
    with open_results(out) as results:
        ((_, failure),) = results.failures(0)
        assert (failure.run, failure.filter, failure.epoch) == (3, "bad", 12)
        assert "covariance" in failure.reason or "mean" in failure.reason


def test_max_failures_stops_and_keeps_what_is_finished(campaign, tmp_path):
    out, said = tmp_path / "out.h5", []
    run_campaign(
        campaign("filters.bad={kind: test_raises}", "block_runs=1", "bound=false"),
        out,
        backend="sequential",
        max_failures=0,
        say=said.append,
    )
    assert any("stopped: 1 failures" in sentence for sentence in said)
    with open_results(out) as results:
        assert results.missing()
        assert len(results.case_runs(0, "kf")) == 4


def test_a_missing_first_fix_fails_that_run_with_its_reason(campaign, tmp_path):
    out = tmp_path / "out.h5"
    parsed = campaign(
        "sensors.radar.range_limits_m=[100, 2000]", "truth.dispersions.relative_position.sigma_m=200", "bound=false"
    )
    run_campaign(parsed, out, backend="sequential")
    with open_results(out) as results:
        failed = results.statistic(0, "kf", "failed").astype(bool)
        assert failed.any() and not failed.all()
        reasons = {failure.reason for _, failure in results.failures(0)}
        assert reasons == {"no measurement at 0 s that gives a position, where the start is the first fix"}


def test_changed_keys_ignores_what_only_extends():
    old = {"runs": 1, "filters": {"a": {"x": 1}}, "grid": {"clock.step_s": [1]}, "clock": {"step_s": 1, "n": 2}}
    new = {"runs": 9, "filters": {"a": {"x": 1}, "b": {"x": 2}}, "grid": {}, "clock": {"step_s": 2, "n": 2}}
    assert changed_keys(old, new) == []
    assert changed_keys(old, {**new, "clock": {"step_s": 2, "n": 3}}) == ["clock.n"]
    assert changed_keys(old, {**new, "filters": {"a": {"x": 1, "y": 2}}}) == ["filters.a.y"]
