"""One file per block of runs, written by the worker that simulated it and verified before anyone believes it.

A shard is written under a temporary name, synced and renamed, so it is whole or absent. It carries the seed, the
case, the filters with their ids, the runs and a checksum over all its numbers: everything its numbers depend on, and
nothing else, so that a campaign that grows keeps the shards it has.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relnav_sim.printable import printable
from relnav_sim.results import layout, store
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import AnyArray, BlockResult, Failure, FilterResult, ResultsError

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
    retry: bool = False


def shard_name(seed: int, case_id: str, filter_ids: Mapping[str, str], runs: Sequence[int]) -> str:
    """Return the file name of the shard of one seed, case, set of filters and range of runs."""
    key = hashlib.sha256(json.dumps([seed, case_id, sorted(filter_ids.items()), list(runs)]).encode()).hexdigest()
    return f"{case_id[:12]}_{min(runs):06d}-{max(runs):06d}_{key[:12]}.h5"


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
    header = {
        "seed": seed,
        "case_index": block.case_index,
        "case_id": block.case_id,
        "filters": {name: filter_ids[name] for name in block.filters},
        "shared_truth": block.shared_truth,
        **({"retry": True} if block.retry else {}),
        "columns": {name: asdict(result.columns) for name, result in block.filters.items()},
        "failures": [[f.run, f.filter, f.epoch, f.reason] for f in block.failures],
    }
    with written_whole(path) as temporary, store.create_file(temporary) as file:
        file.attrs["format"] = layout.SHARD_FORMAT
        file.attrs["format_version"] = layout.FORMAT_VERSION
        file.attrs["header"] = json.dumps(header)
        file.attrs["checksum"] = checksum(header, arrays)
        for name, array in arrays.items():
            file.create_dataset(name, data=array, track_times=False)


def read_shard_info(path: Path) -> ShardInfo:
    """Return what a shard says about itself, without reading its numbers or trusting them.

    Raises:
        ResultsError: The file is missing, torn or no shard.
    """
    with store.open_checked(path, layout.SHARD_FORMAT) as file:
        return _info(path, store.json_value(file, "header", dict), store.read(file, _RUN))


def read_shard(path: Path) -> tuple[ShardInfo, BlockResult]:
    """Return a shard's results after verifying its checksum.

    Raises:
        ResultsError: The file is missing, torn, no shard, or its numbers differ from those written.
    """
    with store.open_checked(path, layout.SHARD_FORMAT) as file:
        header = store.json_value(file, "header", dict)
        arrays = {"run": store.read(file, _RUN), "time": store.read(file, _TIME)}
        arrays["truth"] = store.read(file, layout.TRUTH)
        info = _info(path, header, arrays["run"])
        groups = store.subgroup(file, "filters") if info.filters else None
        for name in info.filters:
            group = store.subgroup(groups, name)
            for spec in info.columns[name].datasets:
                arrays[f"filters/{name}/{spec.name}"] = store.read(group, spec)
        if store.text(file, "checksum") != checksum(header, arrays):
            raise ResultsError(f"{path}: checksum does not match; the shard is damaged")
    filters = {
        name: FilterResult.of_arrays(
            {spec.name: arrays[f"filters/{name}/{spec.name}"] for spec in info.columns[name].datasets},
            info.columns[name],
        )
        for name in info.filters
    }
    try:
        failures = tuple(Failure(int(run), str(name), int(k), str(why)) for run, name, k, why in header["failures"])
    except (KeyError, OverflowError, TypeError, ValueError):
        raise ResultsError(f"{path}: the shard's header is damaged") from None
    return info, BlockResult(
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


def _info(path: Path, header: Mapping[str, Any], runs: AnyArray) -> ShardInfo:
    try:
        return ShardInfo(
            path,
            int(header["seed"]),
            int(header["case_index"]),
            str(header["case_id"]),
            tuple(header["filters"]),
            {str(name): str(key) for name, key in header["filters"].items()},
            tuple(int(run) for run in runs),
            bool(header["shared_truth"]),
            {str(name): _columns(header["columns"][name]) for name in header["filters"]},
            bool(header.get("retry", False)),
        )
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
        raise ResultsError(f"{path}: the shard's header is damaged") from None


def checksum(header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> str:
    """Return a digest of a file's header and of all its numbers."""
    digest = hashlib.sha256(json.dumps(header, sort_keys=True).encode())
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _columns(stored: Mapping[str, Sequence[str]]) -> layout.Columns:
    return layout.Columns(**{key: tuple(printable(str(name)) for name in names) for key, names in stored.items()})
