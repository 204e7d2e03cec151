"""Remembering what a function returned of an object, told by its identity.

Cases of a campaign share the parts that they do not vary. These parts are frozen, but not all can be hashed, and to
compare them costs more than most of what is asked of them.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable
from typing import Any, ParamSpec, TypeVar

MOST_REMEMBERED = 4096

P = ParamSpec("P")
T = TypeVar("T")


class _Same:
    """An object that equals itself alone; while it is remembered, nothing else has its identity."""

    __slots__ = ("it",)

    def __init__(self, it: Any) -> None:
        self.it = it

    def __hash__(self) -> int:
        return id(self.it)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.it is other.it


def remembered(function: Callable[P, T]) -> Callable[P, T]:
    """Return the function, called once for each object that is its first argument, as long as it is remembered.

    Args:
        function: Takes an object that nobody changes, and arguments that can be hashed.
    """

    @functools.lru_cache(maxsize=MOST_REMEMBERED)
    def known(same: _Same, *others: Hashable) -> T:
        return function(same.it, *others)  # type: ignore[call-arg, arg-type]

    @functools.wraps(function)
    def called(*arguments: P.args, **_: P.kwargs) -> T:
        first, *others = arguments
        return known(_Same(first), *others)

    return called
