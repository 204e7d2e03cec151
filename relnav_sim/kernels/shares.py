"""Kernels shared out between two processes that compile them at once.

A process compiles only once what several kernels call. So those that have much in common go together, as far as both
processes are to end at the same time.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from types import FunctionType
from typing import Any

from relnav_sim.kernels.compiling import PARTS, Instruction, Uncompiled, names_in

OPTIMISING = 0.7
"""What it costs to optimise a function within a kernel, in terms of what it costs to read it, once in a process."""

_Sizes = Mapping[Callable[..., Any], int]


def shares(names: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the kernels, given as `theme.function`, that each of two processes is to compile.

    The first one gets the largest kernel and then, until it has half of all there is to do, whichever has most in
    common with what it has, and least with the rest. The length of its bytecode stands for what a function costs.

    Examples:
        >>> shares(["kalman.update", "orbits.fly", "kalman.predict", "epochs.filtered"])
        (['epochs.filtered', 'kalman.predict'], ['orbits.fly', 'kalman.update'])
    """
    sizes = {name: _with_its_parts(name) for name in names}
    rest = sorted(names, key=lambda name: sum(sizes[name].values()), reverse=True)
    first = rest[:1]
    del rest[:1]
    while rest and _cost(first, sizes) < _cost(rest, sizes):
        closest = max(rest, key=lambda name: _in_common(name, first, sizes) - _in_common(name, rest, sizes))
        first.append(closest)
        rest.remove(closest)
    return first, rest


def _cost(names: Sequence[str], sizes: Mapping[str, _Sizes]) -> float:
    read: dict[Callable[..., Any], int] = {}
    for name in names:
        read |= sizes[name]
    return sum(read.values()) + OPTIMISING * sum(sum(sizes[name].values()) for name in names)


def _in_common(name: str, others: Sequence[str], sizes: Mapping[str, _Sizes]) -> float:
    """Return how much of a kernel is in any of the others too."""
    found = {part for other in others if other != name for part in sizes[other]}
    return sum(size for part, size in sizes[name].items() if part in found) / max(sum(sizes[name].values()), 1)


def _with_its_parts(name: str) -> _Sizes:
    """Return the length of the bytecode of a kernel's function and of all that it calls, and those call."""
    theme, _, function = name.partition(".")
    kernel = getattr(importlib.import_module(f"relnav_sim.kernels.{theme}"), function)
    found: dict[Callable[..., Any], int] = {}
    left = [kernel.function] if isinstance(kernel, Uncompiled) else []
    while left:
        one = left.pop()
        if one not in found:
            found[one] = len(one.__code__.co_code)
            left += [each for each in names_in(one).values() if _is_part(each)]
    return found


def _is_part(value: Any) -> bool:
    return isinstance(value, FunctionType) and value in PARTS and not isinstance(PARTS[value], Instruction)
