"""Covariances stored whole: what is written is read, in any split, and files without them say so."""

import csv
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.results import layout, open_results
from relnav_sim.results.block import BlockResult
from relnav_sim.results.comparable import same_numbers
from relnav_sim.results.covariance_root import covariance_roots, covariances
from relnav_sim.results.export import export_series
from relnav_sim.results.merge import merge_pieces
from relnav_sim.results.pieces import result_pieces, shard_piece

EARLIER = Path(__file__).parents[1] / "reference" / "result_0_1_1.h5"
NAME = "ekf"
TIMES = 7


def _covariances(case: int, runs) -> np.ndarray:
    rows = [np.random.default_rng([case, run]).standard_normal((TIMES, 6, 9)) for run in runs]
    return np.array([A @ A.swapaxes(1, 2) for A in rows])


def _with_covariances(block: BlockResult) -> BlockResult:
    root = covariance_roots(_covariances(block.case_index, block.runs))
    sigma = np.sqrt(np.diagonal(_covariances(block.case_index, block.runs), axis1=2, axis2=3))
    own = replace(block.filters[NAME], covariance_root=root, sigma=sigma)
    return replace(block, filters={**block.filters, NAME: own})


@pytest.fixture
def whole(tmp_path, make_block, make_header, write, facts) -> Path:
    shards = write(tmp_path / "shards", [_with_covariances(make_block(0, runs)) for runs in ([0, 1, 2], [3, 4])])
    merge_pieces(map(shard_piece, shards), make_header(cases=1), facts, tmp_path / "whole.h5")
    return tmp_path / "whole.h5"


def test_it_is_read_as_it_was_written(whole: Path) -> None:
    expected = _covariances(0, range(5))
    with open_results(whole) as results:
        found = results.covariance(0, NAME)
        assert found.dtype == np.float64 and found.shape == (5, TIMES, 6, 6) and results.holds_covariances
        scale = np.sqrt(np.einsum("rkii,rkjj->rkij", expected, expected))
        assert np.abs((found - expected) / scale).max() < 6e-7  # seven terms of single precision, 6e-8 each
        np.testing.assert_array_equal(results.series(0, NAME, 3).covariance, found[3])


def test_other_blocks_and_results_in_place_of_shards_keep_the_bits(
    whole: Path, tmp_path, make_block, make_header, write, facts
) -> None:
    shards = write(tmp_path / "single", [_with_covariances(make_block(0, [run])) for run in range(5)])
    merge_pieces(map(shard_piece, shards), make_header(cases=1), facts, tmp_path / "single.h5")
    merge_pieces(result_pieces(whole), make_header(cases=1), facts, tmp_path / "again.h5")
    with open_results(whole) as one:
        for other in ("single.h5", "again.h5"):
            with open_results(tmp_path / other) as two:
                assert same_numbers(one, two)
                assert one.covariance(0, NAME).tobytes() == two.covariance(0, NAME).tobytes()


def test_other_covariances_are_other_numbers(whole: Path, tmp_path, make_block, make_header, write, facts) -> None:
    shards = write(tmp_path / "without", [_with_covariances(make_block(0, [r])) for r in range(4)])
    last = _with_covariances(make_block(0, [4]))
    changed = replace(last.filters[NAME], covariance_root=2 * last.filters[NAME].covariance_root)
    shards += write(tmp_path / "last", [replace(last, filters={**last.filters, NAME: changed})])
    merge_pieces(map(shard_piece, shards), make_header(cases=1), facts, tmp_path / "other.h5")
    with open_results(whole) as one, open_results(tmp_path / "other.h5") as two:
        assert not same_numbers(one, two)


def test_runs_whose_covariances_are_missing_are_nan(tmp_path, make_block, make_header, write, facts) -> None:
    """A block that died has none of the numbers that a filter's other blocks have."""
    blocks = [_with_covariances(make_block(0, [0, 1, 2])), make_block(0, [3, 4])]
    merge_pieces(map(shard_piece, write(tmp_path / "s", blocks)), make_header(cases=1), facts, tmp_path / "r.h5")
    with open_results(tmp_path / "r.h5") as results:
        found = results.covariance(0, NAME)
    assert np.isfinite(found[:3]).all() and np.isnan(found[3:]).all()


def test_csv_has_the_correlations(whole: Path, tmp_path) -> None:
    with open_results(whole) as results:
        export_series(results, tmp_path / "whole.csv")
        P = results.covariance(0, NAME)[2, 4]
    with open(tmp_path / "whole.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    row = next(r for r in rows if (r["filter"], r["run"], r["time_s"]) == (NAME, "2", "40.0"))
    corr = P / np.sqrt(np.outer(np.diag(P), np.diag(P)))
    for i, one in enumerate(layout.COMPONENTS):
        for j in range(i + 1, 6):
            assert float(row[f"correlation_{one}_{layout.COMPONENTS[j]}"]) == pytest.approx(corr[i, j], abs=1e-12)
    with open_results(EARLIER) as results:
        export_series(results, tmp_path / "without.csv")
    assert "correlation" not in (tmp_path / "without.csv").read_text(encoding="utf-8").partition("\n")[0]


def test_xarray_opens_it_unaided(whole: Path) -> None:
    import xarray

    with xarray.open_dataset(whole, group=f"case_000/{NAME}") as data:
        root = data["covariance_root"].sel(run=1, time=20.0, factor="vx,y")
        assert root.attrs["units"] == "m; m/s"
        expected = np.linalg.cholesky(_covariances(0, [1])[0, 2])[3, 1]
        assert float(root) == pytest.approx(expected, rel=1e-6)


def test_filters_and_files_without_say_so(result: Path) -> None:
    with open_results(result) as results:
        assert results.covariance(0, NAME) is None and results.series(0, NAME, 3).covariance is None
        assert results.covariance(0, "alpha_0.5") is not None and results.holds_covariances
    with open_results(EARLIER) as results:
        assert results.covariance(0, NAME) is None and not results.holds_covariances


def test_a_file_that_names_the_entries_wrongly_is_refused(whole: Path, tmp_path) -> None:
    from relnav_sim.results import seal
    from relnav_sim.results.block import ResultsError

    path = tmp_path / "damaged.h5"
    path.write_bytes(whole.read_bytes())
    with h5py.File(path, "r+") as file:
        del file.attrs[seal.ATTRIBUTE]
        file[f"case_000/{NAME}/factor"][0] = "y,y"
    with open_results(path) as results, pytest.raises(ResultsError, match="factor is not x,x"):
        results.covariance(0, NAME)


def test_roots_against_numpy() -> None:
    P = _covariances(3, range(4))
    P[1, 2] = -P[1, 2]
    roots = covariance_roots(P)
    lower = np.tril_indices(6)
    for run in range(4):
        for k in range(TIMES):
            if (run, k) == (1, 2):
                assert np.isnan(roots[run, k]).all()
            else:
                np.testing.assert_allclose(roots[run, k], np.linalg.cholesky(P[run, k])[lower], rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(covariances(roots[0]), P[0], rtol=1e-12, atol=1e-13)
