"""The gravity of a body of any shape, from spherical harmonic coefficients as their publishers give them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.gfc import read_gfc
from relnav_sim.astro.harmonic_series import derivatives, packed
from relnav_sim.kernels.spherical_harmonics import Series

SHIPPED = {"ggm05s": Path(__file__).with_name("ggm05s.gfc")}
"""The fields that come with the package, by name."""


@dataclass(frozen=True, eq=False)
class GravityField:
    """The gravity of a body in axes that turn with it, up to some degree and order.

    Its potential is mu/r times the sum of (R/r)^n P_nm(sin phi) (C_nm cos(m lambda) + S_nm sin(m lambda)), with fully
    normalised Legendre functions P_nm.

    Args:
        mu_m3_s2: Gravitational parameter, m^3/s^2.
        radius_m: R, the radius that the coefficients refer to, m.
        C: Fully normalised cosine coefficients (degree + 1, degree + 1), by degree and order, with C_00.
        S: Sine coefficients.
        order: The largest order; coefficients above it are left out.
        tide_system: `zero_tide`, `tide_free` or what the publishers say; nothing is converted.
        name: Of the model.

    Raises:
        ValueError: A gravitational parameter or radius that is not positive; coefficients of another shape or not
            finite; an order above the degree.

    Examples:
        >>> from relnav_sim import GravityField
        >>> field = GravityField.load("ggm05s", 20, 20)
        >>> field.mu_m3_s2, field.radius_m, field.tide_system
        (398600441500000.0, 6378136.3, 'zero_tide')
        >>> field.acceleration([0.0, 0.0, 7.0e6]).round(4).tolist()
        [0.0001, -0.0, -8.1129]
    """

    mu_m3_s2: float
    radius_m: float
    C: Array
    S: Array
    order: int
    tide_system: str = "unknown"
    name: str = ""

    def __post_init__(self) -> None:
        for name in ("mu_m3_s2", "radius_m"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise ValueError(f"{name} is {value}; it must be a positive number")
        for name in ("C", "S"):
            value = np.array(getattr(self, name), dtype=float)
            if value.ndim != 2 or value.shape != (len(self.C), len(self.C)) or not len(value):
                raise ValueError(f"{name} has shape {value.shape}; C and S must both be (degree + 1, degree + 1)")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} must hold finite numbers")
            object.__setattr__(self, name, np.tril(value))
        if not 0 <= self.order <= self.degree:
            raise ValueError(f"order is {self.order}; it must be between 0 and the degree, {self.degree}")
        for each in (self.C, self.S):
            each[:, self.order + 1 :] = 0.0

    @classmethod
    def load(cls, name_or_gfc_path: str | os.PathLike[str], degree: int, order: int | None = None) -> GravityField:
        """Return a field of the package, `ggm05s`, or one of a file in the form of the ICGEM (`.gfc`).

        GGM05S is a field of the Earth from ten years of GRACE (Tapley et al. 2013, Center for Space Research); the
        package has it to degree and order 60. Files are at https://icgem.gfz-potsdam.de.

        Args:
            name_or_gfc_path: A name, or the path of a file.
            degree: The largest degree to take, at least 0.
            order: The largest order, at most the degree; default: the degree.

        Raises:
            ValueError: There is no such field or file, it is not of that form, or has not that degree; the message
                names file and line.
        """
        order = degree if order is None else order
        if degree < 0 or not 0 <= order <= degree:
            raise ValueError(
                f"degree is {degree} and order {order}; the degree must be at least 0, the order between 0 and that"
            )
        path = SHIPPED.get(str(name_or_gfc_path))
        if path is None:
            path = Path(name_or_gfc_path)
            if path.suffix.lower() != ".gfc":
                raise ValueError(
                    f"there is no gravity field {str(name_or_gfc_path)!r}: give {' or '.join(SHIPPED)}, or the path of "
                    "a .gfc file"
                )
        found = read_gfc(path, degree, order)
        return cls(found.mu_m3_s2, found.radius_m, found.C, found.S, order, found.tide_system, found.name)

    @classmethod
    def zonal(cls, mu_m3_s2: float, radius_m: float, zonals: Sequence[float]) -> GravityField:
        """Return the field of unnormalised J2, J3, ...: C_n0 = -J_n / sqrt(2n + 1)."""
        degree = len(zonals) + 1
        C, S = np.zeros((2, degree + 1, degree + 1))
        C[0, 0] = 1.0
        C[2:, 0] = -np.array(zonals, dtype=float) / np.sqrt(2 * np.arange(2.0, degree + 1) + 1)
        return cls(float(mu_m3_s2), float(radius_m), C, S, 0, name="zonal")

    @property
    def degree(self) -> int:
        """The largest degree."""
        return len(self.C) - 1

    def acceleration(self, positions: ArrayLike) -> Array:
        """Return the acceleration (..., 3) in m/s^2 at positions (..., 3) in m, both in the body's axes.

        Raises:
            ValueError: The last axis is not three long.
        """
        points = np.asarray(positions, dtype=float)
        if points.ndim == 0 or points.shape[-1] != 3:
            raise ValueError(f"positions has shape {points.shape}; it must be (..., 3)")
        flat = np.ascontiguousarray(points).reshape(-1, 3)
        return kernels.spherical_harmonics.at_points(self.series, flat).reshape(points.shape)

    @cached_property
    def series(self) -> Series:
        """The components of the acceleration as the kernels take them."""
        scale = self.mu_m3_s2 / self.radius_m**2
        return packed(derivatives(self.C - 1j * self.S), self.order + 1, scale, self.radius_m)
