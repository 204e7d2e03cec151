"""What a dataset and a dimension of a results file are described by."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Dimension:
    """A dimension, stored beside the datasets that use it as a coordinate of the same name.

    Attributes:
        name: Name of the dimension and of its coordinate dataset.
        dtype: NumPy type string; ``str`` for text.
        units: SI unit, ``1`` for numbers without one, empty for text.
        long_name: What the coordinate is.
        values: The entries where the layout fixes them, else None: the data decide.
    """

    name: str
    dtype: str
    units: str
    long_name: str
    values: tuple[str, ...] | tuple[float, ...] | None = None


@dataclass(frozen=True)
class Dataset:
    """One dataset of a group.

    Attributes:
        name: Name in the file and in `FilterResult`.
        dims: Names of its dimensions in order.
        dtype: NumPy type string.
        units: SI unit, or ``1``.
        long_name: What it is, with its definition.
        column: Template of its flat column names; empty where it has none.
        timing: Measured time, thus outside every promise of equal bits.
    """

    name: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    column: str = ""
    timing: bool = False
