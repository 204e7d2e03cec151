"""How dense the air is, by altitude."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.given_arrays import numbers

if TYPE_CHECKING:
    from relnav_sim.kernels.atmosphere import Layers

_TABLE = np.array(
    [
        (0, 1.225, 7.249), (25, 3.899e-2, 6.349), (30, 1.774e-2, 6.682), (40, 3.972e-3, 7.554),
        (50, 1.057e-3, 8.382), (60, 3.206e-4, 7.714), (70, 8.770e-5, 6.549), (80, 1.905e-5, 5.799),
        (90, 3.396e-6, 5.382), (100, 5.297e-7, 5.877), (110, 9.661e-8, 7.263), (120, 2.438e-8, 9.473),
        (130, 8.484e-9, 12.636), (140, 3.845e-9, 16.149), (150, 2.070e-9, 22.523), (180, 5.464e-10, 29.740),
        (200, 2.789e-10, 37.105), (250, 7.248e-11, 45.546), (300, 2.418e-11, 53.628), (350, 9.518e-12, 53.298),
        (400, 3.725e-12, 58.515), (450, 1.585e-12, 60.828), (500, 6.967e-13, 63.822), (600, 1.454e-13, 71.835),
        (700, 3.614e-14, 88.667), (800, 1.170e-14, 124.64), (900, 5.245e-15, 181.05), (1000, 3.019e-15, 268.00),
    ]
)  # fmt: skip
"""Base altitude, km; density there, kg/m^3; scale height, km: Vallado, Fundamentals of Astrodynamics and Applications,
4th ed. 2013, table 8-4 (after Wertz 1978), mean solar activity."""


@dataclass(frozen=True)
class LayeredAtmosphere:
    """Air of exponential layers, as Vallado's table 8-4 has them; altitude is |r| minus the radius of the body.

    The table's densities join within 1e-4 of themselves at the edges, 1.4e-3 at 25 km. It stands for mean solar
    activity; over a solar cycle the density at 400 km and above differs from it by a factor of several, either way.

    Args:
        density_factor: What the densities of the table are multiplied by.

    Raises:
        ValueError: The factor is not a positive number.

    Examples:
        >>> from relnav_sim import LayeredAtmosphere
        >>> float(LayeredAtmosphere().density(400e3))
        3.725e-12
    """

    density_factor: float = 1.0

    def __post_init__(self) -> None:
        if not 0 < self.density_factor < np.inf:
            raise ValueError(f"density_factor is {self.density_factor}; it must be a positive number")

    def density(self, altitude_m: ArrayLike) -> Array:
        """Return the density in kg/m^3 at altitudes in m, any shape."""
        altitude = numbers(altitude_m, "altitude_m")
        bases, densities, scale_heights = self.compiled
        layer = np.maximum(np.searchsorted(bases, altitude, side="right") - 1, 0)
        density: Array = densities[layer] * np.exp((bases[layer] - altitude) / scale_heights[layer])
        return density

    @cached_property
    def compiled(self) -> Layers:
        """The same as the kernels take it."""
        base_km, density, scale_height_km = (column.copy() for column in _TABLE.T)
        return kernels.atmosphere.Layers(1e3 * base_km, self.density_factor * density, 1e3 * scale_height_km)
