"""Bounds in files of their own and in the results file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.results.block import RefusedError, ResultsError
from relnav_sim.results.bound import bound_name, read_bound, result_bounds, write_bound
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import shard_piece
from relnav_sim.results.provenance import Provenance
from relnav_sim.results.read import open_results


def test_bounds_come_back_from_their_file_as_written(tmp_path: Path, make_bound) -> None:
    for given in (make_bound(0), replace(make_bound(1), perfect=None, filters={}, reason="too long")):
        path = tmp_path / bound_name(given.seed, given.case_id, given.filter_ids)
        write_bound(path, given)
        read = read_bound(path)
        assert (read.seed, read.case_id, read.filter_ids) == (given.seed, given.case_id, given.filter_ids)
        assert read.reason == given.reason
        assert (read.perfect is None) == (given.perfect is None)
        assert read.filters.keys() == given.filters.keys()
        assert all(np.array_equal(read.filters[name], given.filters[name]) for name in given.filters)


def test_a_damaged_bound_is_noticed(tmp_path: Path, make_bound) -> None:
    path = tmp_path / "one.bound"
    write_bound(path, make_bound(0))
    with h5py.File(path, "a") as file:
        file["perfect"][3, 2] += 1e-9
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
        assert results.bound(1) is None
        assert results.bound(1, "ekf") is None
        with pytest.raises(ResultsError, match="no filter"):
            results.bound(0, "pf")
    (found,) = result_bounds(result)
    np.testing.assert_array_equal(found.perfect, given.perfect)
    assert found.filters.keys() == given.filters.keys()


def test_xarray_sees_the_bound(result: Path, make_bound) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(result, group="case_000") as case:
        assert case["bound"].sel(quantity="r").shape == case["time"].shape
    with open_results(result) as results:
        tree = results.to_xarray()
    np.testing.assert_array_equal(tree["case_000/ekf"]["bound"], make_bound(0).filters["ekf"])
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
        assert results.bound(0, "ekf") is None
        np.testing.assert_array_equal(results.bound(0, "alpha_0.5"), mine.filters["alpha_0.5"])
