"""A shard gives back what was written, or says that it is damaged."""

import dataclasses
import json
import math
import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from relnav_sim.results import layout
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import BlockResult, ResultsError
from relnav_sim.results.bundle import read_bundle, write_bundle
from relnav_sim.results.shards import checksum, read_shard, read_shard_info, shard_name, write_shard


def test_a_shard_gives_back_its_block(tmp_path, make_block, write) -> None:
    one = make_block(0, [1, 2, 5])
    (path,) = write(tmp_path, [one])
    info, back = read_shard(path)
    assert info == read_shard_info(path)
    assert (info.seed, info.case_id, info.filters, info.runs) == (2**80 + 1, "id0", tuple(one.filters), (1, 2, 5))
    assert info.filter_ids == {name: f"settings of {name}" for name in one.filters}
    assert back.failures == one.failures and len(one.failures) == 1
    np.testing.assert_array_equal(back.relative, one.relative)
    for name, result in one.filters.items():
        for key, array in result.arrays().items():
            again = back.filters[name].arrays()[key]
            assert again.dtype == array.dtype and again.tobytes() == array.tobytes()
    assert os.listdir(tmp_path) == [path.name]


def test_names_tell_case_filters_and_runs_apart() -> None:
    names = {
        shard_name(1, "a" * 40, {"ekf": "0"}, range(4)),
        shard_name(2, "a" * 40, {"ekf": "0"}, range(4)),
        shard_name(1, "b" * 40, {"ekf": "0"}, range(4)),
        shard_name(1, "a" * 40, {"ukf": "0"}, range(4)),
        shard_name(1, "a" * 40, {"ekf": "1"}, range(4)),
        shard_name(1, "a" * 40, {"ekf": "0"}, range(5)),
        shard_name(1, "a" * 40, {"ekf": "0"}, (0, 1, 3)),
    }
    assert len(names) == 7
    two = {"x": "0", "y": "1"}
    assert shard_name(1, "a" * 40, two, (0,)) == shard_name(1, "a" * 40, dict(reversed(two.items())), (0,))


def test_a_torn_shard_is_detected_wherever_it_ends(tmp_path, make_block, write) -> None:
    (path,) = write(tmp_path, [make_block(0, [0, 1])])
    whole = path.read_bytes()
    for share in np.linspace(0, 0.999, 25):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(ResultsError, match=path.name):
            read_shard(path)


def test_a_changed_number_is_detected_anywhere(tmp_path, make_block, write) -> None:
    (path,) = write(tmp_path, [make_block(0, [0, 1])])
    with h5py.File(path) as file:
        table = json.loads(file.attrs["table"])
    # One of the two filters has augmented states, whose unit is in the header, and all else that a filter may have.
    own = (*layout.AUGMENTED, *layout.BY_SENSOR, *layout.EDITING, *layout.BY_CHANNEL, layout.COVARIANCE)
    assert len(table) == 3 + 2 * len(layout.FILTER) + 2 + len(own)
    lengths = [math.prod(shape) * np.dtype(dtype).itemsize for _, dtype, shape in table]
    # Each array's last byte, and the very first.
    for place in [0, *(np.cumsum(lengths) - 1)]:
        with h5py.File(path, "r+") as file:
            file["data"][place] ^= 1
        with pytest.raises(ResultsError, match="checksum"):
            read_shard(path)
        with h5py.File(path, "r+") as file:
            file["data"][place] ^= 1
    for name in ("header", "table"):
        with h5py.File(path, "r+") as file:
            kept = file.attrs[name]
            file.attrs[name] = kept.replace("0", "1", 1)
        with pytest.raises(ResultsError):
            read_shard(path)
        with h5py.File(path, "r+") as file:
            file.attrs[name] = kept
    read_shard(path)


def test_arrays_that_no_layout_has_are_refused_whatever_their_checksum(tmp_path, make_block, write) -> None:
    (path,) = write(tmp_path, [make_block(0, [0, 1])])
    bundle = read_bundle(path, layout.SHARD_FORMAT, lambda file, header: {})
    arrays, name = bundle.load(), "filters/ekf/rms"
    epochs = np.array(arrays["time"])
    epochs[2] = epochs[1]
    for changed in (
        {name: arrays[name][:, :, :7]},
        {name: arrays[name].astype(np.float32)},
        {"filters/ekf/failed": arrays["filters/ekf/failed"] + 5},
        {"time": epochs},
        {"run": arrays["run"] + 1},
    ):
        write_bundle(path, layout.SHARD_FORMAT, bundle.header, {**arrays, **changed})
        with pytest.raises(ResultsError, match="do not fit"):
            read_shard(path)
    write_bundle(path, layout.SHARD_FORMAT, bundle.header, {k: v for k, v in arrays.items() if k != name})
    with pytest.raises(ResultsError, match="do not fit"):
        read_shard(path)


def former_shard(path: Path, one: BlockResult) -> None:
    """Write a shard as relnav 0.1.1 did: each array a dataset, and no runs in the header."""
    arrays = {"run": np.array(one.runs), "time": one.time_s, "truth": one.relative}
    for name, result in one.filters.items():
        arrays |= {f"filters/{name}/{key}": array for key, array in result.arrays(result.columns).items()}
    header = {
        "seed": 2**80 + 1,
        "case_index": one.case_index,
        "case_id": one.case_id,
        "filters": {name: f"settings of {name}" for name in one.filters},
        "shared_truth": one.shared_truth,
        "columns": {name: dataclasses.asdict(result.columns) for name, result in one.filters.items()},
        "failures": [[f.run, f.filter, f.epoch, f.reason] for f in one.failures],
    }
    with h5py.File(path, "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "relnav shard", 1
        file.attrs["header"] = json.dumps(header)
        file.attrs["checksum"] = checksum(header, arrays)
        for name, array in arrays.items():
            file[name] = array


def test_a_shard_of_the_version_before_is_read_and_verified(tmp_path, make_block, write) -> None:
    one = make_block(0, [0, 1, 2])
    (new,), old = write(tmp_path, [one]), tmp_path / "old.h5"
    former_shard(old, one)
    (info, block), (same, again) = read_shard(old), read_shard(new)
    assert dataclasses.replace(info, path=new) == same
    np.testing.assert_array_equal(block.relative, again.relative)
    for name, result in again.filters.items():
        for key, array in result.arrays(result.columns).items():
            assert block.filters[name].arrays(result.columns)[key].tobytes() == array.tobytes()
    with h5py.File(old, "r+") as file:
        file["filters/ekf/rms"][0, 0, 0] += 1e-9
    with pytest.raises(ResultsError, match="checksum"):
        read_shard(old)


@pytest.mark.parametrize("name", ["absent.h5", "empty.h5", "words.h5", "foreign.h5", "folder.h5"])
def test_files_that_are_no_shards_are_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name == "empty.h5":
        path.write_bytes(b"")
    elif name == "words.h5":
        path.write_text("time,x\n1,2\n")
    elif name == "foreign.h5":
        h5py.File(path, "w").close()
    elif name == "folder.h5":
        path.mkdir()
    with pytest.raises(ResultsError, match=name):
        read_shard(path)


def test_a_result_is_no_shard(result: Path) -> None:
    with pytest.raises(ResultsError, match="this is a relnav result, not a relnav shard"):
        read_shard(result)


def test_a_block_that_does_not_fit_is_refused_and_leaves_no_file(tmp_path, make_block) -> None:
    one = make_block(0, [0, 1])
    short = dataclasses.replace(one.filters["ekf"], nees=one.filters["ekf"].nees[:, 1:])
    for bad in (
        dataclasses.replace(one, filters={"ekf": short}),
        dataclasses.replace(one, relative=one.relative[:1]),
        dataclasses.replace(one, runs=(0, 1, 2)),
    ):
        with pytest.raises(ValueError, match="shape"):
            write_shard(tmp_path / "s.h5", bad, 1, dict.fromkeys(bad.filters, "0"))
    assert not list(tmp_path.iterdir())


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "out.txt"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), written_whole(path) as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old" and len(list(tmp_path.iterdir())) == 1
    with written_whole(path) as temporary:
        temporary.write_text("new")
    assert path.read_text() == "new" and len(list(tmp_path.iterdir())) == 1
