"""Which numbers of a filter are free: declared beside the options, or named by the user."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import get_args

from pydantic import ValidationError

from relnav_sim.campaign import Campaign
from relnav_sim.campaign.entries import FilterEntry, entry_from
from relnav_sim.campaign.models import TuneObjective
from relnav_sim.campaign.paths import PathError, parse_path, replaced, value_at
from relnav_sim.campaign.problems import Path, dotted, no_such, quoted
from relnav_sim.options import Options, Tunable

DIGITS = 3
"""Significant digits of a tuned value: what is written to the file is exactly what was tried."""

Bounds = tuple[float, float]


class TuningError(ValueError):
    """A campaign that cannot be tuned as asked; the message is a sentence."""


@dataclass(frozen=True)
class Scalar:
    """A free number of a filter.

    Attributes:
        path: Where it stands below the filter's entry.
        low: Least value that is tried.
        high: Greatest.
        log: Searched on a logarithmic scale.
        scales_noise: Acts as a factor on the measurement noise.
        whole: It is a whole number.
    """

    path: Path
    low: float
    high: float
    log: bool
    scales_noise: bool = False
    whole: bool = False

    @property
    def name(self) -> str:
        """The path as people write it."""
        return dotted(self.path)

    @property
    def width(self) -> float:
        """The range in decades, or in units of itself (1) where it is searched linearly."""
        return math.log10(self.high / self.low) if self.log else 1.0

    def value(self, place: float) -> float:
        """Return the value at a place from 0 to 1 of the range, in the digits that a file gets."""
        ratio = self.high / self.low if self.log else 0.0
        value = self.low * ratio**place if self.log else self.low + (self.high - self.low) * place
        value = min(max(float(f"{value:.{DIGITS}g}"), self.low), self.high)
        return round(value) if self.whole else value

    def place(self, value: float) -> float:
        """Return where a value stands in the range, from 0 to 1; the nearer end for one outside."""
        value = min(max(value, self.low), self.high)
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


def alike(scalars: Sequence[Scalar]) -> int:
    """Return how many numbers at the front have the range of the first: the same thing on several axes."""
    first = scalars[0]
    same = [
        (one.low, one.high, one.log, one.whole) == (first.low, first.high, first.log, first.whole) for one in scalars
    ]
    return same.index(False) if False in same else len(same)


def declared(options: Options, path: Path = ()) -> Iterator[Scalar]:
    """Yield the numbers that a filter's entry and the options inside it declare as free, where they are in use."""
    for key, field in type(options).model_fields.items():
        value = getattr(options, key)
        if isinstance(value, Options):
            yield from declared(value, (*path, key))
        elif isinstance(value, tuple):
            for place, inner in enumerate(value):
                if isinstance(inner, Options):
                    yield from declared(inner, (*path, key, place))
        for mark in field.metadata:
            if not isinstance(mark, Tunable) or not isinstance(value, int | float):
                continue
            if mark.when is None or getattr(options, mark.when[0]) == mark.when[1]:
                yield Scalar((*path, key), mark.low, mark.high, mark.log, mark.scales_noise, field.annotation is int)


def marked(model: type[Options], path: Path = ()) -> Iterator[tuple[Path, Tunable]]:
    """Yield the marks of an options model and the sections in it, whatever their values."""
    for key, field in model.model_fields.items():
        for section in (field.annotation, *get_args(field.annotation)):  # an optional one is a union with None
            if isinstance(section, type) and issubclass(section, Options):
                yield from marked(section, (*path, key))
        yield from (((*path, key), mark) for mark in field.metadata if isinstance(mark, Tunable))


def free_scalars(
    campaign: Campaign,
    filters: tuple[str, ...] = (),
    free: Mapping[str, Bounds | None] | None = None,
    objective: TuneObjective = "both",
) -> dict[str, tuple[Scalar, ...]]:
    """Return the free numbers of each filter, the widest range first.

    Args:
        campaign: The campaign.
        filters: Filters to tune; none given: all of them that have a free number.
        free: Paths such as ``filters.ekf.alpha`` with the range to search, None for the declared one. A filter with
            such paths has these free and no others; those of filters that are not
            to be tuned are checked and left out.
        objective: What is made small.

    Raises:
        TuningError: A filter or a path is not there, or cannot be tuned.
    """
    entries = campaign.cases[0].config.filters
    for name in filters:
        if name not in entries:
            raise TuningError(no_such("filter", name, entries))
    named: dict[str, list[Scalar]] = {}
    for text, bounds in (free or {}).items():
        filter, scalar = _named(text, bounds, campaign)
        named.setdefault(filter, []).append(scalar)
    varied = _varied_paths(campaign)
    found = {}
    for name, entry in entries.items():
        if filters and name not in filters:
            continue
        scalars = named.get(name) or [
            scalar for scalar in _of_use(entry, objective) if not _overlaps(("filters", name, *scalar.path), varied)
        ]
        if scalars:
            found[name] = tuple(sorted(scalars, key=lambda scalar: -scalar.width))
            _check_ends(name, entry, found[name])
        elif name in filters:
            raise TuningError(
                f"the filter {quoted(name)} has no free number: the campaign varies it, or its process noise is a "
                "matrix; name one with --free PATH=LOW:HIGH"
            )
    if not found:
        raise TuningError("no filter of this campaign has a free number; name one with --free PATH=LOW:HIGH")
    return found


def with_values(entry: FilterEntry, values: Mapping[Path, float]) -> FilterEntry:
    """Return a filter's entry with other numbers.

    Raises:
        ValidationError: The entry does not take them.
    """
    data = entry.model_dump(mode="json")
    for path, value in values.items():
        whole = isinstance(value_at(data, path), int)
        data = replaced(data, path, round(value) if whole else value)
    return entry_from(data)


def value_of(entry: FilterEntry, path: Path) -> float | None:
    """Return the number at a path of a filter's entry; None where there is none."""
    value = value_at(entry.model_dump(mode="json"), path)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _of_use(entry: FilterEntry, objective: TuneObjective) -> Iterator[Scalar]:
    """Yield the declared numbers but those that would only waste candidates."""
    counts_covariance = objective in ("consistency", "both", "in_band")
    for scalar in declared(entry):
        if not entry.dynamics.uses_process_noise and scalar.path[0] == "process_noise":
            continue
        if counts_covariance or not scalar.scales_noise:
            yield scalar


def _named(text: str, bounds: Bounds | None, campaign: Campaign) -> tuple[str, Scalar]:
    """Return the filter and the number that a user's path means."""
    try:
        path = parse_path(text, campaign.content)
    except PathError as error:
        raise TuningError(str(error)) from None
    entries = campaign.cases[0].config.filters
    if len(path) > 2 and path[0] == "filters" and path[1] not in entries:
        raise TuningError(no_such("filter", str(path[1]), entries))
    if len(path) < 3 or path[0] != "filters":
        raise TuningError(f"{quoted(text)} is no number of a filter; write it as filters.NAME.alpha")
    if _overlaps(path, _varied_paths(campaign)):
        raise TuningError(f"{text} is varied by the campaign's grid; it cannot be tuned as well")
    name, inner = str(path[1]), path[2:]
    entry = entries[name]
    if value_of(entry, inner) is None:
        raise TuningError(f"{text} is no number of this campaign; `relnav show filter {entry.kind}` shows its options")
    known = {scalar.path: scalar for scalar in declared(entry)}.get(inner)
    if bounds is None:
        if known is None:
            raise TuningError(f"{text} has no range of its own; give one as {text}=LOW:HIGH")
        return name, known
    low, high = bounds
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise TuningError(f"the range {low:g} to {high:g} of {text} is empty; its first number must be the smaller")
    log = low > 0 and (known is None or known.log)
    return name, replace(known or Scalar(inner, low, high, log), low=low, high=high, log=log)


def _check_ends(name: str, entry: FilterEntry, scalars: tuple[Scalar, ...]) -> None:
    for scalar in scalars:
        for end in (scalar.low, scalar.high):
            try:
                with_values(entry, {scalar.path: end})
            except ValidationError as error:
                why = error.errors()[0]["msg"]
                place = dotted(("filters", name, *scalar.path))
                raise TuningError(f"{place} does not take {end:g}: {why[:1].lower()}{why[1:]}") from None


def _varied_paths(campaign: Campaign) -> list[Path]:
    return [parse_path(text, campaign.content) for text in campaign.cases[0].variables]


def _overlaps(path: Path, others: list[Path]) -> bool:
    return any(path[: len(other)] == other or other[: len(path)] == path for other in others)
