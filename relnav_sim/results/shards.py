"""One file per block of runs, written by the worker that simulated it and verified before anyone believes it.

A shard is written under a temporary name, synced and renamed, so it is whole or absent. It carries the seed, the
case, the filters with their ids, the runs and a checksum over all its numbers: everything its numbers depend on, and
nothing else, so that a campaign that grows keeps the shards it has.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from relnav_sim.printable import printable
from relnav_sim.results import layout, store
from relnav_sim.results.block import AnyArray, BlockResult, Failure, FilterResult, ResultsError
from relnav_sim.results.bundle import Bundle, open_bundle, read_bundle, write_bundle
from relnav_sim.results.sound import odd_coordinate, odd_values

SUFFIX = ".h5"
_RUN, _TIME = layout.DIMENSIONS["run"], layout.DIMENSIONS["time"]


@dataclass(frozen=True)
class ShardInfo:
    """What a shard says about itself.

    Attributes:
        path: The file.
        seed: Seed of the campaign.
        case_index: Number of the case in the campaign that wrote it; ``case_id`` is what counts.
        case_id: Hash of the case's content without its filters.
        filters: Names of the filters.
        filter_ids: What each filter is: a hash of its settings, by its name.
        runs: Numbers of the runs.
        shared_truth: As in `BlockResult`.
        columns: What each filter holds beyond what all do, in the order of the columns.
        epochs: How many epochs are stored, and a digest of them.
        retry: As in `BlockResult`.
    """

    path: Path
    seed: int
    case_index: int
    case_id: str
    filters: tuple[str, ...]
    filter_ids: Mapping[str, str]
    runs: tuple[int, ...]
    shared_truth: bool
    columns: Mapping[str, layout.Columns]
    epochs: tuple[int, str]
    retry: bool = False


def shard_name(seed: int, case_id: str, filter_ids: Mapping[str, str], runs: Sequence[int]) -> str:
    """Return the file name of the shard of one seed, case, set of filters and range of runs."""
    key = hashlib.sha256(json.dumps([seed, case_id, sorted(filter_ids.items()), list(runs)]).encode()).hexdigest()
    return f"{case_id[:12]}_{min(runs):06d}-{max(runs):06d}_{key[:12]}{SUFFIX}"


def write_shard(path: Path, block: BlockResult, seed: int, filter_ids: Mapping[str, str]) -> None:
    """Write a block's results.

    Args:
        path: Where the shard goes; its directory exists.
        block: The results; every filter's arrays must fit the layout.
        seed: Seed of the campaign.
        filter_ids: A hash of each filter's settings, by its name.

    Raises:
        OSError: The file can't be written.
        ValueError: An array does not fit the layout.
    """
    write_bundle(path, layout.SHARD_FORMAT, _header(block, seed, filter_ids), _arrays(block))


def unwritten_shard(path: Path, block: BlockResult, seed: int, filter_ids: Mapping[str, str]) -> Bundle:
    """Return what `open_shard` would return of a block's shard, without writing one.

    Args:
        path: What is named where something is wrong with it.
        block: The results.
        seed: Seed of the campaign.
        filter_ids: A hash of each filter's settings, by its name.
    """
    return Bundle(path, path.name, _header(block, seed, filter_ids), "", lambda: _arrays(block))


def _arrays(block: BlockResult) -> dict[str, AnyArray]:
    """Return the arrays of a block's shard.

    Raises:
        ValueError: One does not fit the layout.
    """
    runs = np.asarray(block.runs, dtype=_RUN.dtype)
    arrays: dict[str, AnyArray] = {
        "run": runs,
        "time": np.ascontiguousarray(block.time_s, dtype=_TIME.dtype),
        "truth": np.ascontiguousarray(block.relative, dtype=layout.TRUTH.dtype),
    }
    trajectories = 1 if block.shared_truth else len(runs)
    expected = (trajectories, len(arrays["time"]), len(layout.COMPONENTS))
    if arrays["truth"].shape != expected:
        raise ValueError(f"relative has shape {arrays['truth'].shape}; it must be {expected}")
    for name, result in block.filters.items():
        for key, array in result.arrays(result.columns).items():
            arrays[f"filters/{name}/{key}"] = array
        if result.nis.shape != (len(runs), expected[1]):
            raise ValueError(f"{name}: nis has shape {result.nis.shape}; it must be {(len(runs), expected[1])}")
    return arrays


def _header(block: BlockResult, seed: int, filter_ids: Mapping[str, str]) -> dict[str, Any]:
    """Return what a block's shard says of itself."""
    return {
        "seed": seed,
        "runs": [int(run) for run in block.runs],
        "epochs": epochs_of(block.time_s),
        "case_index": block.case_index,
        "case_id": block.case_id,
        "filters": {name: filter_ids[name] for name in block.filters},
        "shared_truth": block.shared_truth,
        **({"retry": True} if block.retry else {}),
        "columns": {name: asdict(result.columns) for name, result in block.filters.items()},
        "failures": [[f.run, f.filter, f.epoch, f.reason] for f in block.failures],
    }


def open_shard(path: Path) -> Bundle:
    """Return a shard's file as a bundle: what it says about itself, its numbers when they are asked for.

    Raises:
        ResultsError: The file is missing, torn or no shard.
    """
    return open_bundle(path, layout.SHARD_FORMAT, _former_arrays)


def read_shard_info(path: Path) -> ShardInfo:
    """Return what a shard says about itself, without reading its numbers or trusting them.

    Raises:
        ResultsError: The file is missing, torn or no shard.
    """
    return shard_info(open_shard(path))


def read_shard(path: Path) -> tuple[ShardInfo, BlockResult]:
    """Return a shard's results after verifying its checksum.

    Raises:
        ResultsError: The file is missing, torn, no shard, or its numbers differ from those written.
    """
    bundle = read_bundle(path, layout.SHARD_FORMAT, _former_arrays)
    return shard_info(bundle), shard_block(bundle)


def shard_block(bundle: Bundle) -> BlockResult:
    """Return the results of a shard after verifying its checksum.

    Raises:
        ResultsError: They differ from those written, or are no shard's.
    """
    arrays, info = bundle.load(), shard_info(bundle)
    try:
        _check_fit(arrays, info)
        filters = {
            name: FilterResult.of_arrays(
                {spec.name: arrays[f"filters/{name}/{spec.name}"] for spec in info.columns[name].datasets},
                info.columns[name],
            )
            for name in info.filters
        }
        failures = tuple(
            Failure(int(run), str(name), int(k), str(why)) for run, name, k, why in bundle.header["failures"]
        )
        return BlockResult(
            info.case_index,
            info.case_id,
            info.runs,
            arrays["time"],
            arrays["truth"],
            filters,
            failures,
            info.shared_truth,
            info.retry,
        )
    except (IndexError, KeyError, OverflowError, TypeError, ValueError):
        raise ResultsError(f"{bundle.path}: the shard's numbers do not fit its header") from None


def _check_fit(arrays: Mapping[str, AnyArray], info: ShardInfo) -> None:
    """Refuse arrays that are not what the layout says, which a checksum does not tell.

    Raises:
        ValueError: One is of another type or shape, or has entries that can't be.
    """
    times, rows = len(arrays["time"]), len(info.runs)
    if epochs_of(arrays["time"]) != info.epochs or arrays["run"].tolist() != list(info.runs):
        raise ValueError("run")
    trajectories = 1 if info.shared_truth else rows
    expected: list[tuple[str, layout.Dataset, dict[str, int]]] = [
        ("truth", layout.TRUTH, layout.sizes(rows, times, trajectories))
    ]
    for name in info.filters:
        lengths = layout.sizes(rows, times) | info.columns[name].lengths
        expected += [(f"filters/{name}/{spec.name}", spec, lengths) for spec in info.columns[name].datasets]
    for place, spec, lengths in expected:
        array = arrays[place]
        if array.dtype.str != np.dtype(spec.dtype).str or array.shape != layout.shape(spec, lengths):
            raise ValueError(place)
        if odd_values(spec, array):
            raise ValueError(place)
    ascending = all(a < b for a, b in itertools.pairwise(info.runs))
    if not ascending or info.runs[0] < 0 or odd_coordinate(_TIME, arrays["time"]):
        raise ValueError("run")


def shard_info(bundle: Bundle) -> ShardInfo:
    """Return what a shard says about itself.

    Raises:
        ResultsError: It is damaged.
    """
    header = bundle.header
    try:
        return ShardInfo(
            bundle.path,
            int(header["seed"]),
            int(header["case_index"]),
            str(header["case_id"]),
            tuple(header["filters"]),
            {str(name): str(key) for name, key in header["filters"].items()},
            tuple(map(int, header["runs"])) if "runs" in header else tuple(_former(bundle.path, _RUN).tolist()),
            bool(header["shared_truth"]),
            {str(name): _columns(json.dumps(header["columns"][name])) for name in header["filters"]},
            _epochs(header["epochs"]) if "epochs" in header else epochs_of(_former(bundle.path, _TIME)),
            bool(header.get("retry", False)),
        )
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
        raise _damaged(bundle.path) from None


def _damaged(path: Path) -> ResultsError:
    return ResultsError(f"{path}: the shard's header is damaged")


def checksum(header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> str:
    """Return the digest that files of version 1 hold of their header and all their numbers."""
    digest = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def epochs_of(time_s: AnyArray) -> tuple[int, str]:
    """Return how many epochs there are and a digest of them, which is the same where they are, bit for bit."""
    return len(time_s), hashlib.sha256(np.ascontiguousarray(time_s, dtype=_TIME.dtype).data).hexdigest()[:16]


def _epochs(stored: Sequence[Any]) -> tuple[int, str]:
    count, digest = stored
    return int(count), str(digest)


def _former(path: Path, dimension: layout.Dimension) -> AnyArray:
    with store.open_checked(path, layout.SHARD_FORMAT) as file:
        return store.read(file, dimension)


def _former_arrays(file: h5py.File, header: Mapping[str, Any]) -> dict[str, AnyArray]:
    """Return the arrays of a shard of version 1, in which each is a dataset."""
    path = Path(file.filename)
    arrays = {"run": store.read(file, _RUN), "time": store.read(file, _TIME)}
    arrays["truth"] = store.read(file, layout.TRUTH)
    try:
        columns = {str(name): _columns(json.dumps(header["columns"][name])) for name in header["filters"]}
    except (AttributeError, KeyError, TypeError):
        raise _damaged(path) from None
    groups = store.subgroup(file, "filters") if columns else None
    for name, own in columns.items():
        group = store.subgroup(groups, name)
        for spec in own.datasets:
            arrays[f"filters/{name}/{spec.name}"] = store.read(group, spec)
    if store.text(file, "checksum") != checksum(header, arrays):
        raise ResultsError(f"{path}: checksum does not match; the shard is damaged")
    return arrays


@functools.lru_cache(maxsize=512)
def _columns(text: str) -> layout.Columns:
    """Return the columns of a filter; of many shards alike, the same object."""
    stored: Mapping[str, Sequence[str]] = json.loads(text)
    return layout.Columns(**{key: tuple(printable(str(name)) for name in names) for key, names in stored.items()})
