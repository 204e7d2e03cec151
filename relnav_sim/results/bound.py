"""The Cramér-Rao bound of a case: the file that a worker leaves it in, and its place in the results file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

from relnav_sim.printable import printable
from relnav_sim.results import layout, store
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import Array, CaseHeader, RefusedError, ResultHeader, ResultsError
from relnav_sim.results.header import read_header
from relnav_sim.results.shards import checksum

SUFFIX = ".bound"
_LONGEST_REASON = 2000


@dataclass(frozen=True)
class BoundResult:
    """Bounds on the rms error of one case at its stored epochs.

    Attributes:
        seed: Seed of the campaign.
        case_id: Hash of the case's content without its filters.
        filter_ids: A hash of each filter's settings, by its name.
        perfect: Bound of a perfect model that goes by all sensors, (times, 8), in the order of `layout.QUANTITIES`; None
            where it failed.
        filters: Bounds of the filters' own models, (times, 8), by name; those that failed are left out.
        perfect_of: Bounds of a perfect model that goes by the filter's own sensors, by its name, (times, 8); only of
            filters that go by some of the sensors.
        reason: Why one failed, in words, as that of a `Failure`; empty: none did.
        retry: Whether one failed for want of time or memory, so that another attempt may succeed.
    """

    seed: int
    case_id: str
    filter_ids: Mapping[str, str]
    perfect: Array | None
    filters: Mapping[str, Array]
    perfect_of: Mapping[str, Array] = field(default_factory=dict)
    reason: str = ""
    retry: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", printable(self.reason, _LONGEST_REASON))


def bound_name(seed: int, case_id: str, filter_ids: Mapping[str, str]) -> str:
    """Return the file name of the bounds of one seed, case and set of filters."""
    key = hashlib.sha256(json.dumps([seed, case_id, sorted(filter_ids.items())]).encode()).hexdigest()
    return f"{case_id[:12]}_{key[:12]}{SUFFIX}"


def write_bound(path: Path, bound: BoundResult) -> None:
    """Write the bounds of a case into a file of their own.

    Raises:
        OSError: The file can't be written.
    """
    arrays = {"perfect": bound.perfect} if bound.perfect is not None else {}
    arrays |= {f"filters/{name}": array for name, array in bound.filters.items()}
    header = {
        "seed": bound.seed,
        "case_id": bound.case_id,
        "filters": dict(bound.filter_ids),
        "stored": sorted(arrays),
        "reason": bound.reason,
        "retry": bound.retry,
    }
    with written_whole(path) as temporary, store.create_file(temporary) as file:
        file.attrs["format"] = layout.BOUND_FORMAT
        file.attrs["format_version"] = layout.FORMAT_VERSION
        file.attrs["header"] = json.dumps(header)
        file.attrs["checksum"] = checksum(header, arrays)
        for name, array in arrays.items():
            file.create_dataset(name, data=array, track_times=False)


def read_bound(path: Path) -> BoundResult:
    """Return the bounds of a case from their file after verifying its checksum.

    Raises:
        ResultsError: The file is missing, torn, or its numbers differ from those written.
    """
    with store.open_checked(path, layout.BOUND_FORMAT) as file:
        header = store.json_value(file, "header", dict)
        try:
            arrays = {}
            for name in map(str, header["stored"]):
                group, _, last = name.rpartition("/")
                spec = layout.Dataset(last, layout.BOUND.dims, layout.BOUND.dtype, "", "")
                arrays[name] = store.read(store.subgroup(file, group) if group else file, spec)
            bound = BoundResult(
                seed=int(header["seed"]),
                case_id=str(header["case_id"]),
                filter_ids={str(name): str(key) for name, key in header["filters"].items()},
                perfect=arrays.get("perfect"),
                filters={name.removeprefix("filters/"): a for name, a in arrays.items() if name != "perfect"},
                reason=str(header["reason"]),
                retry=bool(header.get("retry", False)),  # files of earlier versions do not say
            )
        except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
            raise ResultsError(f"{path}: the header is damaged") from None
        if store.text(file, "checksum") != checksum(header, arrays):
            raise ResultsError(f"{path}: checksum does not match; the file is damaged")
    return bound


def result_bounds(path: Path) -> list[BoundResult]:
    """Return the bounds that a results file holds, one for each case that has any.

    Raises:
        ResultsError: The file is missing, damaged or no result.
    """
    bounds = []
    with store.open_checked(path, layout.FORMAT) as file:
        header, _ = read_header(file)
        for index, case in enumerate(header.cases):
            group = store.subgroup(file, layout.case_group(index))
            perfect = stored_bound(group)
            held = {
                name: stored_bound(store.subgroup(group, name)) for name in case.filters if name in store.names(group)
            }
            filters = {name: array for name, array in held.items() if array is not None}
            if perfect is not None or filters:
                bounds.append(BoundResult(header.seed, case.id, dict(case.filter_ids), perfect, filters))
    return bounds


def stored_bound(group: h5py.Group) -> Array | None:
    """Return the bound in the group of a case or of a filter, (times, 8); None where there is none.

    Raises:
        ResultsError: It is damaged.
    """
    return store.read(group, layout.BOUND) if layout.BOUND.name in store.names(group) else None


def write_case_bound(group: h5py.Group, case: CaseHeader, bounds: Iterable[BoundResult]) -> None:
    """Write the bounds of a case beside its truth and its filters, whose groups exist; a bound known twice must agree.

    Raises:
        RefusedError: Two disagree, or they don't fit the case's epochs.
    """
    found: dict[str, Array] = {}
    for bound in bounds:
        parts = {"": bound.perfect} if bound.perfect is not None else {}
        parts |= {n: a for n, a in bound.filters.items() if case.filter_ids.get(n) == bound.filter_ids[n]}
        for name, array in parts.items():
            if not np.array_equal(found.setdefault(name, array), array, equal_nan=True):
                raise RefusedError(f"case {case.label}: two parts disagree about the bound of {name or 'the case'}")
    for name, array in found.items():
        if name and name not in group:
            continue  # of a filter that no run has been computed of yet
        place = group[name] if name else group
        if len(array) != len(group["time"]):
            raise RefusedError(f"case {case.label}: its bound has {len(array)} epochs, its series {len(group['time'])}")
        store.write_dimensions(place, [layout.BOUND])
        store.write(place, layout.BOUND, array)


def bounds_of(header: ResultHeader, bounds: Iterable[BoundResult]) -> dict[str, list[BoundResult]]:
    """Return a campaign's bounds by case, those of other seeds and cases left out."""
    by_case: dict[str, list[BoundResult]] = {case.id: [] for case in header.cases}
    for bound in bounds:
        if bound.seed == header.seed and bound.case_id in by_case:
            by_case[bound.case_id].append(bound)
    return by_case
