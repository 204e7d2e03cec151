"""Coefficients of series of spherical harmonics, their derivatives, and how kernels take them.

A series is a complex array (n + 1, n + 1) of c_nm = C_nm - i S_nm, fully normalised, zero above the diagonal. It stands
for the real part of the sum of c_nm (V_nm + i W_nm), the harmonics of `relnav_sim.kernels.spherical_harmonics`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array
from relnav_sim.kernels.spherical_harmonics import Series

Coefficients = NDArray[np.complex128]


def derivatives(c: Coefficients) -> tuple[Coefficients, Coefficients, Coefficients]:
    """Return R times the derivatives by x, y and z of a series (n + 1, n + 1): series (n + 2, n + 2).

    Montenbruck and Gill 2000, eq. 3.33, with normalised harmonics, and with both of its lines in one complex number.
    """
    top = len(c)
    n, m = np.tril(np.arange(float(top))[:, None] * np.ones(top)), np.tril(np.arange(float(top)) * np.ones((top, 1)))
    shrinks = (2 * n + 1) / (2 * n + 3)
    # Order 0 has half the square of the others' norm, and no partner of order -1 whose half would be added.
    up = np.where(m == 0, np.sqrt(0.5), 0.5) * np.sqrt(shrinks * (n + m + 1) * (n + m + 2)) * c
    down = np.where(m == 1, np.sqrt(0.5), 0.5) * np.sqrt(shrinks * (n - m + 1) * (n - m + 2)) * c
    along = np.sqrt(shrinks * (n - m + 1) * (n + m + 1)) * c
    by_x, by_y, by_z = np.zeros((3, top + 1, top + 1), dtype=complex)
    by_x[1:, 1:] -= up
    by_y[1:, 1:] += 1j * up
    by_x[1:, :-2] += down[:, 1:]
    by_y[1:, :-2] += 1j * down[:, 1:]
    by_z[1:, :-1] -= along
    for series in (by_x, by_y):
        series[:, 0].imag = 0.0  # W_n0 is zero
    return by_x, by_y, by_z


def packed(three: tuple[Coefficients, Coefficients, Coefficients], order: int, scale: float, radius_m: float) -> Series:
    """Return three series (n + 1, n + 1) as kernels take them.

    Args:
        three: The coefficients.
        order: The largest order m of any that is not zero.
        scale: What the sums are multiplied by.
        radius_m: R, m.
    """
    degree = len(three[0]) - 1
    columns = []
    for m in range(order + 1):
        n = np.arange(m, degree + 1)
        rows = np.zeros((len(n) + len(n) % 2, 8))
        rows[: len(n), :2] = np.stack(_recursion(n.astype(float), m), axis=-1)
        for place, c in enumerate(three):
            rows[: len(n), 2 + 2 * place], rows[: len(n), 3 + 2 * place] = c[n, m].real, c[n, m].imag
        columns.append(rows)
    orders = np.arange(1.0, order + 1)
    sectoral = np.sqrt(np.where(orders == 1, 3.0, (2 * orders + 1) / (2 * orders)))
    return Series(radius_m, np.array([scale, *sectoral]), np.concatenate(columns), float(degree))


def _recursion(n: Array, m: int) -> tuple[Array, Array]:
    """Return alpha and beta of degrees n and an order m; Holmes and Featherstone 2002, eq. 11 and 12."""
    with np.errstate(divide="ignore", invalid="ignore"):
        alpha = np.sqrt((2 * n + 1) * (2 * n - 1) / ((n - m) * (n + m)))
        beta = np.sqrt((2 * n + 1) * (n + m - 1) * (n - m - 1) / ((2 * n - 3) * (n + m) * (n - m)))
    return np.where(n > m, alpha, 0.0), np.where(n > m + 1, beta, 0.0)
