"""Arrays that a user gives: plain finite numbers and true covariances, or a sentence that names what is wrong.

Everything here is done once, where an array is given; nothing of it is repeated at every step.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array, Mask
from relnav_sim.linalg import factor, runs_last, symmetric, transpose

_ROUNDING = 1e-9
"""Largest asymmetry, and largest negative eigenvalue, of a correlation matrix that counts as rounding: matrices that
were computed in double precision have less, and typing errors more."""
_LARGEST = float(np.finfo(np.float64).max) / 2
"""Of what is larger, twice is infinite."""


def numbers(given: ArrayLike, name: str, masked_is_missing: bool = False) -> Array:
    """Return an array of float64; never the caller's own where it had to be converted.

    Args:
        given: What the user gave.
        name: What to call it in a message.
        masked_is_missing: Whether masked entries become NaN; else they are refused.

    Raises:
        ValueError: It holds text, complex numbers, objects or masked entries, or is no array at all.
    """
    if type(given) is np.ndarray and given.dtype == np.float64:
        return given
    try:
        array = np.asarray(_with_masked_as_nan(given, name, masked_is_missing))
    except ValueError as problem:
        if str(problem).startswith(name):
            raise
        raise ValueError(f"{name} is no array: its rows differ in length") from None
    if array.dtype.kind not in "biuf":
        kinds = {"c": "complex numbers", "U": "text", "S": "text", "M": "dates", "m": "time spans", "O": "objects"}
        hint = "; a missing measurement is NaN" if masked_is_missing else ""
        raise ValueError(f"{name} holds {kinds.get(array.dtype.kind, str(array.dtype))}, not real numbers{hint}")
    return np.asarray(array, dtype=np.float64)


def returned_numbers(given: ArrayLike, name: str) -> Array:
    """Return what a user's function has returned, as float64 in C order, which kernels take alone.

    Args:
        given: What it returned.
        name: What to call it in a message.

    Raises:
        ValueError: As `numbers`.
    """
    array = numbers(given, name)
    return array if array.flags.c_contiguous else array.copy()


def _with_masked_as_nan(given: object, name: str, allowed: bool) -> object:
    """Return the same with masked entries as NaN; NumPy itself drops the mask and keeps what is under it."""
    if isinstance(given, np.ma.MaskedArray):
        if not np.ma.is_masked(given):
            return np.ma.getdata(given)
        if not allowed:
            raise ValueError(f"{name} has masked entries; give it as a plain array without missing entries")
        if given.dtype.kind not in "biuf":
            return np.ma.getdata(given)  # refused by its kind
        return np.where(np.ma.getmaskarray(given), np.nan, np.ma.getdata(given).astype(np.float64))
    if isinstance(given, list | tuple):
        return [_with_masked_as_nan(part, name, allowed) for part in given]
    return given


def finite(array: Array, name: str, axes: Sequence[str]) -> Array:
    """Return the array; `axes` names its axes for the message, as ``("run", "state")``.

    Raises:
        ValueError: An entry is NaN or infinite.
    """
    if not np.isfinite(array).all():
        place = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
        what = "NaN" if np.isnan(array[place]) else "infinite"
        raise ValueError(f"{name} is {what} at {_place(axes, place)}")
    return array


def covariances(given: ArrayLike, name: str, shapes: str, leading: Sequence[Sequence[str]]) -> Array:
    """Return covariance matrices (..., n, n), symmetric to the bit.

    They may depart from symmetric and positive semidefinite matrices by rounding, measured against the variances.

    Args:
        given: What the user gave.
        name: What to call it in a message.
        shapes: The shapes it may have, in words.
        leading: Names of the axes before the last two, one list for each number of axes that is allowed.

    Raises:
        ValueError: Another shape, an entry that is not finite, or a matrix that is no covariance.
    """
    array = numbers(given, name)
    axes = next((axes for axes in leading if len(axes) == array.ndim - 2), None)
    if axes is None or array.shape[-1] != array.shape[-2] or array.shape[-1] == 0:
        hint = "; numpy.diag(variances) makes a matrix of variances" if array.ndim < 2 or 1 in array.shape else ""
        raise ValueError(f"{name} has shape {array.shape}; it must be {shapes}{hint}")
    finite(array, name, (*axes, "row", "column"))
    n = array.shape[-1]
    of_narrow = getattr(given, "dtype", None)
    rounding = max(_ROUNDING, 64 * np.finfo(of_narrow).eps) if _is_float(of_narrow) else _ROUNDING
    stack = array.reshape(-1, n, n)

    def complain(bad: Mask, fault: str) -> None:
        if bad.any():
            place = np.unravel_index(int(np.argmax(bad)), array.shape[:-2])
            of = f" of {_place(axes, [int(i) for i in place])}" if axes else ""
            raise ValueError(f"{name}{of} is no covariance: {fault}")

    complain(np.abs(stack).max(axis=(1, 2)) > _LARGEST, f"an entry exceeds {_LARGEST:g}")
    variances = np.einsum("kii->ki", stack)
    for i in np.flatnonzero((variances < 0).any(axis=0)):
        complain(variances[:, i] < 0, f"the variance in row {i} is negative")
    deviations = np.sqrt(variances)
    scale = deviations[:, :, None] * deviations[:, None, :]
    complain((np.abs(stack - transpose(stack)) > rounding * scale).any(axis=(1, 2)), "it is not symmetric")
    complain((np.abs(stack) > (1 + rounding) * scale).any(axis=(1, 2)), "a correlation in it exceeds 1")
    exact = symmetric(stack)
    correlations = exact / np.where(scale > 0, scale, 1.0)
    try:
        np.linalg.cholesky(correlations)
    except np.linalg.LinAlgError:
        # Factors of their own tell for nearly all at little cost, eigenvalues for those without one.
        doubtful = ~np.isfinite(factor(runs_last(correlations))[n - 1, n - 1])
        lowest = np.zeros(len(stack))
        lowest[doubtful] = np.linalg.eigvalsh(correlations[doubtful])[:, 0]
        complain(lowest < -rounding, "it is not positive semidefinite")
    return exact.reshape(array.shape)


def _is_float(dtype: object) -> bool:
    return isinstance(dtype, np.dtype) and dtype.kind == "f"


def _place(axes: Sequence[str], place: Sequence[int]) -> str:
    return ", ".join(f"{axis} {index}" for axis, index in zip(axes, place, strict=True))
