"""The facts of a campaign in its results file: written once, read back the same."""

from __future__ import annotations

import functools
import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import h5py

from relnav_sim.measurements.channel import Channel
from relnav_sim.results import hdf5, layout, stacks, store
from relnav_sim.results.block import ResultsError
from relnav_sim.results.campaign_header import CaseHeader, ReplayHeader, ResultHeader
from relnav_sim.results.provenance import Provenance, Session, checked_moment, stored_session
from relnav_sim.results.sound import odd_header


def write_header(file: h5py.File, header: ResultHeader, provenance: Provenance) -> None:
    """Write the attributes of the file, its constants, and a group with attributes for each case."""
    facts = {
        "format": layout.FORMAT,
        "format_version": stacks.result_version(len(header.cases)),
        "campaign_name": header.campaign_name,
        "campaign_text": header.text,
        "campaign_content": json.dumps(header.content),
        "campaign_hash": header.hash,
        "seed": str(header.seed),
        "runs": header.runs,
    }
    if header.only is not None:
        facts["only_run"] = header.only
    if header.stopping:
        facts["stopping"] = json.dumps(dict(header.stopping))
    if header.replay is not None:
        facts["replay"] = json.dumps(asdict(header.replay))
    for name, value in asdict(provenance).items():
        if name == "machines" and not value:
            continue
        facts[name] = json.dumps(value) if isinstance(value, dict | tuple) else value
    hdf5.set_attributes(file.id, facts)
    hdf5.set_attributes(file.create_group("constants").id, header.constants)
    if len(header.cases) > stacks.STACKED_CASES:
        _write_cases(file, header.cases)
        return
    for index, case in enumerate(header.cases):
        hdf5.set_attributes(file.create_group(layout.case_group(index)).id, _texts_of(case))


def _texts_of(case: CaseHeader) -> dict[str, str]:
    return {
        "id": case.id,
        "label": case.label,
        "variables": json.dumps(dict(case.variables)),
        "filters": json.dumps({name: case.filter_ids[name] for name in case.filters}),
        "channels": json.dumps(
            {sensor: [asdict(channel) for channel in channels] for sensor, channels in case.channels.items()}
        ),
        **({"stress": case.stress, "nominal": case.nominal} if case.stress else {}),
    }


def _write_cases(file: h5py.File, cases: Sequence[CaseHeader]) -> None:
    """Write what the cases are as a table: a group for each would take longer than their numbers."""
    group = file.create_group(stacks.CASES)
    store.write_dimensions(group, stacks.CASE_TABLE, case=range(len(cases)))
    rows = [_texts_of(case) for case in cases]
    store.write(group, {spec: [row.get(spec.name, "") for row in rows] for spec in stacks.CASE_TABLE})


def read_header(file: h5py.File) -> tuple[ResultHeader, Provenance]:
    """Return what `write_header` wrote.

    Raises:
        ResultsError: Something is missing or damaged.
    """
    cases = _read_cases(file)
    try:
        seed = int(store.text(file, "seed"))
    except ValueError:
        raise ResultsError(f"{file.filename}: the seed is no whole number") from None
    header = ResultHeader(
        campaign_name=store.text(file, "campaign_name"),
        text=store.text(file, "campaign_text"),
        content=store.json_value(file, "campaign_content", dict),
        hash=store.text(file, "campaign_hash"),
        seed=seed,
        runs=store.whole_number(file, "runs"),
        cases=cases,
        constants=store.attributes(store.subgroup(file, "constants")),
        only=store.whole_number(file, "only_run") if "only_run" in file.attrs else None,
        stopping=store.json_value(file, "stopping", dict) if "stopping" in file.attrs else {},
        replay=_read_replay(file),
    )
    if odd := odd_header(header):
        raise ResultsError(f"{file.filename}: {odd}; the file is damaged")
    provenance = Provenance(
        versions=_texts(file, "versions"),
        git_commit=store.text(file, "git_commit"),
        git_dirty=store.whole_number(file, "git_dirty"),
        machine=_texts(file, "machine"),
        command_line=store.text(file, "command_line"),
        started=_moment(file, "started"),
        finished=_moment(file, "finished"),
        wall_time_s=store.number(file, "wall_time_s"),
        sessions=_read_sessions(file),
        machines=_counts(file, "machines") if "machines" in file.attrs else {},
    )
    return header, provenance


def _read_replay(file: h5py.File) -> ReplayHeader | None:
    if "replay" not in file.attrs:
        return None
    try:
        return ReplayHeader.of_plain(store.json_value(file, "replay", dict))
    except ValueError as error:
        raise ResultsError(f"{file.filename}: what it says of its recorded measurements is damaged: {error}") from None


def _texts(file: h5py.File, name: str) -> dict[str, str]:
    return {str(key): str(value) for key, value in store.json_value(file, name, dict).items()}


def _counts(file: h5py.File, name: str) -> dict[str, int]:
    try:
        return {str(key): int(value) for key, value in store.json_value(file, name, dict).items()}
    except (TypeError, ValueError, OverflowError):
        raise ResultsError(f"{file.filename}: attribute {name!r} is damaged") from None


def _moment(file: h5py.File, name: str) -> str:
    text = store.text(file, name)
    try:
        checked_moment(text)
    except ValueError:
        raise ResultsError(f"{file.filename}: attribute {name!r} is no moment") from None
    return text


def _read_sessions(file: h5py.File) -> tuple[Session, ...]:
    try:
        return tuple(stored_session(stored) for stored in store.json_value(file, "sessions", list))
    except ValueError:
        raise ResultsError(f"{file.filename}: its list of sessions is damaged") from None


def _read_cases(file: h5py.File) -> tuple[CaseHeader, ...]:
    if stacks.CASES in store.names(file):
        table = store.subgroup(file, stacks.CASES)
        columns = [store.read(table, spec) for spec in stacks.CASE_TABLE]
        return tuple(_case(f"{file.filename}: {table.name}", *map(str, row)) for row in zip(*columns, strict=True))
    groups = [store.subgroup(file, name) for name in store.names(file) if name.startswith("case_")]
    ordered = sorted(groups, key=_number)
    if [group.name for group in ordered] != [f"/{layout.case_group(index)}" for index in range(len(ordered))]:
        raise ResultsError(f"{file.filename}: some of its cases are missing")
    return tuple(map(_read_case, ordered))


def _read_case(group: h5py.Group) -> CaseHeader:
    later = {"channels": "{}", "stress": "", "nominal": ""}
    names = [spec.name for spec in stacks.CASE_TABLE if spec.name in group.attrs or spec.name not in later]
    texts = {name: store.text(group, name) for name in names}
    return _case(f"{group.file.filename}: {group.name}", **{**later, **texts})


def _case(
    where: str, id: str, label: str, variables: str, filters: str, channels: str, stress: str, nominal: str
) -> CaseHeader:
    found = {}
    for name, text in (("filters", filters), ("variables", variables)):
        found[name] = store.plain(text, dict)
        if found[name] is None:
            raise ResultsError(f"{where}: its {name} are damaged")
    ids = {str(name): str(key) for name, key in found["filters"].items()}
    try:
        read = _channels(channels)
    except (TypeError, ValueError):
        raise ResultsError(f"{where}: its channels are damaged") from None
    return CaseHeader(id, label, found["variables"], tuple(ids), ids, read, stress, nominal)


@functools.lru_cache(maxsize=64)
def _channels(text: str) -> dict[str, tuple[Channel, ...]]:
    """Return the channels of each sensor; of many cases alike, the same ones."""
    stored = store.plain(text, dict)
    if stored is None:
        raise ValueError("they are no JSON")
    return read_channels(stored)


def read_channels(stored: Mapping[str, Any]) -> dict[str, tuple[Channel, ...]]:
    """Return the channels of each sensor from plain data, as `dataclasses.asdict` makes it.

    Raises:
        TypeError: They are damaged.
        ValueError: The same.
    """
    found = {str(sensor): tuple(Channel(**channel) for channel in channels) for sensor, channels in stored.items()}
    for channel in itertools.chain.from_iterable(found.values()):
        if not all(isinstance(text, str) for text in (channel.name, channel.unit, channel.label)):
            raise ValueError("a channel's words are no text")
        if not isinstance(channel.angle, bool):
            raise ValueError("whether a channel is an angle is neither true nor false")
    return found


def _number(group: h5py.Group) -> int:
    digits = group.name.rpartition("_")[2]
    if not digits.isdecimal():
        raise ResultsError(f"{group.file.filename}: {group.name} is no case")
    return int(digits)
