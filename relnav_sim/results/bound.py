"""The Cramér-Rao bound of a case: the file that a worker leaves it in, and its place in the results file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np

from relnav_sim.printable import printable
from relnav_sim.results import hdf5, layout, stacks, store
from relnav_sim.results.block import AnyArray, RefusedError, ResultsError
from relnav_sim.results.bundle import Bundle, open_bundle, read_bundle, write_bundle, written
from relnav_sim.results.campaign_header import CaseHeader, ResultHeader
from relnav_sim.results.header import read_header
from relnav_sim.results.observability import Observability, course_of
from relnav_sim.results.shards import checksum
from relnav_sim.results.stored_cases import StoredCases

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
        observability: What the measurements of its sensors can tell each filter, by name, as far as it is known.
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
    write_bundle(path, layout.BOUND_FORMAT, *_parts(bound))


def bound_digest(bound: BoundResult) -> str:
    """Return the checksum that the file of a bound holds."""
    return written(*_parts(bound))[0]["checksum"]


def _parts(bound: BoundResult) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    """Return what says what a bound is of, and its arrays."""
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
    return header, arrays


def open_bound(path: Path) -> Bundle:
    """Return a bound's file as a bundle: what it says about itself, its numbers when they are asked for.

    Raises:
        ResultsError: The file is missing, torn or no bound.
    """
    return open_bundle(path, layout.BOUND_FORMAT, _former_arrays)


def read_bound(path: Path) -> BoundResult:
    """Return the bounds of a case from their file after verifying its checksum.

    Raises:
        ResultsError: The file is missing, torn, or its numbers differ from those written.
    """
    return bound_of(read_bundle(path, layout.BOUND_FORMAT, _former_arrays))


def bound_of(bundle: Bundle) -> BoundResult:
    """Return the bounds of a case after verifying their checksum.

    Raises:
        ResultsError: They differ from those written, or are no bounds.
    """
    arrays, header = bundle.load(), bundle.header
    try:
        return BoundResult(
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
        raise ResultsError(f"{bundle.path}: the header is damaged") from None


def _former_arrays(file: h5py.File, header: Mapping[str, Any]) -> dict[str, AnyArray]:
    """Return the arrays of a file of version 1, in which each is a dataset."""
    path = Path(file.filename)
    try:
        arrays = {name: _array(file, name) for name in map(str, header["stored"])}
    except (KeyError, TypeError):
        raise ResultsError(f"{path}: the header is damaged") from None
    if store.text(file, "checksum") != checksum(header, arrays):
        raise ResultsError(f"{path}: checksum does not match; the file is damaged")
    return arrays


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
            course_of(words.get("course", ())),
        )
        for name, words in header.items()
    }


def result_bounds(path: Path) -> list[BoundResult]:
    """Return the bounds that a results file holds, one for each case that has any.

    Raises:
        ResultsError: The file is missing, damaged or no result.
    """
    bounds = []
    with store.open_checked(path, layout.FORMAT) as file:
        header, _ = read_header(file)
        cases = StoredCases(file)
        for index, case in enumerate(header.cases):
            beside = cases.case(index)
            found = {name: cases.filter(index, name) for name in case.filters}
            held = {name: part for name, part in found.items() if part is not None}
            bound = BoundResult(
                seed=header.seed,
                case_id=case.id,
                filter_ids=dict(case.filter_ids),
                perfect=None if beside is None else beside.limit(layout.BOUND),
                filters=_known({name: own.limit(layout.BOUND) for name, own in held.items()}),
                perfect_of=_known({name: own.limit(layout.PERFECT_BOUND) for name, own in held.items()}),
                observability=_known({name: own.observability() for name, own in held.items()}),
            )
            if bound.perfect is not None or bound.filters or bound.perfect_of or bound.observability:
                bounds.append(bound)
    return bounds


def _known(found: Mapping[str, T | None]) -> dict[str, T]:
    return {name: one for name, one in found.items() if one is not None}


@dataclass(frozen=True)
class CaseLimits:
    """What measurements can tell at most in a case, from all its bounds.

    Attributes:
        arrays: Bounds, (times, 8), by dataset of the layout and filter; by an empty name the case's own.
        observed: The observability by filter.
    """

    arrays: Mapping[tuple[layout.Dataset, str], AnyArray] = field(default_factory=dict)
    observed: Mapping[str, Observability] = field(default_factory=dict)


def case_limits(case: CaseHeader, bounds: Iterable[BoundResult], times: int, held: Collection[str]) -> CaseLimits:
    """Return the limits of a case; a bound known twice must agree.

    Args:
        case: The case.
        bounds: Its bounds.
        times: Number of its stored epochs.
        held: Its filters that runs have been computed of.

    Raises:
        RefusedError: Two disagree, or they don't fit the case's epochs.
    """
    found: dict[tuple[layout.Dataset, str], AnyArray] = {}
    observed: dict[str, Observability] = {}
    for bound in bounds:
        mine = {name for name, key in bound.filter_ids.items() if case.filter_ids.get(name) == key}
        parts = {(layout.BOUND, ""): bound.perfect} if bound.perfect is not None else {}
        for spec, arrays in ((layout.BOUND, bound.filters), (layout.PERFECT_BOUND, bound.perfect_of)):
            parts |= {(spec, name): array for name, array in arrays.items() if name in mine}
        for place, array in parts.items():
            if not np.array_equal(found.setdefault(place, array), array, equal_nan=True):
                raise RefusedError(f"case {case.label}: two parts disagree about the bound of {place[1] or 'the case'}")
        for name, one in bound.observability.items():
            if name in mine and not observed.setdefault(name, one).agrees(one):
                raise RefusedError(f"case {case.label}: two parts disagree about the observability of {name}")
    kept = {place: array for place, array in found.items() if place[1] in ("", *held)}
    for array in kept.values():
        if len(array) != times:
            raise RefusedError(f"case {case.label}: its bound has {len(array)} epochs, its series {times}")
    return CaseLimits(kept, {name: one for name, one in observed.items() if name in held})


def write_limits(group: h5py.Group, limits: CaseLimits) -> None:
    """Write the limits of a case into its own group and those of its filters, which exist."""
    for (spec, name), array in limits.arrays.items():
        place = group[name] if name else group
        store.write_dimensions(place, [spec])
        store.write(place, {spec: array})
    for name, one in limits.observed.items():
        place = group[name]
        store.write_dimensions(place, layout.OBSERVABILITY, state=one.states)
        store.write(place, dict(zip(layout.OBSERVABILITY, one.arrays, strict=True)))
        sensors, course = json.dumps(one.sensors), json.dumps(one.course)
        facts = {"sensors": sensors, "blind": one.blind, "weakest": one.weakest, "course": course}
        hdf5.set_attributes(place.id, facts)


def write_stacked_limits(group: h5py.Group, of_cases: Mapping[int, CaseLimits]) -> None:
    """Write the limits of the cases of a stack, by their numbers; states are alike in all that observe a filter."""
    for spec, name in dict.fromkeys(place for limits in of_cases.values() for place in limits.arrays):
        rows = {i: limits.arrays[spec, name] for i, limits in of_cases.items() if (spec, name) in limits.arrays}
        place, whole = group[name] if name else group, stacks.stacked(spec)
        store.write_dimensions(place, [whole], **{whole.dims[0]: list(rows)})
        store.write(place, {whole: np.stack(list(rows.values()))})
    for name in dict.fromkeys(name for limits in of_cases.values() for name in limits.observed):
        found = {i: limits.observed[name] for i, limits in of_cases.items() if name in limits.observed}
        specs, facts = [stacks.stacked(spec) for spec in layout.OBSERVABILITY], list(found.values())
        axes = {"state": facts[0].states, specs[0].dims[0]: list(found)}
        store.write_dimensions(group[name], [*specs, *stacks.OBSERVED_FACTS], **axes)
        store.write(group[name], {spec: np.stack([one.arrays[i] for one in facts]) for i, spec in enumerate(specs)})
        words = [(json.dumps(one.sensors), one.blind, one.weakest, json.dumps(one.course)) for one in facts]
        store.write(group[name], dict(zip(stacks.OBSERVED_FACTS, zip(*words, strict=True), strict=True)))


def bounds_of(header: ResultHeader, bounds: Iterable[BoundResult]) -> dict[str, list[BoundResult]]:
    """Return a campaign's bounds by case, those of other seeds and cases left out."""
    by_case: dict[str, list[BoundResult]] = {case.id: [] for case in header.cases}
    for bound in bounds:
        if bound.seed == header.seed and bound.case_id in by_case:
            by_case[bound.case_id].append(bound)
    return by_case
