"""The filters by name: built in, and those of other packages through the entry-point group ``relnav.filters``."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeVar

import numpy as np
from pydantic import ValidationError

from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.filters.belief import Filter, considered_states
from relnav_sim.filters.read_only import ReadOnlyDynamics, ReadOnlyMeasurement, read_only
from relnav_sim.measurements.interface import Measurement
from relnav_sim.options import Options
from relnav_sim.plugins import load_plugins, no_such_plugin

MeasurementKind = Literal["polar", "cartesian"]
C = TypeVar("C", bound=type)

_BUILT_IN = (
    "kalman",
    "ekf",
    "ukf",
    "alpha_kf",
    "adaptive_alpha_kf",
    "mkf",
    "skf",
    "iekf",
    "ckf",
    "sr_ukf",
    "two_step",
    "adaptive_two_step",
    "particle",
    "unscented_particle",
    "gp_presets",
    "huber",
    "mckf",
    "student_t",
    "gaussian_sum",
    "imm",
)
_KINDS: dict[str, FilterKind] = {}


@dataclass(frozen=True)
class FilterKind:
    """A registered filter.

    Args:
        name: The name that campaigns and `create_filter` use.
        options_model: Its options, a pydantic model.
        factory: ``factory(dynamics, measurement, options) -> Filter``.
        measurement: The form of the radar measurement it takes unless the campaign says otherwise.
        cost_us: Rough CPU time per filter step and run, for planning, us.
        learned_dynamics: Whether campaigns may give it learned dynamics only.
        overhead_us: Rough CPU time per filter step however few the runs, for planning, us.
    """

    name: str
    options_model: type[Options]
    factory: Callable[[Dynamics, Measurement, Any], Filter]
    measurement: MeasurementKind
    cost_us: float
    learned_dynamics: bool = False
    overhead_us: float = 200.0

    @property
    def considers(self) -> bool:
        """Whether it can account for states without estimating them: `considers` of its class."""
        return bool(getattr(self.factory, "considers", False))

    @property
    def description(self) -> str:
        """What the filter is: the docstring of its class."""
        return inspect.getdoc(self.factory) or ""


def register_filter(
    name: str,
    options_model: type[Options],
    measurement: MeasurementKind = "polar",
    cost_us: float = 3.0,
    learned_dynamics: bool = False,
    overhead_us: float = 200.0,
) -> Callable[[C], C]:
    """Return a decorator that registers a filter class under `name`.

    Args:
        name: The name in campaigns.
        options_model: Subclass of `relnav_sim.options.Options`.
        measurement: ``polar`` (range, azimuth, elevation) or ``cartesian`` (converted position).
        cost_us: Rough CPU time per filter step and run, us; only for planning.
        learned_dynamics: Campaigns give it `gp` dynamics by default and may name learned ones only.
        overhead_us: Rough CPU time per filter step however few the runs of a block, us; only for planning.

    Raises:
        ValueError: Another filter has this name.
    """

    def register(factory: C) -> C:
        known = _KINDS.get(name)
        if known is not None and known.factory is not factory:
            raise ValueError(f"a filter named {name!r} is registered already")
        _KINDS[name] = FilterKind(name, options_model, factory, measurement, cost_us, learned_dynamics, overhead_us)
        return factory

    return register


@cache
def _load_all() -> None:
    load_plugins(_KINDS, (f"relnav_sim.filters.{module}" for module in _BUILT_IN), "relnav.filters")


def filter_kinds() -> dict[str, FilterKind]:
    """Return every registered filter by name."""
    _load_all()
    return dict(_KINDS)


def create_filter(name: str, dynamics: Dynamics, measurement: Measurement, **options: Any) -> Filter:
    """Return a filter of the registry.

    Args:
        name: A registered name, ``ekf`` say; `relnav list filters` shows them.
        dynamics: How the state moves.
        measurement: What is measured.
        **options: The filter's options, as in a campaign.

    Raises:
        ValueError: The name is not registered, an option is unknown or out of range, the measurement is for another
            number of states, or the dynamics have considered states and the filter can't do that.
    """
    kinds = filter_kinds()
    if name not in kinds:
        raise ValueError(no_such_plugin("filter", name, kinds))
    kind = kinds[name]
    try:
        # Through JSON, so that lists become tuples as they do in a campaign file.
        checked = kind.options_model.model_validate_json(json.dumps(options, default=_plain))
    except ValidationError as error:
        problems = "; ".join(
            f"{'.'.join(map(str, item['loc'])) or 'options'}: {item['msg']}" for item in error.errors()
        )
        raise ValueError(f"filter {name!r}: {problems}") from None
    if considered_states(dynamics) and not kind.considers:
        raise ValueError(f"filter {name!r} can't account for states without estimating them")
    measured_states = getattr(measurement, "states", None)
    if measured_states not in (None, dynamics.dimension):
        raise ValueError(
            f"the measurement (columns of H) is for {measured_states} states, the dynamics have {dynamics.dimension}"
        )
    motion, sensor = read_only(dynamics, ReadOnlyDynamics), read_only(measurement, ReadOnlyMeasurement)
    return kind.factory(motion, sensor, checked)


def _plain(value: object) -> object:
    """Return a NumPy number or array as plain Python."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise ValueError(f"{value!r} is no number, text, list or section")
