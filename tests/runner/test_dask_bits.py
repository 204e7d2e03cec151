"""A cluster of two worker processes gives the bits of this process, for all that a campaign can have."""

from dataclasses import replace
from pathlib import Path

import pytest
from small_campaign import assert_same_bits
from test_everything_at_once import assert_same_file, made

from relnav_sim import open_results, run_campaign
from relnav_sim.campaign.models import TuneOptions
from relnav_sim.results import shard_files
from relnav_sim.runner import job
from relnav_sim.runner.executors import dask_cluster
from relnav_sim.runner.several import run_campaigns
from relnav_sim.runner.single import run_single
from relnav_sim.tuning import tune_campaign
from relnav_sim.tuning.curve import curve_csv

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def dask():
    from distributed import LocalCluster

    with LocalCluster(2, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=0) as cluster:
        yield {"backend": "dask", "scheduler": cluster.scheduler_address}


def test_bounds_learned_dynamics_and_augmented_states(dask, tmp_path):
    alone = run_campaign(made(), tmp_path / "alone.h5", backend="sequential")
    assert_same_file(alone, run_campaign(made(), tmp_path / "dask.h5", **dask))
    with open_results(tmp_path / "dask.h5") as results:
        assert not results.failures() and not results.missing()
    assert_same_file(
        run_single(made(), 1, 2, tmp_path / "one.h5", backend="sequential"),
        run_single(made(), 1, 2, tmp_path / "one_dask.h5", **dask),
    )


def test_a_tuning_tries_the_same_and_finds_the_same(dask, make_campaign):
    options = TuneOptions(budget=8, runs=3, check_runs=3)
    alone = tune_campaign(make_campaign(), options, workers=1)
    assert curve_csv(tune_campaign(make_campaign(), options, **dask)) == curve_csv(alone)


def test_several_campaigns_as_in_a_replication(dask, make_campaign, tmp_path):
    jobs = [(make_campaign(f"seed={seed}"), tmp_path / f"{seed}.h5") for seed in (1, 2)]
    run_campaigns(jobs, **dask)
    for campaign, out in jobs:
        assert_same_bits(run_campaign(campaign, tmp_path / f"alone_{out.name}", backend="sequential"), out)


@pytest.mark.parametrize("shared", [True, False], ids=["shared folder", "shards travel"])
def test_shards_go_into_the_journal(dask, make_campaign, tmp_path, monkeypatch, shared):
    campaign = make_campaign("runs=8", "block_runs=1")
    if not shared:  # no worker knows the token that is told of
        leave = dask_cluster.leave_token
        monkeypatch.setattr(dask_cluster, "leave_token", lambda folder: replace(leave(folder), secret="another"))
    monkeypatch.setattr(job, "MOST_LOOSE", 3)
    monkeypatch.setattr(job, "pack", lambda folder, most_loose=3: shard_files.pack(folder, most_loose))
    out = run_campaign(campaign, tmp_path / "dask.h5", **dask)
    folder = Path(f"{out}.shards")
    loose, held = list(folder.glob("*.h5")), shard_files.held_shards(folder)[0]
    assert len(loose) <= 3 and len(held) >= 16
    with open_results(out) as results:
        assert sum(results.provenance.machines.values()) >= len(held) and not results.missing()
    assert_same_bits(run_campaign(campaign, tmp_path / "alone.h5", backend="sequential"), out)
    said = []
    run_campaign(campaign, out, say=said.append, **dask)
    assert "every run was finished already" in said
