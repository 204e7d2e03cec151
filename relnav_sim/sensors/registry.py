"""The sensors by name: built in, and those of other packages through the entry-point group ``relnav.sensors``."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TypeVar

from relnav_sim.plugins import load_plugins
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
    load_plugins(_KINDS, (f"relnav_sim.sensors.{module}" for module in _BUILT_IN), "relnav.sensors")


def sensor_kinds() -> dict[str, type[SensorOptions]]:
    """Return the options model of every registered sensor by its kind."""
    _load_all()
    return dict(_KINDS)
