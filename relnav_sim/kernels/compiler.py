"""What compiles kernels, by numba, and loads them from the folder of compiled code."""

from __future__ import annotations

import os
import pickle
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import cache
from inspect import Parameter, Signature, signature
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from relnav_sim.kernels import CompilerError
from relnav_sim.kernels.code_folder import alone, is_kept, keep_code, name_of_code, read_code, warn_not_kept
from relnav_sim.kernels.compiling import PARTS, Instruction, Kind, in_terms_of, names_in, no_search_for_garbage


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
        import numba.core.codegen
        import numba.core.compiler
        import numba.core.pythonapi
        import numba.core.serialize
        import numba.extending
    except Exception as error:  # of whatever kind: numba refuses versions, llvmlite loads a library
        raise CompilerError(f"relnav needs numba, which can't be imported: {error}") from error
    finally:
        os.environ.pop(variable)
        if before is not None:
            os.environ[variable] = before
    return numba


numba: Any = _numba()


def compiled(function: Callable[..., Any], arguments: tuple[Kind, ...], wide: bool) -> Callable[..., Any]:
    """Return a kernel, compiled for arguments of these types and no others; it is kept, or was already."""
    if numba.config.DISABLE_JIT:
        return function
    name = name_of_code(function)
    compiler = _WideKernelCompiler if wide else _KernelCompiler
    kernel = _jit(function, **_where_known(pipeline_class=compiler, no_cfunc_wrapper=True))  # C calls none of them
    if not numba.config.USING_SVML:
        kernel._cache = _Kept(name)
    with nullcontext() if is_kept(name) else alone(name), no_search_for_garbage(), _no_type_asked_twice():
        kernel.compile(tuple(kind(numba.types) for kind in arguments))
    kernel.disable_compile()
    return kernel


@contextmanager
def _no_type_asked_twice() -> Iterator[None]:
    """Spare a seventh of the work in Python: numba tries all forms of an operator anew wherever one is used.

    For as long as this lasts other threads of the program that compile wait, as they do for numba itself.
    """
    functions = numba.core.types.functions.BaseFunction

    def remembered(function: Any, context: Any, values: Any, by_name: Any) -> Any:
        key = function, tuple(values), tuple(by_name.items())
        if key not in _SIGNATURES:
            _SIGNATURES[key] = asked(function, context, values, by_name)
        return _SIGNATURES[key]

    with numba.core.compiler_lock.global_compiler_lock:
        asked = functions.get_call_type
        if numba.version_info.short <= LATEST_KNOWN:
            functions.get_call_type = remembered
        try:
            yield
        finally:
            functions.get_call_type = asked


_SIGNATURES: dict[tuple[Any, ...], Any] = {}


def _jit(function: Callable[..., Any], **options: Any) -> Any:
    return numba.njit(error_model="numpy", **options)(in_terms_of(function, _as_compiled))


def _as_compiled(name: str, value: Any) -> Any:
    """Return what numba compiles in place of a plain function that kernels call."""
    return part(value) if isinstance(value, FunctionType) and value in PARTS else value


@cache
def part(function: Callable[..., Any]) -> Any:
    """Return what numba compiles, as a part of kernels, for a function that they call."""
    how = PARTS[function]
    if isinstance(how, Instruction):
        return _intrinsic(function, how)
    # It is not called from Python; what lets it be called takes a tenth of the time of compiling.
    unwrapped = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return _jit(function, **how, **unwrapped, **_where_known(_nrt=owns_arrays(function), pipeline_class=_PartCompiler))


def owns_arrays(function: Callable[..., Any]) -> bool:
    """Return whether a part of kernels makes arrays, returns some, or gets some from another part.

    numba counts who refers to an array, with an instruction that locks memory, for each array of each call. That is
    necessary in these parts only: what others are given their callers keep.
    """
    called: list[Callable[..., Any]] = [
        value for value in names_in(function).values() if isinstance(value, FunctionType) and value in PARTS
    ]
    return not _MAKERS.isdisjoint(function.__code__.co_names) or any(
        _returns_arrays(each) for each in [function, *called]
    )


_MAKERS = {"empty", "zeros", "full"}
"""Of NumPy; numba refuses to compile a part that uses another one and does not own arrays."""
_NUMBERS = re.compile(r"None|(tuple\[)?(float|int|bool)(, (float|int|bool))*\]?")


def _returns_arrays(function: Callable[..., Any]) -> bool:
    """Return whether a part may; one that does not say what it returns may."""
    returned = function.__annotations__.get("return", "")
    return not isinstance(PARTS[function], Instruction) and not _NUMBERS.fullmatch(str(returned))


def _where_known(**options: Any) -> dict[str, Any]:
    """Return options of numba that are not for everybody, where they are known to work."""
    return options if numba.version_info.short <= LATEST_KNOWN else {}


class _OptimisedOnce(numba.core.codegen.JITCodeLibrary):  # type: ignore[misc]
    """Code that is optimised where all of it has come together, in the kernel.

    By itself numba would optimise each function, then what it calls with it, twice, and make machine code of it, which
    nobody runs, before it goes into another one. That takes a quarter of the time of compiling.
    """

    def _optimize_functions(self, module: Any) -> None:
        """Leave it to the kernel; only say how numbers lie in memory."""
        module.data_layout = self._codegen._data_layout


class _PartOfKernels(_OptimisedOnce):
    """The code of a part of kernels, as it goes into the code of a kernel."""

    def _optimize_final_module(self) -> None:
        """Leave it to the kernel."""

    def _finalize_final_module(self) -> None:
        """Do without what only machine code needs."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return zero, which is the place of what is not there."""
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> _PartOfKernels:
        """Who is told of the function's globals."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: without machine code there is no place for them."""


class _Kernel(_OptimisedOnce):
    """The code of a kernel, whose loops are vectorised but not written out several times in a row.

    Most of them go over a few runs. There LLVM's unrolling and interleaving gain nothing; they double the code and the
    time it takes to optimise it.
    """

    has_long_loops = False

    def _optimize_final_module(self) -> None:
        """Optimise all that has come together."""
        bindings = numba.core.codegen.ll
        tuning = bindings.create_pipeline_tuning_options(int(numba.config.OPT))
        tuning.loop_vectorization = True
        tuning.loop_unrolling = tuning.loop_interleaving = self.has_long_loops
        builder = bindings.create_pass_builder(self._codegen._tm, tuning)
        passes = builder.getModulePassManager()
        passes.add_refprune_pass()
        passes.run(self._final_module, builder)


class _WideKernel(_Kernel):
    """The code of a kernel of long loops, optimised for registers of 512 bits where the processor has them.

    LLVM takes those of 256 by itself, for processors that once ran slower with the wider ones.
    """

    has_long_loops = True

    def _optimize_final_module(self) -> None:
        """Tell LLVM of another machine for as long as it chooses the width."""
        codegen = self._codegen
        machine = codegen._tm
        if "+avx512f" in codegen._tm_features.split(","):
            options = {"opt": numba.config.OPT}
            codegen._customize_tm_options(options)
            options["features"] += ",-prefer-256-bit"
            target = numba.core.codegen.ll.Target.from_triple(machine.triple)
            codegen._tm = target.create_target_machine(**options)
        try:
            super()._optimize_final_module()
        finally:
            codegen._tm = machine


class _Compiler(numba.core.compiler.Compiler):  # type: ignore[misc]  # numba has no types
    """What compiles kernels and their parts, without numba's passes for closures, array expressions and inlining.

    Kernels have none of the first two, and LLVM inlines. The passes take an eighth of the work in Python.
    """

    library_class: type[_OptimisedOnce]

    def __init__(self, typing: Any, target: Any, library: Any, *others: Any) -> None:
        super().__init__(typing, target, library or self.library_class(target.codegen(), "kernel"), *others)

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        found: list[Any] = super().define_pipelines()
        for manager in found:
            manager.passes[:] = [entry for entry in manager.passes if entry[0].name() not in _IN_VAIN]
        return found


_IN_VAIN = {"inline_closure_likes", "inline_overloads", "nopython_rewrites"}


class _PartCompiler(_Compiler):
    """What compiles parts of kernels, which are made machine code in the kernels only."""

    library_class = _PartOfKernels


class _KernelCompiler(_Compiler):
    """What compiles kernels, which hand over arrays in half the time that numba takes for it."""

    library_class = _Kernel

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.state.library.enable_object_caching()
        target = self.state.targetctx  # a copy, of this kernel alone
        target.get_python_api = lambda builder: _PythonInterface(target, builder)


class _WideKernelCompiler(_KernelCompiler):
    """What compiles kernels whose loops are to use the processor's widest registers."""

    library_class = _WideKernel


class _PythonInterface(numba.core.pythonapi.PythonAPI):  # type: ignore[misc]
    """How compiled code works with Python's objects: here the class of NumPy's arrays is one of its constants.

    numba has it looked up, by a function in Python, for every array that is returned.
    """

    def get_env_manager(self, *given: Any) -> Any:
        """Return what holds the constants, and note it."""
        self._constants = super().get_env_manager(*given)
        return self._constants

    def serialize_object(self, value: Any) -> Any:
        """Return a pointer to the value as text; that class as it is."""
        return value if value is np.ndarray else super().serialize_object(value)

    def unserialize(self, pointer: Any) -> Any:
        """Return the value, or the class from the constants."""
        if pointer is np.ndarray:
            return self._constants.read_const(self._constants.add_const(pointer))
        return super().unserialize(pointer)


def _intrinsic(function: Callable[..., Any], how: Instruction) -> Any:
    def typed(typing: Any, *values: Any) -> Any:
        types = how.result(numba.types)(*(kind(numba.types) for kind in how.arguments))
        return types, lambda context, builder, types, values: how.code(builder, *values)

    first = Parameter("typing", Parameter.POSITIONAL_ONLY)
    others = [p.replace(kind=Parameter.POSITIONAL_ONLY) for p in signature(function).parameters.values()]
    typed.__signature__ = Signature([first, *others])  # type: ignore[attr-defined]  # numba looks at how many there are
    return numba.extending.intrinsic(typed)


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
