"""Many cases share datasets: the same numbers as in groups of their own, at a cost that does not grow with them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.results import hdf5, stacks
from relnav_sim.results.block import ResultsError
from relnav_sim.results.bound import result_bounds
from relnav_sim.results.comparable import same_numbers
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import result_pieces, shard_piece
from relnav_sim.results.read import Results, open_results

CASES = 5


@pytest.fixture(scope="module")
def shards(tmp_path_factory, make_block, write):
    """Shards of cases of which one lacks runs, one a filter, and one all."""
    blocks = [make_block(case, runs) for case in range(CASES - 2) for runs in ([0, 1, 2], [3, 4])]
    blocks += [make_block(CASES - 2, [1, 3]), make_block(CASES - 2, [0], ["ekf"])]
    return write(tmp_path_factory.mktemp("cases") / "shards", blocks)


@pytest.fixture(scope="module")
def both(shards, make_header, make_bound, facts):
    """The same shards as a file with a group for each case, and as one with stacks."""
    bounds = [make_bound(case) for case in (0, 2, CASES - 2)]
    paths = []
    for name, most in (("apart", CASES), ("stacked", 1)):
        pieces = [shard_piece(path) for path in shards]
        path = shards[0].with_name(f"{name}.h5")
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(stacks, "STACKED_CASES", most)
            merge_pieces(pieces, make_header(cases=CASES), facts, path, complete=False, bounds=bounds)
        paths.append(path)
    return paths


def test_a_stack_holds_the_numbers_of_groups_apart(both) -> None:
    apart, stacked = both
    with h5py.File(stacked) as file:
        assert "case_000" not in file and "stack_000" in file and file.attrs["format_version"] == 2
        assert file["stack_000/ekf/case"][...].tolist() == sorted(file["stack_000/ekf/case"][...].tolist())
    with open_results(apart) as one, open_results(stacked) as other:
        assert one.headers == other.headers and one.missing() == other.missing() and one.runs == other.runs
        assert one.failures() == other.failures() != ()
        assert other.time_s(0).tolist() == one.time_s(0).tolist()
        with pytest.raises(ResultsError, match="no results yet"):
            other.truth(CASES - 1)
        summary = other.summary()
        for name, column in one.summary().items():
            np.testing.assert_array_equal(column, summary[name])
        for case in range(CASES - 1):
            np.testing.assert_array_equal(one.truth(case), other.truth(case))
            np.testing.assert_array_equal(one.truth_runs(case), other.truth_runs(case))
            for filter in one.filters:
                if not len(one.case_runs(case, filter)):
                    continue
                for read in ("error", "sigma", "nis", "nees", "distance", "dof", "nis_sum"):
                    np.testing.assert_array_equal(getattr(one, read)(case, filter), getattr(other, read)(case, filter))
                np.testing.assert_array_equal(one.perfect_bound(case, filter), other.perfect_bound(case, filter))
                seen, again = one.observability(case, filter), other.observability(case, filter)
                assert (seen is None) == (again is None) and (seen is None or (seen.agrees(again) and again.course))
                _compare_own(one, other, case, filter)
                run = int(one.case_runs(case, filter)[-1])
                for field in ("error", "truth", "nees"):
                    np.testing.assert_array_equal(
                        getattr(one.series(case, filter, run), field), getattr(other.series(case, filter, run), field)
                    )
    assert len(result_bounds(stacked)) == len(result_bounds(apart)) == 3


def _compare_own(one: Results, other: Results, case: int, filter: str) -> None:
    """Compare what only some filters hold: here the alpha filter holds all of it, the other none."""
    assert one.holds_covariances and other.holds_covariances and one.sensors == other.sensors == ("radar", "camera")
    for read in ("augmented", "by_sensor", "editing", "by_channel"):
        first, second = getattr(one, read)(case, filter), getattr(other, read)(case, filter)
        assert (first is None) == (second is None) == (filter == "ekf")
        for field in dataclasses.fields(first) if first is not None else ():
            np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))
    for rows in (slice(None), slice(0, 2), slice(-1, None)):
        first, second = (file.covariance(case, filter, rows, slice(1, 4)) for file in (one, other))
        assert (first is None) == (second is None) == (filter == "ekf")
        if first is not None:
            np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("most", [1, CASES])
@pytest.mark.slow
def test_either_file_merges_again_to_the_same(tmp_path, both, make_header, facts, monkeypatch, most) -> None:
    monkeypatch.setattr(stacks, "STACKED_CASES", most)
    for path in both:
        again = tmp_path / f"again_{path.name}"
        bounds = result_bounds(path)
        merge_pieces(result_pieces(path), make_header(cases=CASES), facts, again, complete=False, bounds=bounds)
        with open_results(again) as one:
            assert one.missing()
            for whole in both:
                with open_results(whole) as other:
                    held = [case for case in range(CASES - 1) if len(other.case_runs(case, "ekf"))]
                    for case in held:
                        np.testing.assert_array_equal(one.error(case, "ekf"), other.error(case, "ekf"))
                        if len(other.case_runs(case, "alpha_0.5")):
                            _compare_own(one, other, case, "alpha_0.5")
                        assert (one.bound(case) is None) == (other.bound(case) is None)


def test_no_more_datasets_are_made_for_more_cases(tmp_path, make_block, make_header, write, facts, monkeypatch) -> None:
    monkeypatch.setattr(stacks, "STACKED_CASES", 1)
    made: list[str] = []
    create = hdf5.create
    monkeypatch.setattr(hdf5, "create", lambda group, name, *rest: made.append(name) or create(group, name, *rest))
    counts = []
    for cases in (2, 6):
        pieces = [shard_piece(p) for p in write(tmp_path / str(cases), [make_block(c, [0, 1]) for c in range(cases)])]
        made.clear()
        merge_pieces(pieces, make_header(runs=2, cases=cases), facts, tmp_path / f"{cases}.h5")
        counts.append(len(made))
    assert counts[0] == counts[1] > 50


def test_xarray_opens_a_stack_unaided(both) -> None:
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(both[1], group="stack_000/ekf", engine="h5netcdf") as data:
        assert data["rms"].dims == ("run", "span", "quantity") and data["case"].dims == ("run",)
        of_one = data["rms"].values[data["case"].values == 2]
    with open_results(both[0]) as results:
        np.testing.assert_array_equal(of_one, results.statistic(2, "ekf", "rms"))
    with open_results(both[1]) as results:
        tree = results.to_xarray()
        found = tree["stack_000/ekf"].ds
        np.testing.assert_array_equal(found["rms"].values[found["case"] == 2], of_one)
        assert tree["cases"].ds["label"].values.tolist() == list(results.cases)


def test_a_stack_whose_cases_are_out_of_order_is_damaged(both: list[Path], tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.h5"
    damaged.write_bytes(both[1].read_bytes())
    with h5py.File(damaged, "r+") as file:
        file["stack_000/ekf/case"][0] = CASES
        del file.attrs["file_checksum"]
    with open_results(damaged) as results, pytest.raises(ResultsError, match="does not ascend"):
        results.case_runs(0, "ekf")


def test_same_numbers_sees_no_difference_of_layout(
    tmp_path, make_block, make_header, write, facts, monkeypatch
) -> None:
    pieces = [shard_piece(p) for p in write(tmp_path / "s", [make_block(c, [0, 1]) for c in range(3)])]
    paths = []
    for most in (1, 3):
        monkeypatch.setattr(stacks, "STACKED_CASES", most)
        paths.append(tmp_path / f"{most}.h5")
        merge_pieces(pieces, make_header(runs=2, cases=3), facts, paths[-1])
    with open_results(paths[0]) as one, open_results(paths[1]) as other:
        assert same_numbers(one, other)
