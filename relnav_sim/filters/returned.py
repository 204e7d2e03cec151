"""What a filter of anybody's hands back, checked before it is believed, and closed to writing once it is."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.filters.belief import Innovation
from relnav_sim.printable import printable

Array = NDArray[np.float64]
LONGEST_NAME = 60


def sealed(belief: Any, B: int, n: int, method: str) -> Any:
    """Return a belief after a check of its arrays, which may not be written to from now on.

    A later step that writes into it would change the runs that have no measurement then, or what others hold of it.

    Args:
        belief: What the filter has returned.
        B: Number of runs.
        n: Number of states.
        method: The filter's method that has returned it.

    Raises:
        ValueError: It is no belief over B runs of n states.
    """
    if not is_dataclass(belief):
        raise ValueError(f"{method} has returned {_kind(belief)}; it must return a belief, a dataclass")
    shapes = {"mean": (B, n), "covariance": (B, n, n)}
    for item in fields(belief):
        value = getattr(belief, item.name)
        if item.name in shapes:
            _check(value, shapes[item.name], f"{item.name} of the belief that {method} has returned")
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
    return belief


def checked_mean(mean: Any, B: int, n: int) -> Array:
    """Return the mean of a belief, which may be computed, if it is one."""
    return _check(mean, (B, n), "mean of the belief")


def checked_covariance(covariance: Any, B: int, n: int) -> Array:
    """Return the covariance of a belief, which may be computed, if it is one."""
    return _check(covariance, (B, n, n), "covariance of the belief")


def checked_update(updated: Any, B: int) -> tuple[Any, Innovation]:
    """Return belief and innovation as `update` has returned them; the belief is checked by `sealed`.

    Raises:
        ValueError: They are not what they should be.
    """
    if not (isinstance(updated, tuple) and len(updated) == 2 and isinstance(updated[1], Innovation)):
        raise ValueError(f"update has returned {_kind(updated)}; it must return a belief and an Innovation")
    innovation = updated[1]
    _check_numbers(innovation.nis, B, "nis")
    _check_numbers(innovation.log_likelihood, B, "log_likelihood")
    for name, value in innovation.extras.items():
        _check_numbers(value, B, name)
    return updated


def check_name(name: Any) -> None:
    """Raise a `ValueError` where an extra of an innovation has a name that can't be stored or shown."""
    if not isinstance(name, str) or not name or len(name) > LONGEST_NAME or name != printable(name) or "/" in name:
        raise ValueError(
            f"{printable(repr(name), LONGEST_NAME)} can't be the name of an extra: up to {LONGEST_NAME} printable "
            "characters without '/'"
        )


def _check(value: Any, shape: tuple[int, ...], what: str) -> Array:
    if type(value) is not np.ndarray or value.dtype != np.float64 or value.shape != shape:
        found = _kind(value)
        if isinstance(value, np.ndarray):
            found += f" of type {value.dtype} and shape {value.shape}"
        raise ValueError(f"the {what} is {found}; it must be an array of float64 of shape {shape}")
    return value


def _check_numbers(value: Any, B: int, name: str) -> None:
    array = np.asarray(value)
    if array.shape != (B,) or array.dtype.kind not in "fiub":
        found = f"of type {array.dtype} and shape {array.shape}"
        raise ValueError(
            f"{printable(str(name), LONGEST_NAME)} of the innovation is {found}; it must be ({B},) numbers"
        )


def _kind(value: Any) -> str:
    if value is None:
        return "None"
    return "an array" if type(value) is np.ndarray else f"a {type(value).__name__}"
