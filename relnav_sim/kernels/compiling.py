"""How a function becomes a kernel: for which types it is compiled, and by which rules of arithmetic."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba import types

Function = TypeVar("Function", bound=Callable[..., Any])

number = types.float64
integer = types.int64
flag = types.boolean


def given(axes: int, of: Any = types.float64) -> Any:
    """Return the type of an argument that is read: an array in C order, whether it may be written to or not."""
    return types.Array(of, axes, "C", readonly=True)


def written(axes: int, of: Any = types.float64) -> Any:
    """Return the type of an argument that is written to, an array in C order."""
    return types.Array(of, axes, "C")


def kernel(*arguments: Any) -> Callable[[Function], Function]:
    """Let a function be compiled, at its first call, for arguments of these types and no others.

    The machine code is kept on disk. A division by zero gives inf or NaN, as in NumPy. Sums are taken in the order that
    is written, and no product is fused with a sum: the bits are those of the loops as they stand, on every machine.
    """
    return lambda function: _Uncompiled(function, arguments)  # type: ignore[return-value]  # it is called as one


class _Uncompiled:
    """A kernel before its first call, which puts what is compiled in its place in the module."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._function, self._arguments = function, arguments

    def __call__(self, *arguments: Any) -> Any:
        compiled = numba.njit(self._arguments, cache=True, error_model="numpy")(self._function)
        setattr(sys.modules[self._function.__module__], self._function.__name__, compiled)
        return compiled(*arguments)


def inner(function: Function) -> Function:
    """Compile a function that kernels call, as a part of each of them; a kernel itself is not called by others."""
    return numba.njit(error_model="numpy")(function)  # type: ignore[return-value]  # a kernel calls it as one


def inlined(function: Function) -> Function:
    """Compile a function of single numbers as `inner` does, but into the loop that calls it, which then vectorises."""
    return numba.njit(error_model="numpy", forceinline=True)(function)  # type: ignore[return-value]  # as above
