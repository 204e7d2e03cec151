"""Parts of a campaign merge to the file of a single machine; what does not fit is refused by name."""

import itertools

import h5py
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_campaign import assert_same_bits

from relnav_sim import run_campaign
from relnav_sim.results import seal
from relnav_sim.results.block import RefusedError, ResultsError
from relnav_sim.runner.merging import merge_results, missing_of_parts
from relnav_sim.runner.shard_folder import shard_folder
from relnav_sim.runner.single import run_single

PARTS = 3


@pytest.fixture(scope="module")
def parts(tmp_path_factory, make_campaign):
    """The campaign on one machine, and in three parts on others."""
    folder = tmp_path_factory.mktemp("parts")
    whole = run_campaign(make_campaign(), folder / "whole.h5", backend="sequential")
    found = [
        run_campaign(make_campaign("block_runs=1"), folder / f"{i}.h5", backend="sequential", part=(i, PARTS))
        for i in range(1, PARTS + 1)
    ]
    return whole, found


def everything(path):
    """Every dataset and attribute but provenance and timings, byte by byte."""
    found = {}
    times = {
        "versions",
        "git_commit",
        "git_dirty",
        "machine",
        "command_line",
        "started",
        "finished",
        "wall_time_s",
        "sessions",
        "merged_from",  # of shards with their measured times
    }

    def visit(name, item):
        for key, value in item.attrs.items():
            if key not in times | {"DIMENSION_LIST", "REFERENCE_LIST", "campaign_content"}:
                found[name, key] = repr(value)
        if isinstance(item, h5py.Dataset) and not item.attrs.get("timing"):
            found[name] = repr(item[...].tolist())

    with h5py.File(path) as file:
        visit("", file)
        file.visititems(visit)
    return found


def test_merged_is_the_file_of_one_machine(parts, tmp_path):
    whole, found = parts
    out = merge_results(tmp_path / "merged.h5", found)
    assert_same_bits(whole, out)
    assert everything(whole) == everything(out)


counter = itertools.count()


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
@pytest.mark.slow
def test_any_order_repetition_and_form_gives_the_same_or_names_what_is_missing(parts, tmp_path, data):
    whole, found = parts
    chosen = data.draw(st.lists(st.tuples(st.integers(0, PARTS), st.booleans()), min_size=1, max_size=6))
    files = [whole, *found]
    given_paths = [shard_folder(files[i]) if as_folder else files[i] for i, as_folder in chosen]
    out = tmp_path / f"merged_{next(counter)}.h5"
    if 0 in {i for i, _ in chosen} or {1, 2, 3} <= {i for i, _ in chosen}:
        assert_same_bits(whole, merge_results(out, given_paths))
    else:
        with pytest.raises(RefusedError, match=r"runs are missing: case .*noise.kind=gaussian, filter kf: run"):
            merge_results(out, given_paths)
        assert not out.exists()


def test_missing_runs_are_named(parts, tmp_path):
    with pytest.raises(RefusedError, match="filter ekf: runs 1, 4"):
        merge_results(tmp_path / "merged.h5", [parts[1][0], parts[1][2]])
    missing = missing_of_parts([parts[1][0], parts[1][2]])
    assert {one.runs for one in missing} == {(1, 4)} and {one.filter for one in missing} == {"kf", "ekf"}
    assert missing_of_parts(parts[1]) == []


def test_conflicts_are_named(parts, tmp_path):
    whole, found = parts
    altered = tmp_path / "altered.h5"
    altered.write_bytes(found[1].read_bytes())
    with h5py.File(altered, "r+") as file:
        del file.attrs[seal.ATTRIBUTE]  # else the change itself is noticed first
        assert file["case_001/ekf/run"][0] == 1
        file["case_001/ekf/rms"][0, 0, 0] += 1e-9
    with pytest.raises(RefusedError, match=r"kind=mixture, filter ekf: two shards disagree about run 1 \(rms\)"):
        merge_results(tmp_path / "merged.h5", [whole, altered])
    assert not (tmp_path / "merged.h5").exists()


def test_runs_that_failed_differently_are_a_conflict(parts, tmp_path):
    altered = tmp_path / "altered.h5"
    altered.write_bytes(parts[0].read_bytes())
    with h5py.File(altered, "r+") as file:
        del file.attrs[seal.ATTRIBUTE]  # else the change itself is noticed first
        group = file["case_000/failures"]
        kinds = {name: group[name].dtype for name in ("run", "epoch", "filter", "reason", "failure")}
        for name, value in (("run", 2), ("epoch", 5), ("filter", "kf"), ("reason", "x"), ("failure", 0)):
            attributes = dict(group[name].attrs)
            del group[name]
            group.create_dataset(name, data=[value], dtype=kinds[name])
            del attributes
    with pytest.raises(RefusedError, match="disagrees with another shard about why run 2 failed"):
        merge_results(tmp_path / "merged.h5", [parts[0], altered])


@pytest.mark.parametrize(
    "changes, words",
    [
        (("seed=6",), "different campaigns: seed differ"),
        (("sensors.radar.range_sigma_m=3",), "different campaigns: sensors.radar.range_sigma_m differ"),
        (("runs=7",), "differ in their runs"),
        (("filters.wide={kind: kf, r_scale: 4}",), "differ in their cases"),
    ],
)
def test_other_campaigns_are_refused(parts, tmp_path, make_campaign, changes, words):
    made = make_campaign(*changes, "bound=false", "block_runs=1")
    other = run_campaign(made, tmp_path / "other.h5", backend="sequential", part=(1, 12))
    with pytest.raises(RefusedError, match=words):
        merge_results(tmp_path / "merged.h5", [parts[0], other])


def test_what_is_no_part_is_refused(parts, tmp_path, make_campaign):
    single = run_single(make_campaign(), 0, 1, tmp_path / "one.h5", backend="sequential")
    for path, kind, words in (
        (single, RefusedError, "single run"),
        (tmp_path / "none.h5", ResultsError, "no such file"),
        (tmp_path, ResultsError, "no folder of shards"),
    ):
        with pytest.raises(kind, match=words):
            merge_results(tmp_path / "merged.h5", [parts[0], path])
    with pytest.raises(RefusedError, match="exists"):
        merge_results(parts[0], parts[1])


def test_what_a_killed_merge_left_is_removed_by_the_next(parts, tmp_path):
    whole, found = parts
    (tmp_path / ".merged.h5.4242.tmp").write_bytes(b"half")
    assert_same_bits(whole, merge_results(tmp_path / "merged.h5", found))
    assert [path.name for path in tmp_path.iterdir()] == ["merged.h5"]
