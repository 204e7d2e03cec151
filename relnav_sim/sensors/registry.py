"""The sensors by name: built in, and those of other packages through the entry-point group ``relnav.sensors``."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TypeVar, get_args, overload

from relnav_sim.plugins import load_plugins
from relnav_sim.sensors.interface import RelativeSensorOptions, SensorOptions

_BUILT_IN = ("radar", "camera", "lidar", "crosslink", "relative_gnss", "gnss", "star_tracker", "accelerometer")
_KINDS: dict[str, type[SensorOptions]] = {}
O = TypeVar("O", bound=type[SensorOptions])  # noqa: E741


@overload
def register_sensor(name: str) -> Callable[[O], O]: ...
@overload
def register_sensor(name: str, options_model: O) -> O: ...
def register_sensor(name: str, options_model: O | None = None) -> O | Callable[[O], O]:
    """Register a sensor under `name`, so that campaigns can have it.

    As a call, ``register_sensor("doppler", DopplerOptions)``, or as a decorator of the options,
    ``@register_sensor("doppler")``. Packages do so in a module that is an entry point of the group ``relnav.sensors``.

    Args:
        name: The kind in campaigns.
        options_model: Subclass of `relnav_sim.sensors.SensorOptions`, mostly of `RelativeSensorOptions`: a key
            ``kind: Literal[name] = name``, the options, `channels`, `sigmas`, `sample` and `measurement`; its docstring
            is what ``relnav show sensor`` prints.

    Returns:
        The options model, or the decorator where only the name is given.

    Raises:
        ValueError: Another sensor has this name, or `kind` is another.
        TypeError: It is no `SensorOptions`.

    Examples:
        >>> from relnav_sim import register_sensor
        >>> from relnav_sim.sensors import sensor_kinds
        >>> options_model = sensor_kinds()["radar"]
        >>> register_sensor("radar", options_model) is options_model
        True
    """

    def register(model: O) -> O:
        _check(name, model)
        known = _KINDS.get(name)
        if known is not None and known is not model:
            raise ValueError(f"a sensor named {name!r} is registered already")
        _KINDS[name] = model
        return model

    return register if options_model is None else register(options_model)


def _check(name: str, model: type[SensorOptions]) -> None:
    if not (isinstance(model, type) and issubclass(model, SensorOptions)):
        raise TypeError(f"the options of sensor {name!r} are no subclass of SensorOptions: {model!r}")
    field = model.model_fields["kind"]
    if get_args(field.annotation) != (name,) or field.default != name:
        raise ValueError(f'{model.__name__} is registered as {name!r}; give it kind: Literal["{name}"] = "{name}"')
    for missing in ("role", "channels"):
        if not hasattr(model, missing):
            raise ValueError(f"{model.__name__} has no {missing}; see relnav_sim.sensors.SensorOptions")
    if model.role == "other" and not issubclass(model, RelativeSensorOptions):
        raise ValueError(f"{model.__name__} measures the other craft; derive it from RelativeSensorOptions")


@cache
def _load_all() -> None:
    load_plugins(_KINDS, (f"relnav_sim.sensors.{module}" for module in _BUILT_IN), "relnav.sensors")


def sensor_kinds() -> dict[str, type[SensorOptions]]:
    """Return the options model of every registered sensor by its kind; relnav's own come first."""
    _load_all()
    return {name: _KINDS[name] for name in _BUILT_IN} | _KINDS
