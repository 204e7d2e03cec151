"""A campaign file to a frozen, validated `Campaign`, or to every problem at once."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as FilePath
from typing import Any

from relnav_sim.campaign.blocks import block_size
from relnav_sim.campaign.cases import ValidatedPoint, in_one_spelling, validated_points
from relnav_sim.campaign.expand import BASE_LABEL, read_variables
from relnav_sim.campaign.file_model import SECTIONS, TOP_KEYS, PartValidator, Settings
from relnav_sim.campaign.former import present_path
from relnav_sim.campaign.identity import campaign_hash, case_id, filter_id, stressed_id
from relnav_sim.campaign.loader import MOST_BYTES, load_document, read_text
from relnav_sim.campaign.messages import unknown_key
from relnav_sim.campaign.models import CaseConfig, StopOptions, TuneOptions
from relnav_sim.campaign.overrides import Source, apply_overrides
from relnav_sim.campaign.paths import value_at
from relnav_sim.campaign.problems import SHOWN, CampaignError, Problem, listed, no_such
from relnav_sim.campaign.requirements import AnyRequirement, ErrorsRequirement, NisRequirement
from relnav_sim.campaign.stress import Stress, read_stress, stressed
from relnav_sim.kernels.compiling import interpreted
from relnav_sim.notebook import table_html
from relnav_sim.options import Options
from relnav_sim.same_object import remembered
from relnav_sim.sensors import sensor_kinds
from relnav_sim.wording import counted


@dataclass(frozen=True)
class Case:
    """One point of a campaign's grid.

    Attributes:
        id: Hash of everything that the case's truth, measurements and statistics depend on, and of the filter
            options that the grid varies; filters that are added or removed leave it as it is.
        label: The case's values in words.
        variables: The values of the varied paths, with their defaults filled in.
        config: The validated sections.
        stress: Name of the stress under which it is flown; empty: none.
        nominal: Id of the same case without the stress; empty where there is none.
    """

    id: str
    label: str
    variables: Mapping[str, Any]
    config: CaseConfig
    stress: str = ""
    nominal: str = ""

    @property
    def filter_ids(self) -> dict[str, str]:
        """A hash of the settings of each filter, by its name."""
        return {name: filter_id(entry) for name, entry in self.config.filters.items()}


@dataclass(frozen=True, repr=False)
class Campaign:
    """A validated campaign.

    Attributes:
        name: Its name.
        seed: Seed of all random numbers.
        runs: Runs of every case.
        cases: The points of its grid, in order.
        text: The file as it was read.
        path: Where it was read from, if from a file.
        content: The validated content as plain data in the file's own shape, defaults filled in; a varied value
            stands there as in the first case.
        hash: SHA-256 of the content without what changes no number.
        block_runs: Runs that are computed together.
        stop: When to stop before all runs are computed.
        bound: Whether to compute the Cramér-Rao bound of each case.
        tune: How `relnav tune` searches; None: nothing is said.
        requirements: What the filters must achieve, by name.
        stressed: Its cases under truths that no filter is told of; `with_stress` adds them to the cases.

    Examples:
        >>> from relnav_sim import load_campaign
        >>> campaign = load_campaign("campaigns/demo.yaml", ["runs=5"])
        >>> campaign.name, campaign.runs, len(campaign.cases)
        ('demo', 5, 2)
    """

    name: str
    seed: int
    runs: int
    cases: tuple[Case, ...]
    text: str
    path: FilePath | None
    content: Mapping[str, Any]
    hash: str
    block_runs: int
    stop: StopOptions | None = None
    bound: bool = True
    tune: TuneOptions | None = None
    requirements: Mapping[str, AnyRequirement] = field(default_factory=dict)
    stressed: tuple[Case, ...] = ()

    def __repr__(self) -> str:
        names = dict.fromkeys(name for case in self.cases for name in case.config.filters)
        held = f"{counted(len(self.cases), 'case')}, {counted(len(names), 'filter')}, {counted(self.runs, 'run')}"
        return f"<Campaign {self.name}: {held}>"

    def _repr_html_(self) -> str:
        rows = [
            [str(number), case.label, ", ".join(case.config.filters), f"{case.config.flown.clock.duration_s:g}"]
            for number, case in enumerate(self.cases)
        ]
        return table_html(repr(self).strip("<>"), ["case", "", "filters", "duration, s"], rows)

    def with_stress(self) -> Campaign:
        """Return the campaign with its stressed cases behind the others, as `relnav run --stress` flies it."""
        return replace(self, cases=(*self.nominal_cases, *self.stressed))

    def with_filters(self, names: Sequence[str]) -> Campaign:
        """Return the campaign with these filters only, as `relnav run --filter` flies it; others can be added later.

        Raises:
            ValueError: No case has one of them, a case has none of them, or the rule to stop watches another.
        """
        known = list(dict.fromkeys(name for case in self.cases for name in case.config.filters))
        for name in names:
            if name not in known:
                raise ValueError(no_such("filter", name, known))
        for case in self.cases:
            if not set(names) & set(case.config.filters):
                raise ValueError(f"case {case.label} has no filter {listed(names)}")
        if self.stop is not None and self.stop.filter not in (None, *names):
            raise ValueError(f"the rule to stop watches {self.stop.filter!r}, which must be among the filters")
        kept = tuple(_with_filters(case, names) for case in self.cases)
        under = tuple(_with_filters(case, names) for case in self.stressed)
        return replace(self, cases=kept, stressed=under)

    @property
    def nominal_cases(self) -> tuple[Case, ...]:
        """The cases in which filters are told of what happens."""
        return tuple(case for case in self.cases if not case.stress)


def load_campaign(path: str | os.PathLike[str], overrides: Sequence[str] = ()) -> Campaign:
    """Return the campaign of a file.

    Args:
        path: The YAML file.
        overrides: Changes as ``PATH=VALUE``, each value read like one in the file.

    Raises:
        CampaignError: The file or an override cannot be used; lists every problem.
        OSError: The file cannot be read.

    Examples:
        >>> from relnav_sim import load_campaign
        >>> campaign = load_campaign("campaigns/demo.yaml", ["sensors.radar.range_sigma_m=5"])
        >>> [case.label for case in campaign.cases]
        ['sensors.radar.noise.kind=gaussian', 'sensors.radar.noise.kind=mixture']
    """
    with open(path, "rb") as file:
        content = file.read(MOST_BYTES + 1)
    try:
        text = read_text(content)
    except ValueError as error:
        raise CampaignError([f"{os.fspath(path)}:1: {error}"]) from None
    return parse_campaign(text, overrides, FilePath(path))


def parse_campaign(text: str, overrides: Sequence[str] = (), path: FilePath | None = None) -> Campaign:
    """Return the campaign of a text; see `load_campaign`."""
    return _parsed(text, overrides, path, PartValidator(FilePath() if path is None else path.parent))


def parse_content(content: Mapping[str, Any]) -> Campaign:
    """Return the campaign of a `Campaign.content`, in which stands what was read from the files that it names.

    Raises:
        CampaignError: It can't be used; lists every problem.
    """
    return _parsed(json.dumps(content), (), None, PartValidator(None))


def _parsed(text: str, overrides: Sequence[str], path: FilePath | None, validator: PartValidator) -> Campaign:
    with interpreted():  # models and sensors are tried with a few states
        return _validated(text, overrides, path, validator)


def _validated(text: str, overrides: Sequence[str], path: FilePath | None, validator: PartValidator) -> Campaign:
    document = load_document(text)
    source = Source(str(path or "campaign"), document)
    data, problems = apply_overrides(document.data, overrides, source)
    problems = [*document.problems, *problems]
    if not isinstance(data, dict):
        if not problems:
            what = "the file is empty" if data is None else "the file must hold keys such as 'name:' and 'clock:'"
            problems = [Problem((), f"{what}; `relnav new FILE` writes one to start from")]
        raise _error(problems, source)
    problems += [
        Problem((key,), unknown_key(key, data[key], validator.whole, validator.whole))
        for key in itertools.islice((key for key in data if key not in TOP_KEYS), SHOWN + 1)
    ]
    settings, found = validator.settings(data)
    problems += found
    variables, unvaried = read_variables(data, (*SECTIONS, "filters"))
    problems += unvaried
    stresses, unstressed = read_stress(data)
    problems += unstressed
    problems += source.swept_overrides(variables)
    valid, found = validated_points(data, variables if not unvaried else (), validator)
    problems += found
    # What the loader has refused stands as nothing in the data; the second complaint would only confuse.
    refused = [problem.path for problem in document.problems if problem.path]
    kept = [p for p in problems if p in document.problems or not any(p.path[: len(r)] == r for r in refused)]
    if kept or settings is None:
        raise _error(kept, source)
    valid = in_one_spelling(valid)
    cases = [_case(settings.name, case) for case in valid]
    if repeated := _same_cases(cases):
        raise _error(repeated, source)
    names = list(dict.fromkeys(name for case in cases for name in case.config.filters))
    if settings.stop is not None and settings.stop.filter not in (None, *names):
        raise _error([Problem(("stop", "filter"), no_such("filter", settings.stop.filter or "", names))], source)
    if unmeant := [*_unknown_filters(settings, names), *_too_late(settings, cases)]:
        raise _error(unmeant, source)
    under, found = stressed(stresses, [(v, case.config) for v, case in zip(valid, cases, strict=True)], validator)
    if found:
        raise _error(found, source)
    stressed_cases = tuple(_stressed(cases[number], stress, config) for number, stress, config in under)
    if repeated := _same_cases([*cases, *stressed_cases]):
        raise _error(repeated, source)
    content = _content(settings, valid, cases)
    if stresses:
        content["stress"] = {stress.name: stress.content(config) for number, stress, config in under if number == 0}
    if unknown := _unknown_sensors(settings, content):
        raise _error(unknown, source)
    return Campaign(
        name=settings.name,
        seed=settings.seed,
        runs=settings.runs,
        cases=tuple(cases),
        text=text,
        path=path,
        content=content,
        hash=campaign_hash(content),
        block_runs=settings.block_runs or block_size(settings.runs, [case.config for case in cases]),
        stop=settings.stop,
        bound=settings.bound,
        tune=settings.tune,
        requirements=settings.requirements,
        stressed=stressed_cases,
    )


def located(campaign: Campaign, problem: Problem) -> str:
    """Return a problem that was found after loading as ``file:line: path: sentence``."""
    return Source(str(campaign.path or "campaign"), load_document(campaign.text)).located(problem)[1]


def _error(problems: Sequence[Problem], source: Source) -> CampaignError:
    sentences = sorted({source.located(problem) for problem in problems})
    shown = [text for _, text in sentences[:SHOWN]]
    if len(sentences) > SHOWN:
        shown.append(f"{source.name}:1: and more problems, not listed")
    return CampaignError(shown)


def _case(name: str, valid: ValidatedPoint) -> Case:
    # The parts are valid: to validate them again for each of thousands of cases would take most of the time.
    config = CaseConfig.model_construct(name=name, **vars(valid.parts))
    content = {
        key: {name: _plain(one) for name, one in part.items()} if isinstance(part, Mapping) else _plain(part)
        for key, part in vars(valid.parts).items()
    }
    kinds = sensor_kinds()
    variables = {
        variable.text: value_at(content, present_path(variable.path, content, kinds))
        for variable, _ in valid.point.choices
    }
    return Case(case_id(content, variables), valid.point.label, variables, config)


def _with_filters(case: Case, names: Sequence[str]) -> Case:
    filters = {name: entry for name, entry in case.config.filters.items() if name in names}
    return replace(case, config=case.config.model_copy(update={"filters": filters}))


@remembered
def _plain(part: Options) -> dict[str, Any]:
    """Return a section, sensor or filter as plain data."""
    return part.model_dump(mode="json")


def _stressed(case: Case, stress: Stress, config: CaseConfig) -> Case:
    assert config.untold is not None  # it is a stress
    label = f"stress={stress.name}" if case.label == BASE_LABEL else f"{case.label}, stress={stress.name}"
    own = stressed_id(case.id, config.untold.model_dump(mode="json"))
    return replace(case, id=own, label=label, config=config, stress=stress.name, nominal=case.id)


def _same_cases(cases: Sequence[Case]) -> list[Problem]:
    """Return the cases that differ in spelling only, or not at all."""
    seen: dict[str, int] = {}
    problems = []
    for index, case in enumerate(cases):
        first = seen.setdefault(case.id, index)
        if first != index:
            labels = dict.fromkeys((cases[first].label, case.label))
            which = " and ".join(labels) if len(labels) > 1 else f"{first} and {index}, both {case.label},"
            place = ("stress", case.stress) if case.stress else ()
            problems.append(Problem(place, f"the cases {which} mean the same; keep one"))
    return problems


def _unknown_filters(settings: Settings, filters: Iterable[str]) -> list[Problem]:
    """Return the filters that requirements ask for and the campaign does not have."""
    known = list(filters)
    return [
        Problem(("requirements", name, "filters"), no_such("filter", one, known))
        for name, requirement in settings.requirements.items()
        for one in requirement.filters or ()
        if one not in known
    ]


def _unknown_sensors(settings: Settings, content: Mapping[str, Any]) -> list[Problem]:
    """Return the sensors that requirements ask for and the campaign does not have."""
    known = [name for name, entry in content["sensors"].items() if entry is not None]
    return [
        Problem(("requirements", name, "sensor"), no_such("sensor", requirement.sensor or "", known))
        for name, requirement in settings.requirements.items()
        if isinstance(requirement, NisRequirement) and requirement.sensor not in (None, *known)
    ]


def _too_late(settings: Settings, cases: Sequence[Case]) -> list[Problem]:
    """Return the requirements that look only at what comes after the run, and so could never be decided."""
    end = min(case.config.clock.duration_s for case in cases)
    return [
        Problem(("requirements", name, "from_s"), f"{requirement.from_s:g} s leaves nothing of a run of {end:g} s")
        for name, requirement in settings.requirements.items()
        if isinstance(requirement, ErrorsRequirement) and requirement.from_s >= end
    ]


def _content(settings: Settings, valid: Sequence[ValidatedPoint], cases: Sequence[Case]) -> dict[str, Any]:
    """Return the campaign as plain data in the file's own shape, defaults filled in."""
    content: dict[str, Any] = {**settings.model_dump(mode="json"), "grid": {}, "zip": {}}
    content |= cases[0].config.model_dump(mode="json", exclude={"name"})
    for given, case in zip(valid, cases, strict=True):
        for variable, index in given.point.choices:
            values = content[variable.section].setdefault(variable.text, [None] * len(variable.values))
            values[index] = case.variables[variable.text]
    return content
