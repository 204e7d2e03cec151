"""The sensors by name: built in, and those of other packages through the entry-point group ``relnav.sensors``."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from functools import cache
from importlib.metadata import entry_points
from typing import TypeVar

from relnav_sim.containment import Containment
from relnav_sim.printable import message_of
from relnav_sim.sensors.interface import SensorOptions

_BUILT_IN = ("radar", "camera", "lidar", "crosslink", "gnss", "star_tracker", "accelerometer")
_KINDS: dict[str, type[SensorOptions]] = {}
C = TypeVar("C", bound=type[SensorOptions])


def register_sensor(name: str) -> Callable[[C], C]:
    """Return a decorator that registers a sensor's options model under `name`.

    Args:
        name: The kind in campaigns.

    Raises:
        ValueError: Another sensor has this name, or the model is no subclass of `SensorOptions`.
    """

    def register(options: C) -> C:
        if not (isinstance(options, type) and issubclass(options, SensorOptions)):
            raise ValueError(f"sensor {name!r}: {options!r} must be a subclass of relnav_sim.sensors.SensorOptions")
        known = _KINDS.get(name)
        if known is not None and known is not options:
            raise ValueError(f"a sensor named {name!r} is registered already")
        _KINDS[name] = options
        return options

    return register


@cache
def _load_all() -> None:
    for module in _BUILT_IN:
        importlib.import_module(f"relnav_sim.sensors.{module}")
    for entry in entry_points(group="relnav.sensors"):
        before = dict(_KINDS)
        # Importing a package runs its code, which may raise anything; it must not take all other sensors with it.
        with Containment() as contained:
            entry.load()
        if contained.error is not None:
            _KINDS.clear()
            _KINDS.update(before)
            package, problem = entry.dist.name if entry.dist else entry.value, message_of(contained.error)
            warnings.warn(f"the sensors of {package} are left out; importing {entry.value}: {problem}", stacklevel=2)


def sensor_kinds() -> dict[str, type[SensorOptions]]:
    """Return the options model of every registered sensor by its kind."""
    _load_all()
    return dict(_KINDS)
