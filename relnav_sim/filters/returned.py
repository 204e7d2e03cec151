"""What a filter of anybody's hands back, checked before it is believed, and closed to writing once it is."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any, NoReturn

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.filters.belief import Innovation
from relnav_sim.printable import printable

LONGEST_NAME = 60
_FLOAT = np.dtype(np.float64)


class Returned:
    """Checks what a filter returns for B runs of n states; every step pays for it, so the good case is short.

    Args:
        B: Number of runs.
        n: Number of states.

    Raises (all of its methods):
        ValueError: It is not what it should be; the message says which method has returned what.
    """

    def __init__(self, B: int, n: int) -> None:
        self._runs = (B,)
        self._shapes = {"mean": (B, n), "covariance": (B, n, n)}
        self._fields: dict[type, list[tuple[str, tuple[int, ...] | None]]] = {}

    def belief(self, belief: Any, method: str) -> Any:
        """Return a belief after a check of its arrays, which may not be written to from now on.

        A later step that writes into it would change the runs that have no measurement then, or what others hold of it.
        """
        kind = type(belief)
        if kind not in self._fields:
            if not is_dataclass(belief):
                raise ValueError(f"{method} has returned {_kind(belief)}; it must return a belief, a dataclass")
            self._fields[kind] = [(item.name, self._shapes.get(item.name)) for item in fields(belief)]
        for name, shape in self._fields[kind]:
            value = getattr(belief, name)
            if shape is not None:
                if type(value) is not np.ndarray or value.shape != shape or value.dtype != _FLOAT:
                    self._refuse(value, shape, name, method)
                value.setflags(write=False)
            elif isinstance(value, np.ndarray):
                value.setflags(write=False)
        return belief

    def moment(self, belief: Any, name: str) -> Array:
        """Return mean or covariance of a checked belief, which may compute them."""
        value: Array = getattr(belief, name)
        if name not in belief.__dict__:
            shape = self._shapes[name]
            if type(value) is not np.ndarray or value.shape != shape or value.dtype != _FLOAT:
                self._refuse(value, shape, name, "update")
        return value

    def update(self, updated: Any) -> tuple[Any, Innovation]:
        """Return belief and innovation as `update` has returned them, both checked."""
        if not (isinstance(updated, tuple) and len(updated) == 2 and isinstance(updated[1], Innovation)):
            raise ValueError(f"update has returned {_kind(updated)}; it must return a belief and an Innovation")
        belief, innovation = updated
        self._check_numbers(innovation.nis, "nis")
        self._check_numbers(innovation.log_likelihood, "log_likelihood")
        for name, value in innovation.extras.items():
            self._check_numbers(value, name)
        return self.belief(belief, "update"), innovation

    def _refuse(self, value: Any, shape: tuple[int, ...], name: str, method: str) -> NoReturn:
        raise ValueError(
            f"the {name} of the belief that {method} has returned is {_kind(value)}; "
            f"it must be an array of float64 of shape {shape}"
        )

    def _check_numbers(self, value: Any, name: str) -> None:
        if type(value) is np.ndarray and value.shape == self._runs and value.dtype.kind in "fiub":
            return
        what = printable(str(name), LONGEST_NAME)
        raise ValueError(
            f"{what} of the innovation is {_kind(value)}; it must be an array of numbers of shape {self._runs}"
        )


def check_name(name: Any) -> None:
    """Raise a `ValueError` where an extra of an innovation has a name that can't be stored or shown."""
    if not isinstance(name, str) or not name or len(name) > LONGEST_NAME or name != printable(name) or "/" in name:
        raise ValueError(
            f"{printable(repr(name), LONGEST_NAME)} can't be the name of an extra: up to {LONGEST_NAME} printable "
            "characters without '/'"
        )


def _kind(value: Any) -> str:
    if value is None:
        return "None"
    kind = "an array" if type(value) is np.ndarray else f"a {type(value).__name__}"
    return f"{kind} of type {value.dtype} and shape {value.shape}" if isinstance(value, np.ndarray) else kind
