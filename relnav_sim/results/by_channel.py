"""What the residuals of a filter say about each channel of its sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from relnav_sim.results import layout


@dataclass(frozen=True)
class ByChannel:
    """Residuals in formal sigmas of each of c channels, over the whole run and settled.

    Attributes:
        names: Sensor and channel, ``radar range``, in the order in which the filter takes them.
        count: Measurements, (runs, 2, c).
        mean: Mean residual, (runs, 2, c); NaN without measurements.
        product: Mean product of residuals so many measurements apart, about 0, (runs, 2, c, lags), lags as in
            `layout.LAGS`; NaN without a pair.
    """

    names: tuple[str, ...]
    count: NDArray[Any]
    mean: NDArray[Any]
    product: NDArray[Any]

    @staticmethod
    def of_arrays(columns: layout.Columns, arrays: Mapping[str, NDArray[Any]]) -> ByChannel | None:
        """Return what arrays by their names in the layout say; None where nobody looked at residuals."""
        if not columns.channels:
            return None
        parts = {spec.name.removeprefix("channel_"): arrays[spec.name] for spec in layout.BY_CHANNEL}
        return ByChannel(columns.channels, **parts)
