"""How a function becomes a kernel: for which types it is compiled, by which rules of arithmetic, and what is kept."""

from __future__ import annotations

import importlib
import os
import pickle
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from types import ModuleType
from typing import Any, TypeVar

from relnav_sim.kernels import CompilerError
from relnav_sim.kernels.code_folder import alone, is_kept, keep_code, read_code, warn_not_kept

Function = TypeVar("Function", bound=Callable[..., Any])


def _numba() -> ModuleType:
    """Import numba without Intel's vector mathematics, which round differently in vectors and beside them.

    Whether numba uses them is settled once in a process, by a variable of the environment that is read then. Other
    code of the process does without them too: that costs it some speed and changes last digits. Where the program has
    numba with them already, nothing that is compiled here is kept for others.
    """
    variable = "NUMBA_DISABLE_INTEL_SVML"
    before = os.environ.get(variable)
    os.environ[variable] = "1"
    try:
        import numba
        import numba.core.caching
        import numba.core.compiler
        import numba.core.serialize
    except Exception as error:  # of whatever kind: numba refuses versions, llvmlite loads a library
        raise CompilerError(f"relnav needs numba, which can't be imported: {error}") from error
    finally:
        os.environ.pop(variable)
        if before is not None:
            os.environ[variable] = before
    return numba


numba: Any = _numba()
types = numba.types

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
    return lambda function: Uncompiled(function, arguments)  # type: ignore[return-value]  # it is called as one


class Uncompiled:
    """A kernel before its first call, which puts what is compiled in its place in the module."""

    def __init__(self, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
        self._function, self._arguments = function, arguments

    def __call__(self, *arguments: Any) -> Any:
        """Compile it, and call what is compiled."""
        return self.compiled()(*arguments)

    def compiled(self) -> Callable[..., Any]:
        """Return what is compiled, from the folder of compiled code where it is kept already."""
        function = self._function
        compiled = numba.njit(error_model="numpy")(function)
        if compiled is not function:  # which it is where NUMBA_DISABLE_JIT is set
            name = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"
            if not numba.config.USING_SVML:
                compiled._cache = _Kept(name)
            with nullcontext() if is_kept(name) else alone(name):
                compiled.compile(self._arguments)
            compiled.disable_compile()
        setattr(sys.modules[function.__module__], function.__name__, compiled)
        return compiled


def compile_kernel(name: str) -> float:
    """Compile a kernel, given as `theme.function`, without calling it; return the seconds of processor time it took."""
    theme, _, function = name.partition(".")
    kernel = getattr(importlib.import_module(f"relnav_sim.kernels.{theme}"), function)
    before = time.process_time()
    if isinstance(kernel, Uncompiled):
        kernel.compiled()
    return time.process_time() - before


class _Kept(numba.core.caching.NullCache):  # type: ignore[misc]  # numba has no types
    """Where numba looks for the code of a kernel and leaves it: what its own cache does, and more carefully.

    That one asks a folder to be writable to read from it, believes what it reads, and does not see that a function of
    another file has changed. Here whatever goes wrong means that the kernel is compiled in memory.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return the compiled kernel; None where it is not kept, or is for another processor."""
        code = read_code(self._name)
        if code is None:
            return None
        try:
            _initialise(target)
            processor, content = pickle.loads(code)
            if processor != target.codegen().magic_tuple():
                return None
            return numba.core.compiler.CompileResult._rebuild(target, *content)
        except Exception:  # code of a numba that keeps it in another form
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep a kernel that has been compiled."""
        try:
            assert not compiled.library.has_dynamic_globals, f"{self._name} has addresses of this process in it"
            code = numba.core.serialize.dumps((compiled.codegen.magic_tuple(), compiled._reduce()))
        except Exception as error:  # a numba that keeps code in another form
            warn_not_kept(str(error))
        else:
            keep_code(self._name, code)


def _initialise(target: Any) -> None:
    """Make a process ready for code that is loaded, which needs numba's memory management and nothing of its compiler.

    That takes a third of the time of getting all ready, as newer versions of numba than those tried get it.
    """
    if numba.version_info.short <= LATEST_KNOWN:
        numba.core.runtime.rtsys.initialize(target)
    else:
        target.refresh()


LATEST_KNOWN = (0, 68)
"""The latest version of numba with which loading has been tried."""


def inner(function: Function) -> Function:
    """Compile a function that kernels call, as a part of each of them; a kernel itself is not called by others."""
    return numba.njit(error_model="numpy")(function)


def inlined(function: Function) -> Function:
    """Compile a function of single numbers as `inner` does, but into the loop that calls it, which then vectorises."""
    return numba.njit(error_model="numpy", forceinline=True)(function)
