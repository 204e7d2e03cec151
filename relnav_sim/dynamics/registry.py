"""The relative dynamics that a campaign can name: built in, and those of other packages (``relnav.dynamics``)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import TypeVar, get_args, overload

from relnav_sim.dynamics.context import METHODS, NEEDS, PROMISED, DynamicsContext
from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.dynamics.options import DynamicsOptions
from relnav_sim.near_names import nearest
from relnav_sim.plugins import load_plugins

STATES = 6
"""Position and velocity: what the dynamics of a campaign move."""
_BUILT_IN = {
    "cw": "clohessy_wiltshire",
    "cw_second_order": "quadratic",
    "yamanaka_ankersen": "elliptic",
    "schweighart_sedwick": "averaged_j2",
    "nonlinear": "two_body",
    "nonlinear_j2": "two_body_j2",
    "nonlinear_field": "two_body_field",
    "gp": "gp.options",
}
"""Kinds of relnav's own, in the order in which they are listed, and their modules."""
_KINDS: dict[str, type[DynamicsOptions]] = {}
O = TypeVar("O", bound=type[DynamicsOptions])  # noqa: E741


@overload
def register_dynamics(name: str) -> Callable[[O], O]: ...
@overload
def register_dynamics(name: str, options_model: O) -> O: ...
def register_dynamics(name: str, options_model: O | None = None) -> O | Callable[[O], O]:
    """Register relative dynamics under `name`, so that campaigns can give them to filters.

    As a call, ``register_dynamics("drifting", DriftingOptions)``, or as a decorator of the options,
    ``@register_dynamics("drifting")``. Packages do so in a module that is an entry point of the group
    ``relnav.dynamics``.

    Args:
        name: The name in campaigns.
        options_model: Subclass of `relnav_sim.dynamics.options.DynamicsOptions`: a key ``kind: Literal[name] = name``,
            the options, and ``build(context)``, which returns the dynamics; its docstring is what
            ``relnav show dynamics`` prints.

    Returns:
        The options model, or the decorator where only the name is given.

    Raises:
        ValueError: Other dynamics have this name, `kind` is another, or `needs` has a word that doesn't exist.
        TypeError: It is no `DynamicsOptions`.

    Examples:
        >>> from relnav_sim import register_dynamics
        >>> from relnav_sim.dynamics.registry import dynamics_kinds
        >>> options_model = dynamics_kinds()["cw"]
        >>> register_dynamics("cw", options_model) is options_model
        True
    """

    def register(model: O) -> O:
        _check(name, model)
        known = _KINDS.get(name)
        if known is not None and known is not model:
            raise ValueError(f"dynamics named {name!r} are registered already")
        _KINDS[name] = model
        return model

    return register if options_model is None else register(options_model)


def _check(name: str, model: type[DynamicsOptions]) -> None:
    if not (isinstance(model, type) and issubclass(model, DynamicsOptions)):
        raise TypeError(f"the options of dynamics {name!r} are no subclass of DynamicsOptions: {model!r}")
    field = model.model_fields["kind"]
    if get_args(field.annotation) != (name,) or field.default != name:
        raise ValueError(f'{model.__name__} is registered as {name!r}; give it kind: Literal["{name}"] = "{name}"')
    for word in sorted(set(model.needs) - set(NEEDS)):
        near = nearest(word, NEEDS)
        hint = f"; did you mean {near!r}?" if near else ""
        raise ValueError(f"dynamics {name!r} need {word!r}, which doesn't exist; there are {', '.join(NEEDS)}{hint}")


@cache
def _load_all() -> None:
    load_plugins(_KINDS, (f"relnav_sim.dynamics.{module}" for module in _BUILT_IN.values()), "relnav.dynamics")


def dynamics_kinds() -> dict[str, type[DynamicsOptions]]:
    """Return the options model of every registered dynamics by its name; relnav's own come first."""
    _load_all()
    return {name: _KINDS[name] for name in _BUILT_IN} | _KINDS


def build_dynamics(options: DynamicsOptions, context: DynamicsContext) -> Dynamics:
    """Return the dynamics of a campaign's options.

    Raises:
        TypeError: What `build` returns lacks something that dynamics with these needs must have.
        ValueError: They are for another number of states.
    """
    dynamics = options.build(context)
    wanted = dict.fromkeys(
        ["dimension", "linear", *METHODS, *(m for n in NEEDS if n in options.needs for m in PROMISED.get(n, ()))]
    )
    if missing := [name for name in wanted if not hasattr(dynamics, name)]:
        raise TypeError(
            f"build of dynamics {options.kind!r} returned {type(dynamics).__name__}, which lacks {', '.join(missing)}; "
            f"it must have {', '.join(wanted)}"
        )
    if dynamics.dimension != STATES:
        raise ValueError(
            f"build of dynamics {options.kind!r} returned dynamics of {dynamics.dimension} states; it must be {STATES}"
        )
    return dynamics
