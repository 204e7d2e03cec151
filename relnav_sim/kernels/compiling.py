"""How a function becomes a kernel: for which types it is compiled and by which rules of arithmetic.

The modules of kernels hold plain Python functions until one of them is to be compiled. Only then is numba imported,
and a function given to it sees, in place of the plain functions that it calls, those that numba compiles.
"""

from __future__ import annotations

import gc
import importlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple, TypeVar

import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])

Kind = Callable[[Any], Any]
"""The type of an argument, from the module `numba.types`."""


def number(types: Any) -> Any:
    """Return the type of a number."""
    return types.float64


def single(types: Any) -> Any:
    """Return the type of a number in single precision."""
    return types.float32


def integer(types: Any) -> Any:
    """Return the type of an integer."""
    return types.int64


def count(types: Any) -> Any:
    """Return the type of numbers that are counted up in large tables."""
    return types.int32


def flag(types: Any) -> Any:
    """Return the type of a truth value."""
    return types.boolean


def given(axes: int, of: Kind = number) -> Kind:
    """Return the type of an argument that is read: an array in C order, whether it may be written to or not."""
    return lambda types: types.Array(of(types), axes, "C", readonly=True)


def written(axes: int, of: Kind = number) -> Kind:
    """Return the type of an argument that is written to, an array in C order."""
    return lambda types: types.Array(of(types), axes, "C")


def record(named_tuple: type, *kinds: Kind) -> Kind:
    """Return the type of a named tuple whose fields are of these types."""

    def of(types: Any) -> Any:
        fields = [kind(types) for kind in kinds]
        if all(field == fields[0] for field in fields):  # numba tells these apart
            return types.NamedUniTuple(fields[0], len(fields), named_tuple)
        return types.NamedTuple(fields, named_tuple)

    return of


def kernel(*arguments: Kind, wide: bool = False) -> Callable[[Function], Function]:
    """Let a function be compiled, at its first call, for arguments of these types and no others.

    The machine code is kept on disk. A division by zero gives inf or NaN, as in NumPy. Sums are taken in the order that
    is written, and no product is fused with a sum: the bits are those of the loops as they stand, on every machine.

    Args:
        arguments: Their types.
        wide: Whether the processor's widest registers pay: in long loops that hardly wait for memory. Bits are alike.
    """
    return lambda function: Uncompiled(function, arguments, wide)  # type: ignore[return-value]  # it is called as one


def kernel_like(
    other: Callable[..., Any], *arguments: Kind, wide: bool | None = None, **names: Any
) -> Callable[[Function], Function]:
    """Let a function be a kernel that does what another one of its module does, with some names standing for others.

    Two kernels are written once so, and each compiles only what it needs. (A function can't be passed to one that is
    compiled: its address would be part of the code that is kept.)

    Args:
        other: The other kernel.
        arguments: Types, as for `kernel`.
        wide: As for `kernel`; None: as the other kernel is.
        names: What names stand for in that kernel, not in the functions that it calls.
    """

    def made(function: Function) -> Function:
        assert isinstance(other, Uncompiled) and isinstance(function, FunctionType)
        copy = FunctionType(other.function.__code__, function.__globals__, function.__name__)
        _STAND_FOR[copy] = names
        return Uncompiled(copy, arguments, other.wide if wide is None else wide)  # type: ignore[return-value]  # it is called as one

    return made


_STAND_FOR: dict[Callable[..., Any], dict[str, Any]] = {}


class Uncompiled:
    """A kernel before its first call, which puts what is compiled in its place in the module."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Kind, ...], wide: bool) -> None:
        self.function, self.arguments, self.wide = function, arguments, wide

    def __call__(self, *arguments: Any) -> Any:
        """Compile it, and call what is compiled; or run it as it stands where kernels are `interpreted`."""
        if _called is not None:
            _called[_name_of(self.function)] = None
            with suppress(ArithmeticError, ValueError), np.errstate(all="ignore"):
                return _interpreted(self.function)(*arguments)
            # Python gives up where compiled code goes on with NaN or inf.
        global _loading_cpu_s
        before = time.process_time()
        kernel = self.compiled()
        _loading_cpu_s += time.process_time() - before
        return kernel(*arguments)

    def compiled(self) -> Callable[..., Any]:
        """Return what is compiled, from the folder of compiled code where it is kept already.

        Raises:
            CompilerError: What compiles can't be imported.
        """
        from relnav_sim.kernels.compiler import compiled

        module, name = sys.modules[self.function.__module__], self.function.__name__
        if vars(module)[name] is self:
            setattr(module, name, compiled(self.function, self.arguments, self.wide))
        function: Callable[..., Any] = vars(module)[name]
        return function


_called: dict[str, None] | None = None
_loading_cpu_s = 0.0


def working_cpu_s() -> float:
    """Return the processor time of this process, s, without that in which kernels were loaded or compiled.

    The first of several filters would else be said to cost what all of them have need of.
    """
    return time.process_time() - _loading_cpu_s


@contextmanager
def interpreted() -> Iterator[dict[str, None]]:
    """Within this, let kernels that are not compiled yet in this process run as plain Python, with a single lane.

    That is for a few numbers, at which it is faster than to load what compiles. Last digits may differ, as products
    and sums are not fused. The keys of what it yields are the kernels that have been called so, as `theme.function`, in
    the order of their first calls.
    """
    global _called
    before = _called
    _called = {} if before is None else before
    try:
        yield _called
    finally:
        _called = before


def _name_of(function: Callable[..., Any]) -> str:
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


@cache
def _interpreted(function: Callable[..., Any]) -> FunctionType:
    return in_terms_of(_SHORT.get(function, function), _as_interpreted)


def _as_interpreted(name: str, value: Any) -> Any:
    if name == "LANES":
        return 1
    return _interpreted(value) if isinstance(value, FunctionType) and value in PARTS else value


_Seen = Callable[[str, Any], Any]
_modules: dict[tuple[str, _Seen, tuple[Any, ...]], dict[str, Any]] = {}


def in_terms_of(function: Callable[..., Any], seen: _Seen) -> FunctionType:
    """Return a copy of a function of this package, to which the names of its module stand for what `seen` says.

    Args:
        function: The function.
        seen: From a name and its value to another value; always the same one.
    """
    assert isinstance(function, FunctionType)
    module, others = function.__module__, _STAND_FOR.get(function, {})
    key = module, seen, tuple(others.items())
    if key not in _modules:
        names = _modules[key] = {**vars(sys.modules[module]), **others}
        for name, value in names.items():  # functions refer to one another by what is being filled here
            names[name] = seen(name, value)
    copy = FunctionType(function.__code__, _modules[key], function.__name__, function.__defaults__)
    copy.__qualname__ = function.__qualname__
    return copy


def names_in(function: Callable[..., Any]) -> dict[str, Any]:
    """Return what the global names that a function of kernels uses stand for, where they are known."""
    names = {**function.__globals__, **_STAND_FOR.get(function, {})}
    return {name: names[name] for name in function.__code__.co_names if name in names}


@contextmanager
def no_search_for_garbage() -> Iterator[None]:
    """Spare the tenth of the time of compiling or importing in which Python goes through objects that are in use."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def compile_kernel(name: str) -> float:
    """Compile a kernel, given as `theme.function`, without calling it; return the seconds of processor time it took."""
    theme, _, function = name.partition(".")
    kernel = getattr(importlib.import_module(f"relnav_sim.kernels.{theme}"), function)
    before = time.process_time()
    if isinstance(kernel, Uncompiled):
        kernel.compiled()
    return time.process_time() - before


def compile_kernels(names: Sequence[str]) -> list[float]:
    """Compile kernels as `compile_kernel` does, in this order; what they have in common is compiled once.

    For a process of its own: what it leaves in memory is searched for garbage once, and never again.
    """
    with no_search_for_garbage():
        took = [compile_kernel(name) for name in names]
        gc.collect()
        gc.freeze()
    return took


def inner(function: Function) -> Function:
    """Compile a function that kernels call, as a part of each of them; a kernel itself is not called by others."""
    PARTS[function] = {}
    return function


def inlined(function: Function) -> Function:
    """Compile a function of single numbers as `inner` does, but into the loop that calls it, which then vectorises."""
    PARTS[function] = {"forceinline": True}
    return function


def short_for(function: Callable[..., Any]) -> Callable[[Function], Function]:
    """Let a function in a few words of NumPy stand for one of loops where kernels are `interpreted`."""

    def noted(short: Function) -> Function:
        _SHORT[function] = short
        return short

    return noted


_SHORT: dict[Callable[..., Any], Callable[..., Any]] = {}


def instruction(code: Callable[..., Any], result: Kind, *arguments: Kind) -> Callable[[Function], Function]:
    """Let a function be an instruction of the processor where it is compiled.

    Args:
        code: Takes LLVM's builder and the values, and returns the result.
        result: Its type.
        arguments: Types of the values.
    """

    def noted(function: Function) -> Function:
        PARTS[function] = Instruction(code, result, arguments)
        return function

    return noted


class Instruction(NamedTuple):
    """How a function is compiled that is an instruction of the processor; see `instruction`."""

    code: Callable[..., Any]
    result: Kind
    arguments: tuple[Kind, ...]


PARTS: dict[Callable[..., Any], dict[str, Any] | Instruction] = {}
"""The functions that kernels call, and how each is compiled: by which options of numba, or as what instruction."""
