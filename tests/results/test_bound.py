"""Bounds in files of their own and in the results file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.results import layout
from relnav_sim.results.block import RefusedError, ResultsError
from relnav_sim.results.bound import BoundResult, bound_name, read_bound, result_bounds, write_bound
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import shard_piece
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.read import open_results
from relnav_sim.results.shards import checksum


def test_bounds_come_back_from_their_file_as_written(tmp_path: Path, make_bound) -> None:
    nothing = replace(make_bound(1), perfect=None, filters={}, perfect_of={}, observability={}, reason="too long")
    for given in (make_bound(0), nothing):
        path = tmp_path / bound_name(given.seed, given.case_id, given.filter_ids)
        write_bound(path, given)
        read = read_bound(path)
        assert (read.seed, read.case_id, read.filter_ids) == (given.seed, given.case_id, given.filter_ids)
        assert read.reason == given.reason
        assert (read.perfect is None) == (given.perfect is None)
        assert read.filters.keys() == given.filters.keys()
        assert all(np.array_equal(read.filters[name], given.filters[name]) for name in given.filters)
        assert_same_by_sensors(read, given)


def assert_same_by_sensors(read: BoundResult, given: BoundResult) -> None:
    """Both say the same of the filters' own sensors."""
    assert read.perfect_of.keys() == given.perfect_of.keys()
    assert all(np.array_equal(read.perfect_of[name], given.perfect_of[name]) for name in given.perfect_of)
    assert read.observability.keys() == given.observability.keys()
    assert all(read.observability[name].agrees(given.observability[name]) for name in given.observability)


def test_a_bound_of_an_earlier_version_is_read(tmp_path: Path, make_bound) -> None:
    """It knows one set of sensors and no observability."""
    given = replace(make_bound(0), perfect_of={}, observability={})
    arrays = {"perfect": given.perfect, **{f"filters/{name}": array for name, array in given.filters.items()}}
    header = {
        "seed": given.seed, "case_id": given.case_id, "filters": dict(given.filter_ids), "stored": sorted(arrays),
        "reason": "",
    }  # fmt: skip
    with h5py.File(tmp_path / "old.bound", "w", libver=("v108", "v108")) as file:
        file.attrs["format"], file.attrs["format_version"] = layout.BOUND_FORMAT, 1
        file.attrs["header"], file.attrs["checksum"] = json.dumps(header), checksum(header, arrays)
        for name, array in arrays.items():
            file.create_dataset(name, data=array)
    read = read_bound(tmp_path / "old.bound")
    np.testing.assert_array_equal(read.perfect, given.perfect)
    assert_same_by_sensors(read, given)


def test_a_damaged_bound_is_noticed(tmp_path: Path, make_bound) -> None:
    path = tmp_path / "one.bound"
    write_bound(path, make_bound(0))
    with h5py.File(path, "a") as file:
        file["data"][40] ^= 1
    with pytest.raises(ResultsError, match="checksum"):
        read_bound(path)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(ResultsError):
        read_bound(path)


def test_a_result_gives_its_bounds_and_none_where_it_has_none(result: Path, make_bound) -> None:
    given = make_bound(0)
    with open_results(result) as results:
        np.testing.assert_array_equal(results.bound(0), given.perfect)
        np.testing.assert_array_equal(results.bound(0, "ekf"), given.filters["ekf"])
        np.testing.assert_array_equal(results.perfect_bound(0, "ekf"), given.perfect)
        np.testing.assert_array_equal(results.perfect_bound(0, "alpha_0.5"), given.perfect_of["alpha_0.5"])
        assert results.observability(0, "ekf").agrees(given.observability["ekf"])
        assert results.observability(0, "alpha_0.5").agrees(given.observability["alpha_0.5"])
        assert results.bound(1) is None
        assert results.bound(1, "ekf") is None and results.perfect_bound(1, "ekf") is None
        assert results.observability(1, "ekf") is None
        with pytest.raises(ResultsError, match="no filter"):
            results.bound(0, "pf")
    (found,) = result_bounds(result)
    np.testing.assert_array_equal(found.perfect, given.perfect)
    assert found.filters.keys() == given.filters.keys()
    assert_same_by_sensors(found, given)


def test_xarray_sees_the_bound(result: Path, make_bound) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(result, group="case_000") as case:
        assert case["bound"].sel(quantity="r").shape == case["time"].shape
    with open_results(result) as results:
        tree = results.to_xarray()
    np.testing.assert_array_equal(tree["case_000/ekf"]["bound"], make_bound(0).filters["ekf"])
    alpha = tree["case_000/alpha_0.5"]
    np.testing.assert_array_equal(alpha["perfect_bound"], make_bound(0).perfect_of["alpha_0.5"])
    seen = make_bound(0).observability["alpha_0.5"]
    assert float(alpha["sigma_ratio"].sel(state="range_bias")) == seen.sigma_ratio[6]
    np.testing.assert_array_equal(alpha["observability"], seen.ratio)
    assert "bound" not in tree["case_001"]


def test_bounds_that_disagree_are_refused(
    tmp_path: Path, make_bound, make_block, make_header, write, facts: Provenance
):
    pieces = [shard_piece(path) for path in write(tmp_path / "shards", [make_block(0, [0, 1])])]
    one = make_bound(0)
    other = replace(one, perfect=one.perfect + 1)
    with pytest.raises(RefusedError, match="disagree about the bound"):
        merge_pieces(pieces, make_header(2, 1), facts, tmp_path / "out.h5", bounds=[one, other])
    assert not (tmp_path / "out.h5").exists()
    short = replace(one, perfect=one.perfect[:3])
    with pytest.raises(RefusedError, match="epochs"):
        merge_pieces(pieces, make_header(2, 1), facts, tmp_path / "out.h5", bounds=[short])


def test_bounds_of_other_filters_seeds_and_cases_are_passed_over(
    tmp_path: Path, make_bound, make_block, make_header, write, facts: Provenance
) -> None:
    pieces = [shard_piece(path) for path in write(tmp_path / "shards", [make_block(0, [0, 1])])]
    mine = make_bound(0)
    changed = replace(mine, filter_ids={**mine.filter_ids, "ekf": "other settings"})
    foreign = [replace(make_bound(5)), replace(make_bound(0), seed=3, perfect=mine.perfect + 1)]
    merge_pieces(pieces, make_header(2, 1), facts, tmp_path / "out.h5", bounds=[changed, *foreign])
    with open_results(tmp_path / "out.h5") as results:
        np.testing.assert_array_equal(results.bound(0), mine.perfect)
        assert results.bound(0, "ekf") is None and results.observability(0, "ekf") is None
        np.testing.assert_array_equal(results.bound(0, "alpha_0.5"), mine.filters["alpha_0.5"])
