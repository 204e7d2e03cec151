"""What was run, as a report tells it: the campaign's settings, where the result came from, how to get it again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from relnav_sim.campaign.shared_field import shared_field_of_results
from relnav_sim.campaign.warnings import flown_warnings
from relnav_sim.report.tables import Column, Row, Table, Words
from relnav_sim.results.seal import NO_SEAL
from relnav_sim.results.settings import filter_settings
from relnav_sim.results.stopping import stopping_in_words
from relnav_sim.wording import counted, significant

if TYPE_CHECKING:
    from relnav_sim.results.campaign_header import ReplayHeader
    from relnav_sim.results.read import Results

_SECTIONS = ("clock", "truth", "sensors", "start", "statistics")
_HASH_SHOWN = 16


def headline_facts(results: Results) -> tuple[str, ...]:
    """Return the few facts that stand under the report's title."""
    clock = results.campaign_content.get("clock", {})
    stressed = len(results.headers) - len(results.nominal)
    facts = [
        counted(results.planned_runs, "run"),
        counted(len(results.nominal), "case"),
        *([counted(stressed, "stressed case")] if stressed else []),
        f"{counted(len(results.filters), 'filter')}: {', '.join(results.filters)}",
    ]
    if {"duration_s", "step_s"} <= clock.keys():
        facts.append(f"{clock['duration_s']:g} s in steps of {clock['step_s']:g} s")
    if results.replay is not None:
        facts.insert(0, "recorded measurements")
    return (*facts, f"seed {results.seed}", f"hash {results.campaign_hash[:_HASH_SHOWN]}")


def document_facts(results: Results) -> tuple[str, ...]:
    """Return what the campaign says of itself as a document: its name beside a title, author, revision, date."""
    content = results.campaign_content
    named = {"campaign": results.campaign_name if content.get("title") else None}
    named |= {key: content.get(key) for key in ("author", "revision", "date")}
    return tuple(f"{key} {value}" for key, value in named.items() if value)


def leakage(results: Results) -> tuple[str, ...]:
    """Return a sentence on the filters whose dynamics were learned from the truth, if there are any."""
    settings = dict(flattened(results.campaign_content.get("filters", {}), "filters"))
    for header in results.headers:
        settings |= {path: value for path, value in flattened(header.variables) if value == "truth"}
    told = [name for name in results.filters if settings.get(f"filters.{name}.dynamics.training") == "truth"]
    if not told:
        return ()
    return (
        f"Leakage: the dynamics of {', '.join(told)} are learned from the truth, which no flight filter has; do not "
        "compare their errors with those of the others.",
    )


def geometry(results: Results) -> tuple[str, ...]:
    """Return what the flown geometry did to the measurements, if anything: sentences that belong to any verdict."""
    return flown_warnings(
        results.campaign_content,
        (
            (
                header.label,
                header.variables,
                results.time_s(index),
                results.truth(index),
                {name: results.named_sensors(index, name) for name in header.filters},
            )
            for index, header in ((index, results.headers[index]) for index in results.nominal)
            if any(len(results.case_runs(index, name)) for name in header.filters)
        ),
    )


def shared_field(results: Results) -> tuple[str, ...]:
    """Return which filters know all of the truth's gravity field, so that their consistency says nothing of flight."""
    return shared_field_of_results(
        results.campaign_content,
        (
            (header.label, header.variables, [name for name in header.filters if len(results.case_runs(index, name))])
            for index, header in ((index, results.headers[index]) for index in results.nominal)
        ),
    )


def provenance_facts(results: Results) -> tuple[tuple[str, str], ...]:
    """Return how the result came about, as names and values."""
    origin = results.provenance
    finished = shown_time(origin.finished)
    state = {1: ", with uncommitted changes", 0: ""}.get(origin.git_dirty, "")
    varied = list(dict.fromkeys(path for header in results.headers for path in header.variables))
    facts = {
        "campaign": results.campaign_name,
        "seed": str(results.seed),
        "content hash": results.campaign_hash,
        "sensors": _sensors(results),
        "varied": ", ".join(varied) or "nothing",
        "runs": f"{results.planned_runs} of each case",
        "recorded measurements": "" if results.replay is None else recorded_in_words(results.replay),
        "scored against": "" if results.replay is None else results.replay.truth,
        "stopping rule": stopping_in_words(results.stopping) if results.stopping else "",
        "result file": results.path.name,
        "computed": f"{shown_time(origin.started)} to {finished}, {significant(origin.wall_time_s)} s",
        "source": f"{origin.git_commit}{state}" if origin.git_commit else "installed package",
        "checksum": "" if results.sealed else NO_SEAL,
        "versions": ", ".join(f"{name} {version}" for name, version in origin.versions.items()),
        "machine": ", ".join(f"{name} {value}" for name, value in origin.machine.items()),
        "computed on": ", ".join(f"{name}: {count} blocks" for name, count in origin.machines.items()),
    }
    return tuple((name, value) for name, value in facts.items() if value)


def recorded_in_words(replay: ReplayHeader) -> str:
    """Return the files of recorded measurements with the first digits of their digests."""
    return ", ".join(f"{path} (SHA-256 {digest[:_HASH_SHOWN]})" for path, digest in replay.files.items())


def _sensors(results: Results) -> str:
    """Return what a measurement of each sensor consists of, in words; nothing where the result does not say."""
    found = {sensor: channels for header in results.headers for sensor, channels in header.channels.items()}
    return "; ".join(
        f"{sensor}: {', '.join(f'{channel.label} [{channel.unit}]' for channel in channels)}"
        for sensor, channels in found.items()
    )


def filters_table(results: Results) -> Table:
    """Return what each filter was told to be; varied values stand as in the first case that has the filter."""
    rows = []
    for name in results.filters:
        first = next(i for i, header in enumerate(results.headers) if name in header.filters)
        entry = filter_settings(results, first, name)
        settings = ", ".join(f"{path} = {value}" for path, value in flattened(entry) if path != "kind")
        rows.append(Row(name, (Words(str(entry.get("kind", ""))), Words(settings))))
    return Table(
        name="filters",
        title="Filters",
        caption="Their settings, defaults filled in.",
        corner="filter",
        columns=(Column("kind", numeric=False), Column("settings", numeric=False)),
        rows=tuple(rows),
    )


def settings_table(results: Results) -> Table:
    """Return every other setting with its value, defaults filled in; varied values stand as in the first case."""
    content = results.campaign_content
    rows = [
        Row(path, (Words(value),))
        for section in _SECTIONS
        if section in content
        for path, value in flattened(content[section], section)
    ]
    return Table(
        name="settings",
        title="All settings",
        caption="Defaults filled in; what the campaign varies stands as in the first case.",
        corner="setting",
        columns=(Column("value", numeric=False),),
        rows=tuple(rows),
    )


def shown_time(moment: str) -> str:
    """Return an ISO 8601 moment as people write it."""
    return moment.replace("T", " ").replace("+00:00", " UTC")


def flattened(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """Yield every leaf of nested settings with its dotted path; what is not set is left out."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flattened(inner, f"{path}.{key}" if path else str(key))
    elif value is not None:
        yield path, _shown(value)


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_shown(inner) for inner in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_shown(inner)}" for key, inner in value.items()) + "}"
    return str(value)
