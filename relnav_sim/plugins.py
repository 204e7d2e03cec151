"""Plug-ins found: the modules of relnav that register some, and the packages that do so through an entry point."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Any

from relnav_sim.containment import Containment
from relnav_sim.near_names import nearest
from relnav_sim.printable import message_of


def load_plugins(kinds: dict[str, Any], modules: Iterable[str], group: str) -> None:
    """Import what registers plug-ins of one sort.

    A package that can't be imported is left out with a warning, and with it all that it has registered before.

    Args:
        kinds: Where they register themselves, by name.
        modules: Names of relnav's own modules.
        group: The entry-point group of other packages, ``relnav.filters`` say.
    """
    for module in modules:
        importlib.import_module(module)
    for entry in entry_points(group=group):
        before = dict(kinds)
        # Importing a package runs its code, which may raise anything; it must not take all other plug-ins with it.
        with Containment() as contained:
            entry.load()
        if contained.error is not None:
            kinds.clear()
            kinds.update(before)
            package, problem = entry.dist.name if entry.dist else entry.value, message_of(contained.error)
            sort = group.partition(".")[2]
            warnings.warn(f"the {sort} of {package} are left out; importing {entry.value}: {problem}", stacklevel=3)


def no_such_plugin(sort: str, name: str, known: Iterable[str]) -> str:
    """Return the sentence that refuses a name that isn't registered."""
    names = sorted(known)
    near = nearest(name, names)
    return f"no {sort} is named {name!r}; " + (f"did you mean {near!r}?" if near else f"there are {', '.join(names)}")
