"""What campaigns can name, with descriptions and options, for `relnav list` and `relnav show`."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass

from relnav_sim.campaign.file_model import file_shape
from relnav_sim.campaign.reference import Key, keys_of, kinds_at, shape_at
from relnav_sim.campaign.shape import Shape
from relnav_sim.dynamics.registry import dynamics_kinds
from relnav_sim.filters.operations import Size
from relnav_sim.filters.registry import FilterKind, filter_kinds
from relnav_sim.options import Options
from relnav_sim.sensors.noise import noise_kinds
from relnav_sim.wording import with_prefix

_DYNAMICS = "filters.*.kind=ekf.dynamics"
_NOISE = "sensors.radar.noise"


@dataclass(frozen=True)
class Entry:
    """Something that a campaign can name.

    Attributes:
        name: The name.
        description: Its docstring: what it is, its source, when to use it.
        keys: Its options.
        cost: Of a filter, the operations and bytes of an epoch; empty where it states none.
    """

    name: str
    description: str
    keys: tuple[Key, ...]
    cost: tuple[str, ...] = ()

    @property
    def summary(self) -> str:
        """The first sentence or line of the description."""
        return " ".join(self.description.partition("\n\n")[0].split())


def entries(what: str) -> list[Entry]:
    """Return everything of a kind: ``filter``, ``sensor``, ``dynamics`` or ``noise``, singular or plural."""
    whole = file_shape()
    match what.removesuffix("s"):
        case "filter":
            forms = kinds_at("filters.*", whole)
            return [
                Entry(name, kind.description, keys_of(forms[name]), stated_cost(kind))
                for name, kind in filter_kinds().items()
            ]
        case "sensor":
            sensors = shape_at("sensors", whole).keys
            return [_section_entry(name, f"sensors.{name}", whole) for name in sensors]
        case "noise":
            return _kind_entries(noise_kinds(), kinds_at(_NOISE, whole))
        case _:
            return _kind_entries(dynamics_kinds(), kinds_at(_DYNAMICS, whole))


COST_SIZE = Size(n=6, m=3)
"""Position and velocity, and a radar's channels: what filters are listed for."""


def stated_cost(kind: FilterKind) -> tuple[str, ...]:
    """Return the operations and bytes of an epoch by a filter's formula, with its default options."""
    if kind.operations is None:
        return ("not stated", "not stated")
    found = kind.operations(COST_SIZE, kind.options_model())
    return with_prefix(found.count), with_prefix(found.bytes, "B")


def _kind_entries(models: Mapping[str, type[Options]], forms: Mapping[str, Shape]) -> list[Entry]:
    return [
        Entry(name, inspect.getdoc(model) or "", keys_of(forms[name]))
        for name, model in models.items()
        if name in forms
    ]


def _section_entry(name: str, place: str, whole: Shape) -> Entry:
    shape = shape_at(place, whole)
    return Entry(name, shape.description, keys_of(shape))
