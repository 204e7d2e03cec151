"""A user's function gets read-only arguments, so that one that writes into them is refused instead of believed."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from relnav_sim.arrays import Array


def called_read_only(function: Callable[[Array, Any], Any], name: str, states: Array, at: Any) -> Any:
    """Return ``function(states, at)``, the states given as a view that cannot be written to.

    Args:
        function: The user's function.
        name: What to call it in a message.
        states: Its argument; no copy is made.
        at: The epoch or step.

    Raises:
        ValueError: It writes into its argument.
    """
    view = states.view()
    view.flags.writeable = False
    try:
        return function(view, at)
    except ValueError as problem:
        if not re.search("read-?only", str(problem)):
            raise
        raise ValueError(
            f"{name} writes into its argument, which the filter goes on using; work on a copy: states = states.copy()"
        ) from problem
