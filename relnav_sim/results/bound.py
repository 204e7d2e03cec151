"""The Cramér-Rao bound of a case: the file that a worker leaves it in, and its place in the results file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from relnav_sim.printable import printable
from relnav_sim.results import layout, store
from relnav_sim.results.atomic import written_whole
from relnav_sim.results.block import AnyArray, CaseHeader, RefusedError, ResultHeader, ResultsError
from relnav_sim.results.header import read_header
from relnav_sim.results.observability import Observability
from relnav_sim.results.shards import checksum

SUFFIX = ".bound"
_LONGEST_REASON = 2000
T = TypeVar("T")


@dataclass(frozen=True)
class BoundResult:
    """Bounds on the rms error of one case at its stored epochs.

    Attributes:
        seed: Seed of the campaign.
        case_id: Hash of the case's content without its filters.
        filter_ids: A hash of each filter's settings, by its name.
        perfect: Bound of a perfect model that goes by all sensors, (times, 8), in the order of `layout.QUANTITIES`;
            None where it failed.
        filters: Bounds of the filters' own models, (times, 8), by name; those that failed are left out.
        perfect_of: Bounds of a perfect model that goes by the filter's own sensors, by its name, (times, 8); only of
            filters that go by some of the sensors.
        observability: What the readings of its sensors can tell each filter, by name, as far as it is known.
        reason: Why one failed, in words, as that of a `Failure`; empty: none did.
        retry: Whether one failed for want of time or memory, so that another attempt may succeed.
    """

    seed: int
    case_id: str
    filter_ids: Mapping[str, str]
    perfect: AnyArray | None
    filters: Mapping[str, AnyArray]
    perfect_of: Mapping[str, AnyArray] = field(default_factory=dict)
    observability: Mapping[str, Observability] = field(default_factory=dict)
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
    arrays |= {f"perfect_of/{name}": array for name, array in bound.perfect_of.items()}
    for name, found in bound.observability.items():
        arrays |= {f"{part}/{name}": array for part, array in zip(_OBSERVED, found.arrays, strict=True)}
    header = {
        "seed": bound.seed,
        "case_id": bound.case_id,
        "filters": dict(bound.filter_ids),
        "stored": sorted(arrays),
        "observability": {
            name: {
                "sensors": found.sensors,
                "states": found.states,
                "blind": found.blind,
                "weakest": found.weakest,
                "course": found.course,
            }
            for name, found in bound.observability.items()
        },
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
            arrays = {name: _array(file, name) for name in map(str, header["stored"])}
            bound = BoundResult(
                seed=int(header["seed"]),
                case_id=str(header["case_id"]),
                filter_ids={str(name): str(key) for name, key in header["filters"].items()},
                perfect=arrays.get("perfect"),
                filters=_part(arrays, "filters"),
                perfect_of=_part(arrays, "perfect_of"),
                observability=_observed(header.get("observability", {}), arrays),  # earlier versions have none
                reason=str(header["reason"]),
                retry=bool(header.get("retry", False)),  # files of earlier versions do not say
            )
        except (AttributeError, KeyError, OverflowError, TypeError, ValueError):
            raise ResultsError(f"{path}: the header is damaged") from None
        if store.text(file, "checksum") != checksum(header, arrays):
            raise ResultsError(f"{path}: checksum does not match; the file is damaged")
    return bound


_OBSERVED = tuple(spec.name for spec in layout.OBSERVABILITY)


def _array(file: h5py.File, name: str) -> AnyArray:
    """Return an array of a bound's file by its name, PART or PART/FILTER."""
    group, _, last = name.partition("/")
    dims = next((spec.dims for spec in layout.OBSERVABILITY if spec.name == group), layout.BOUND.dims)
    spec = layout.Dataset(last or group, dims, layout.BOUND.dtype, "", "")
    return store.read(store.subgroup(file, group) if last else file, spec)


def _part(arrays: Mapping[str, AnyArray], part: str) -> dict[str, AnyArray]:
    """Return the arrays of one part by filter."""
    return {name.removeprefix(f"{part}/"): array for name, array in arrays.items() if name.startswith(f"{part}/")}


def _observed(header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> dict[str, Observability]:
    return {
        str(name): Observability(
            tuple(map(str, words["sensors"])),
            arrays[f"observability/{name}"],
            tuple(map(str, words["states"])),
            arrays[f"weakest_direction/{name}"],
            arrays[f"sigma_ratio/{name}"],
            int(words["blind"]),
            str(words["weakest"]),
            _course(words.get("course", ())),
        )
        for name, words in header.items()
    }


def _course(stored: Iterable[Any]) -> tuple[tuple[float, str], ...]:
    """Return the weakest direction over time from plain data.

    Raises:
        ValueError: It is damaged.
    """
    course = tuple((float(from_s), printable(str(words))) for from_s, words in stored)
    times = [from_s for from_s, _ in course]
    if not np.isfinite(times).all() or sorted(set(times)) != times:
        raise ValueError("the times do not ascend")
    return course


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
            held = {name: store.subgroup(group, name) for name in case.filters if name in store.names(group)}
            bound = BoundResult(
                seed=header.seed,
                case_id=case.id,
                filter_ids=dict(case.filter_ids),
                perfect=stored_bound(group),
                filters=_known({name: stored_bound(own) for name, own in held.items()}),
                perfect_of=_known({name: stored_bound(own, layout.PERFECT_BOUND) for name, own in held.items()}),
                observability=_known({name: stored_observability(own) for name, own in held.items()}),
            )
            if bound.perfect is not None or bound.filters or bound.perfect_of or bound.observability:
                bounds.append(bound)
    return bounds


def _known(found: Mapping[str, T | None]) -> dict[str, T]:
    return {name: one for name, one in found.items() if one is not None}


def stored_bound(group: h5py.Group, spec: layout.Dataset = layout.BOUND) -> AnyArray | None:
    """Return a bound in the group of a case or of a filter, (times, 8); None where there is none.

    Raises:
        ResultsError: It is damaged.
    """
    return store.read(group, spec) if spec.name in store.names(group) else None


def stored_observability(group: h5py.Group) -> Observability | None:
    """Return the observability in the group of a filter; None where there is none.

    Raises:
        ResultsError: It is damaged.
    """
    if _OBSERVED[0] not in store.names(group):
        return None
    ratio, direction, sigma_ratio = (store.read(group, spec) for spec in layout.OBSERVABILITY)
    states = tuple(map(str, store.read(group, layout.DIMENSIONS["state"])))
    blind, weakest = store.whole_number(group, "blind"), store.text(group, "weakest")
    sensors = tuple(map(str, store.json_value(group, "sensors", list)))
    course: tuple[tuple[float, str], ...] = ()
    if "course" in group.attrs:  # earlier versions have none
        try:
            course = _course(store.json_value(group, "course", list))
        except (TypeError, ValueError):
            raise ResultsError(f"{group.file.filename}: the course of {group.name} is damaged") from None
    return Observability(sensors, ratio, states, direction, sigma_ratio, blind, weakest, course)


def write_case_bound(group: h5py.Group, case: CaseHeader, bounds: Iterable[BoundResult]) -> None:
    """Write the bounds of a case beside its truth and its filters, whose groups exist; a bound known twice must agree.

    Raises:
        RefusedError: Two disagree, or they don't fit the case's epochs.
    """
    found: dict[tuple[str, str], AnyArray] = {}
    observed: dict[str, Observability] = {}
    for bound in bounds:
        mine = {name for name, key in bound.filter_ids.items() if case.filter_ids.get(name) == key}
        parts = {(layout.BOUND.name, ""): bound.perfect} if bound.perfect is not None else {}
        for spec, arrays in ((layout.BOUND, bound.filters), (layout.PERFECT_BOUND, bound.perfect_of)):
            parts |= {(spec.name, name): array for name, array in arrays.items() if name in mine}
        for place, array in parts.items():
            if not np.array_equal(found.setdefault(place, array), array, equal_nan=True):
                raise RefusedError(f"case {case.label}: two parts disagree about the bound of {place[1] or 'the case'}")
        for name, one in bound.observability.items():
            if name in mine and not observed.setdefault(name, one).agrees(one):
                raise RefusedError(f"case {case.label}: two parts disagree about the observability of {name}")
    for (what, name), array in found.items():
        if name and name not in group:
            continue  # of a filter that no run has been computed of yet
        if len(array) != len(group["time"]):
            raise RefusedError(f"case {case.label}: its bound has {len(array)} epochs, its series {len(group['time'])}")
        spec = layout.BOUND if what == layout.BOUND.name else layout.PERFECT_BOUND
        place = group[name] if name else group
        store.write_dimensions(place, [spec])
        store.write(place, spec, array)
    for name, one in observed.items():
        if name in group:
            _write_observability(group[name], one)


def _write_observability(group: h5py.Group, found: Observability) -> None:
    store.write_dimensions(group, layout.OBSERVABILITY, state=found.states)
    for spec, values in zip(layout.OBSERVABILITY, found.arrays, strict=True):
        store.write(group, spec, values)
    group.attrs["sensors"] = json.dumps(found.sensors)
    group.attrs["blind"], group.attrs["weakest"] = found.blind, found.weakest
    group.attrs["course"] = json.dumps(found.course)


def bounds_of(header: ResultHeader, bounds: Iterable[BoundResult]) -> dict[str, list[BoundResult]]:
    """Return a campaign's bounds by case, those of other seeds and cases left out."""
    by_case: dict[str, list[BoundResult]] = {case.id: [] for case in header.cases}
    for bound in bounds:
        if bound.seed == header.seed and bound.case_id in by_case:
            by_case[bound.case_id].append(bound)
    return by_case
