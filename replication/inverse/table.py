"""Printed numbers: where they stand, and the scale on which they are compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array


@dataclass(frozen=True)
class Number:
    """A printed number.

    Attributes:
        table: Its table, as `table_2`.
        column: Its column.
        label: Its row.
        unit: Its unit.
        signed: Whether it can be negative.
        digit: One unit of its last printed digit.
    """

    table: str
    column: str
    label: str
    unit: str
    signed: bool = False
    digit: float = 0.001

    @property
    def name(self) -> str:
        """What tells it from all others."""
        return f"{self.table} {self.column} {self.label}"


def rounded(numbers: Array, of: Sequence[Number]) -> Array:
    """Return numbers (..., numbers) as they are printed."""
    digits = np.array([number.digit for number in of])
    return np.round(numbers / digits) * digits


def compared(numbers: Array, of: Sequence[Number]) -> Array:
    """Return printed numbers on the scale on which they are compared: sizes by their logarithm.

    A signed number is linear below twenty of its last digits and logarithmic above; a size below half a digit counts as
    half of it.
    """
    digits = np.array([number.digit for number in of])
    signed = np.array([number.signed for number in of])
    sizes = np.log(np.maximum(numbers, digits / 2))
    return np.where(signed, np.arcsinh(numbers / (20 * digits)), sizes)
