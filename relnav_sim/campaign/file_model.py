"""The whole campaign file as one model, and the validators of its parts."""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Annotated, Any, cast

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError, WithJsonSchema, create_model

from relnav_sim.campaign.entries import (
    FilterEntry,
    Registered,
    entry_adapter,
    entry_type,
    registered,
    sensor_adapter,
    sensors_type,
)
from relnav_sim.campaign.former import present_spelling
from relnav_sim.campaign.messages import explain
from relnav_sim.campaign.models import (
    LARGEST_SEED,
    MOST_RUNS,
    Clock,
    FirstFixStart,
    StartOptions,
    StatisticsOptions,
    StopOptions,
    TuneOptions,
)
from relnav_sim.campaign.problems import Path, Problem
from relnav_sim.campaign.requirements import AnyRequirement
from relnav_sim.campaign.shape import Shape
from relnav_sim.options import Options
from relnav_sim.sensors import SensorOptions, sensor_kinds
from relnav_sim.sensors.conformity import TriedSensors
from relnav_sim.truth import TruthSection

# What of pandas' default `na_values` the pattern allows, in any capitals; R reads NA alike.
_MISSING = frozenset({"na", "nan", "null", "none"})
_IN_REPORTS = "Stands in the head of reports; changes no result"
NAME_PATTERN = r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}"


def check_name(name: str) -> str:
    """Return a name of a campaign or a filter.

    Raises:
        ValueError: The name would not serve as part of a file's name, or spreadsheets and data frames take it for none.
    """
    if not re.fullmatch(NAME_PATTERN, name):
        raise ValueError("a name has 1 to 64 letters, digits, '_', '-' or '.', and begins with a letter or a digit")
    if name.casefold() in _MISSING:
        raise ValueError(f"pandas and R read {name!r} in a CSV file as a missing value; take another name")
    return name


Name = Annotated[str, AfterValidator(check_name), WithJsonSchema({"type": "string", "pattern": f"^{NAME_PATTERN}$"})]


class Settings(Options):
    """The keys of a campaign that hold for all its cases."""

    name: Name = Field(
        description="Name of the campaign, and of its result file unless `--out` says otherwise: letters, digits, "
        "'_', '-', '.'"
    )
    title: str | None = Field(default=None, description=f"Title of the report; default: the name. {_IN_REPORTS}")
    author: str | None = Field(default=None, description=f"Who answers for the campaign. {_IN_REPORTS}")
    revision: str | None = Field(default=None, description=f"Revision of the campaign, as text: '1.2'. {_IN_REPORTS}")
    date: str | None = Field(default=None, description=f"Date of the revision, as text: '2026-11-29'. {_IN_REPORTS}")
    seed: int = Field(
        ge=0,
        le=LARGEST_SEED,
        description="Seed of all random numbers; the same seed gives the same numbers whatever is computed beside them",
    )
    runs: int = Field(
        ge=1,
        le=MOST_RUNS,
        description="Monte Carlo runs of every case; raise it later and only the new runs are computed",
    )
    block_runs: int | None = Field(
        default=None,
        ge=1,
        description="Runs that are computed together; default: from the cost of the filters, 20 to 40 s a block. "
        "Changes no result",
    )
    stop: StopOptions | None = Field(
        default=None, description="Stop before `runs` once a value is known well enough; default: run them all"
    )
    bound: bool = Field(
        default=True,
        description="Compute the Cramér-Rao bound of each case, which reports show beside the filters; default true: "
        "it costs about as much as a few runs of one filter",
    )
    tune: TuneOptions | None = Field(
        default=None, description="How `relnav tune` searches the filters' free numbers; changes no result"
    )
    requirements: dict[Name, AnyRequirement] = Field(
        default={}, description="What the filters must achieve, by names of your choice; reports judge it"
    )


SECTIONS: dict[str, tuple[Any, str]] = {
    "clock": (Clock, "Length of a run, step, and what is stored"),
    "truth": (TruthSection, "What really happens: the two spacecraft, the forces on them and what varies between runs"),
    "sensors": (dict, "What is measured, and how badly: sensors by names of your choice"),
    "start": (StartOptions, "Where the filters start, all alike; default: at the first fix"),
    "statistics": (StatisticsOptions, "What the values of the report are taken over"),
}
DEFAULTS: dict[str, Options] = {"start": FirstFixStart(), "statistics": StatisticsOptions()}
"""What a section is where the file has none; the other sections must stand."""

FILTERS = "The filters to compare, by names of your choice"
GRID = (
    "Paths with lists of values, or with values by name (`sensors: {dusk: {...}, noon: {...}}`), "
    "which name the cases: a case for every combination"
)
ZIP = "Paths with equally many values, written as in `grid`: a case for each position, all moving together"
STRESS = "Truths that no filter is told of, by names of your choice: paths with values; flown by `relnav run --stress`"

TOP_KEYS = (*Settings.model_fields, *SECTIONS, "filters", "grid", "zip", "stress")


def file_model() -> type[Options]:
    """Return the model of a whole campaign file over everything that is registered now."""
    some = Field(min_length=1)
    lists = dict[str, Annotated[list[Any], some] | Annotated[dict[Name, Any], some]]
    overrides = dict[Name, Annotated[dict[str, Any], Field(min_length=1)]]
    sections: dict[str, Any] = {
        key: (kind, Field(default=DEFAULTS[key], description=words) if key in DEFAULTS else Field(description=words))
        for key, (kind, words) in SECTIONS.items()
    }
    sections["sensors"] = (sensors_type(), Field(description=SECTIONS["sensors"][1]))
    entry: Any = entry_type()
    made = create_model(
        "Campaign",
        __base__=Settings,
        __doc__="A relnav campaign: what is simulated, which filters are compared and what is varied.",
        __module__=__name__,
        **sections,
        filters=(dict[Name, entry], Field(min_length=1, description=FILTERS)),
        grid=(lists, Field(default={}, description=GRID)),
        zip=(lists, Field(default={}, description=ZIP)),
        stress=(overrides, Field(default={}, description=STRESS)),
    )
    return cast(type[Options], made)


def file_schema() -> dict[str, Any]:
    """Return the JSON schema of that model; it is to be read only."""
    return _file_schema(registered())


def file_shape() -> Shape:
    """Return what a campaign file may hold, for messages and documents."""
    return _file_shape(registered())


@functools.cache
def _file_schema(_: Registered) -> dict[str, Any]:
    return file_model().model_json_schema()


@functools.cache
def _file_shape(_: Registered) -> Shape:
    return Shape.of(file_schema())


@functools.cache
def _adapter(section: str) -> TypeAdapter[Any]:
    return TypeAdapter(SECTIONS[section][0])


def _adapter_of(path: Path, data: Any) -> TypeAdapter[Any]:
    kind = str(data.get("kind")) if isinstance(data, dict) else ""
    if path[0] == "filters":
        return entry_adapter(kind)
    if path[0] != "sensors":
        return _adapter(str(path[0]))
    # The model of a known kind is at hand; that of all kinds has to be made, and serves to say what is wrong.
    return TypeAdapter(sensor_kinds()[kind]) if kind in sensor_kinds() else sensor_adapter()


def spelt_now(path: Path, data: Any) -> Any:
    """Return a sensor's or filter's data in the present spelling, a sensor's kind filled in: by default its name."""
    if path[0] == "filters":
        return present_spelling(FilterEntry, data)
    if path[0] != "sensors" or not isinstance(data, dict):
        return data
    kinds = sensor_kinds()
    if "kind" not in data and path[1] in kinds:
        data = {"kind": path[1], **data}
    kind = data.get("kind")
    return present_spelling(kinds.get(kind, Options) if isinstance(kind, str) else Options, data)


def sensors_from(section: Mapping[str, Any]) -> dict[str, SensorOptions]:
    """Return the sensors of a campaign's content, which may be in a former spelling.

    Raises:
        ValidationError: One is not valid any more.
    """
    entries = {name: spelt_now(("sensors", name), entry) for name, entry in section.items() if entry is not None}
    return {name: sensor_adapter().validate_json(json.dumps(entry), strict=True) for name, entry in entries.items()}


class PartValidator:
    """Validates the parts of a file one by one, each once: cases share the parts that they do not vary.

    Args:
        folder: Where the file is; the files that it names are looked for from there. None: the data are no file's,
            but were validated before, with the content of such files filled in.

    Attributes:
        tried: Tries the sensors of all cases.
    """

    def __init__(self, folder: FilePath | None = FilePath()) -> None:
        self._context = {} if folder is None else {"folder": folder}
        self._known: dict[tuple[Path, int], tuple[Any, Options | None, list[Problem]]] = {}
        self._whole: Shape | None = None
        self.tried = TriedSensors()

    def settings(self, data: dict[str, Any]) -> tuple[Settings | None, list[Problem]]:
        """Return the keys that hold for all cases."""
        part = {key: data[key] for key in Settings.model_fields if key in data}
        return self._validated(TypeAdapter(Settings), part, ())  # type: ignore[return-value]  # of the adapter's type

    def part(self, path: Path, data: Any) -> tuple[Options | None, list[Problem]]:
        """Return a section (`("clock",)`), a sensor (`("sensors", name)`) or a filter, or its problems."""
        found = self._known.get((path, id(data)))
        if found is None:
            # The data is kept with the answer, so that its id stays its own.
            spelt = spelt_now(path, data)
            found = (data, *self._validated(_adapter_of(path, spelt), spelt, path))
            self._known[path, id(data)] = found
        return found[1], found[2]

    def _validated(self, adapter: TypeAdapter[Any], data: Any, path: Path) -> tuple[Options | None, list[Problem]]:
        try:
            # Through JSON in strict mode: no "7" as a number, no 1 as a boolean, but lists as tuples.
            return adapter.validate_json(json.dumps(data), strict=True, context=self._context), []
        except ValidationError as error:
            whole = self.whole
            return None, explain(error, data, whole.at(path, {}) or whole, path, whole)

    @property
    def whole(self) -> Shape:
        """What the whole file may hold; made on the first problem."""
        if self._whole is None:
            self._whole = file_shape()
        return self._whole
