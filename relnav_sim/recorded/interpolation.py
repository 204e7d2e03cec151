"""Interpolation of tables of states: Lagrange, Hermite or linear, by Newton's divided differences.

For all times at once, each with its own nodes. Newton's form takes repeated nodes, so that Hermite's polynomial, which
meets positions and velocities, is the same computation as Lagrange's (Burden and Faires, Numerical Analysis, sections
3.3 and 3.4).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from relnav_sim.arrays import Array, Integers

Kind = Literal["LAGRANGE", "HERMITE", "LINEAR"]

_ACCELERATION_NODES = 8
"""Nodes of the velocities whose polynomial gives accelerations. Derived once, they need more than the states: with 8,
60 s apart in low Earth orbit, truncation is 1e-11 m/s^2."""
_TRIALS = 400
"""Rows withheld at most, to estimate an interpolation's error."""


@dataclass(frozen=True)
class Interpolation:
    """How states between the rows of a table are found.

    Attributes:
        kind: LAGRANGE: positions and velocities by polynomials of their own; HERMITE: the polynomial that meets
            positions and velocities, and its derivative; LINEAR: Lagrange of degree 1.
        degree: Degree of the polynomials. One of Hermite takes two conditions from each row, so that an even degree
            is raised by one.
    """

    kind: Kind
    degree: int

    @property
    def rows(self) -> int:
        """Rows that a polynomial takes."""
        return (self.degree + 2) // 2 if self.kind == "HERMITE" else self.degree + 1

    def states(self, times_s: Array, states: Array, at_s: Array) -> Array:
        """Return the states (K, 6) at times (K,), from a table (T,), (T, 6); all times within the table."""
        nodes = _windows(times_s, at_s, self.rows)
        return _interpolated(self.kind, times_s[nodes], states[nodes], at_s)

    def accelerations(self, times_s: Array, states: Array, at_s: Array) -> Array:
        """Return the accelerations (K, 3) at times (K,): derivatives of polynomials through the velocities."""
        nodes = _windows(times_s, at_s, min(max(self.rows, _ACCELERATION_NODES), len(times_s)))
        return _newton(times_s[nodes], states[nodes][..., 3:], None, at_s)[1]

    def error(self, times_s: Array, states: Array) -> tuple[float, float]:
        """Return the largest error of position and velocity at rows that are withheld one at a time, m and m/s.

        Each is interpolated from the rows around it, of which it leaves a gap of twice the step: the error between
        rows that are there is smaller. Rows that have as many rows on one side as on the other are withheld, where
        there are such. NaN where there are too few rows to withhold one.
        """
        if len(times_s) < max(self.rows + 1, 3):
            return np.nan, np.nan
        side = (self.rows + 1) // 2
        first, last = (side, len(times_s) - 1 - side) if len(times_s) > 2 * side else (1, len(times_s) - 2)
        withheld = np.unique(np.linspace(first, last, min(_TRIALS, last - first + 1)).round().astype(np.intp))
        around = _windows(times_s, times_s[withheld], self.rows + 1)
        nodes = around[around != withheld[:, None]].reshape(len(withheld), self.rows)
        found = _interpolated(self.kind, times_s[nodes], states[nodes], times_s[withheld])
        difference = (found - states[withheld]).reshape(-1, 2, 3)
        position, velocity = np.linalg.norm(difference, axis=-1).max(axis=0)
        return float(position), float(velocity)


def _windows(times_s: Array, at_s: Array, rows: int) -> Integers:
    """Return the rows (K, rows) around each time; at an end of the table they lie to one side."""
    before = np.searchsorted(times_s, at_s, side="right") - 1
    before = np.clip(before, 0, len(times_s) - 2)
    if rows % 2:  # an odd number is centred on the nearest row
        before += at_s - times_s[before] > times_s[before + 1] - at_s
    first = np.clip(before - (rows - 1) // 2, 0, len(times_s) - rows)
    windows: Integers = first[:, None] + np.arange(rows)
    return windows


def _interpolated(kind: Kind, times_s: Array, states: Array, at_s: Array) -> Array:
    """Return the states (K, 6) at times (K,), from nodes (K, n), (K, n, 6)."""
    position, velocity = states[..., :3], states[..., 3:]
    if kind == "HERMITE":
        return np.concatenate(_newton(times_s, position, velocity, at_s), axis=-1)
    return np.concatenate(
        [_newton(times_s, position, None, at_s)[0], _newton(times_s, velocity, None, at_s)[0]], axis=-1
    )


def _newton(times_s: Array, values: Array, slopes: Array | None, at_s: Array) -> tuple[Array, Array]:
    """Return the polynomials through values (K, n, 3) at nodes (K, n), and their derivatives, at times (K,).

    Args:
        times_s: The nodes.
        values: The values there.
        slopes: The derivatives there, for Hermite's polynomial; None: Lagrange's.
        at_s: The times.
    """
    # Nodes in units of about their spacing, so that differences stay well scaled; counted from the time asked for,
    # nearest first, and in a power of two, so that a time that is a node gets that node's value to the bit.
    unit = np.exp2(np.round(np.log2((times_s[:, -1] - times_s[:, 0]) / (times_s.shape[1] - 1))))
    z = (times_s - at_s[:, None]) / unit[:, None]
    order = np.argsort(np.abs(z), axis=1, kind="stable")
    z = np.take_along_axis(z, order, axis=1)
    c = np.take_along_axis(values, order[..., None], axis=1)
    if slopes is not None:
        s = np.take_along_axis(slopes, order[..., None], axis=1) * unit[:, None, None]
        z, c = np.repeat(z, 2, axis=1), np.repeat(c, 2, axis=1)
    count = z.shape[1]
    for j in range(1, count):
        gaps = z[:, j:] - z[:, :-j]
        if slopes is not None and j == 1:
            gaps[:, ::2] = 1.0
        step = (c[:, j:] - c[:, j - 1 : -1]) / gaps[..., None]
        if slopes is not None and j == 1:
            step[:, ::2] = s
        c = np.concatenate([c[:, :j], step], axis=1)
    p, dp = c[:, -1], np.zeros_like(c[:, -1])
    for i in range(count - 2, -1, -1):
        dp = p - dp * z[:, i, None]
        p = c[:, i] - p * z[:, i, None]
    return p, dp / unit[:, None]
