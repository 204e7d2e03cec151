"""Counts the arithmetic of kernels: they run as the plain Python that they are, on numbers that count."""

import importlib
import math
from collections import Counter
from types import FunctionType, SimpleNamespace

import numpy as np

from relnav_sim.kernels import elementary
from relnav_sim.kernels.compiling import PARTS, Uncompiled, in_terms_of

COUNT = Counter()
RUNS = 2
"""Of a block: with two, matrices that are given by run count as dense."""


class Counted(float):
    """A number whose sums, differences, products and quotients count."""

    def __neg__(self):
        return Counted(float.__neg__(self))

    def __abs__(self):
        return Counted(float.__abs__(self))


def _counting(name):
    of_float = getattr(float, name)

    def operation(self, other):
        COUNT["operations"] += 1
        try:
            return Counted(of_float(self, float(other)))
        except ZeroDivisionError:
            return Counted(math.nan)

    return operation


for _name in ("add", "sub", "mul", "truediv"):
    for _side in ("", "r"):
        setattr(Counted, f"__{_side}{_name}__", _counting(f"__{_side}{_name}__"))


def _sqrt(x):
    COUNT["operations"] += 1
    return Counted(math.sqrt(x)) if x >= 0 else Counted(math.nan)


def _function(of_float):
    def called(x):
        COUNT["functions"] += 1
        return Counted(of_float(x))

    return called


class _Cells(np.ndarray):
    """An array of numbers that count, plain ones that are put into it too."""

    def __setitem__(self, place, value):
        super().__setitem__(place, Counted(value) if isinstance(value, float | int) else value)


def _array(shape, dtype=None):
    if dtype in (np.bool_, np.int64, np.intp, bool, int):
        return np.zeros(shape, dtype)
    array = np.empty(shape, dtype=object).view(_Cells)
    array.fill(Counted(0.0))
    return array


def _filled(shape, value):
    array = _array(shape)
    array.fill(Counted(value))
    return array


_NUMPY = SimpleNamespace(
    **{name: getattr(np, name) for name in ("bool_", "int64", "intp", "arange", "inf", "nan", "pi")},
    float64=lambda x: x,
    empty=_array,
    zeros=_array,
    empty_like=lambda A: _array(A.shape),
    zeros_like=lambda A: _array(A.shape),
    full=lambda shape, value: _filled(shape, value),
)
_MATH = SimpleNamespace(
    **{name: getattr(math, name) for name in ("pi", "inf", "nan", "isfinite", "isnan", "floor")},
    sqrt=_sqrt,
    **{name: _function(getattr(math, name)) for name in ("log", "exp", "cos", "sin", "atan2", "expm1")},
)
_OF_ONE = {"log": math.log, "exp": math.exp}


def _seen(name, value):
    if name == "LANES":
        return 1
    if name == "np":
        return _NUMPY
    if name == "math":
        return _MATH
    if isinstance(value, FunctionType) and value in PARTS:
        if value.__module__ == elementary.__name__ and name in _OF_ONE:
            return _function(_OF_ONE[name])
        return in_terms_of(value, _seen)
    return value


def _counts(kernel):
    plain = kernel.function if isinstance(kernel, Uncompiled) else kernel.py_func
    function = in_terms_of(plain, _seen)

    def called(*arguments):
        COUNT["calls"] += 1
        # What is done next follows the type of what is returned.
        kind = np.float32 if plain.__name__.endswith("_single") else np.float64
        return _told(function(*map(_given, arguments)), kind)

    return called


def _given(x):
    if isinstance(x, np.ndarray) and x.dtype.kind == "f":
        array = _array(x.shape)
        for place in np.ndindex(*x.shape):
            array[place] = Counted(x[place])
        return array
    return Counted(x) if isinstance(x, float) else x


def _told(x, kind):
    if isinstance(x, tuple):
        return tuple(_told(one, kind) for one in x)
    return np.array(x, dtype=kind) if isinstance(x, np.ndarray) and x.dtype == object else x


def counting(monkeypatch, **themes):
    """Let kernels count, given as `theme=("kernel", ...)`; return the counter, a dictionary."""
    for theme, names in themes.items():
        module = importlib.import_module(f"relnav_sim.kernels.{theme}")
        for name in names:
            monkeypatch.setattr(module, name, _counts(vars(module)[name]))
    COUNT.clear()
    return COUNT
