"""Rules for the integration of r'' = f(t, r) over one step by Gauss collocation, solved by fixed-point iteration.

Gauss's implicit Runge-Kutta methods (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd ed.,
sections II.7 and II.14), in Nystroem's form. Orbits are smooth and steps short, so a few sweeps of the fixed-point
iteration reach rounding error. `relnav_sim.kernels.collocation` is what integrates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from math import factorial

import numpy as np

from relnav_sim.arrays import Array

PRECISION = 1e-16
"""Truncation of one step, relative to the state."""
RIPPLE, RIPPLE_PRECISION = 1e-4, 1e-14
"""What a gravity field has beside point mass and J2 to J4, as a share of the point mass, and its truncation."""


@dataclass(frozen=True)
class Rule:
    """Nodes and weights for a step of unit length, and how often the iteration sweeps over them.

    Attributes:
        nodes: c (s,), in (0, 1).
        inner: Twice integrated to each node, (s, s).
        position: Twice integrated to the end, (s,).
        velocity: Once integrated to the end, (s,).
        sweeps: Evaluations of f at all nodes.
    """

    nodes: Array
    inner: Array
    position: Array
    velocity: Array
    sweeps: int

    @cached_property
    def tableau(self) -> Array:
        """Nodes and weights in one array (s + 2, s + 1): a row for each node, one for position and one for velocity."""
        table = np.zeros((len(self.nodes) + 2, len(self.nodes) + 1))
        table[:-2, 0], table[:-2, 1:], table[-2, 1:], table[-1, 1:] = (
            self.nodes,
            self.inner,
            self.position,
            self.velocity,
        )
        return table


def rule_for(turn: float, ripple: float = 0.0) -> Rule:
    """Return the smallest rule that reaches `PRECISION` where f's slope, times the step squared, is up to turn^2.

    S sweeps from a straight line leave out y^(2 S + 1) / (2 S + 1)! of the velocity's series sinh y, y = `turn`; s
    nodes integrate up to (s!)^4 / ((2 s + 1) (2 s)!^3) of the next derivative, y^(2 s).

    Args:
        turn: See above.
        ripple: How far the waves of a small part of f turn in the step, rad: of `RIPPLE`, to `RIPPLE_PRECISION`.
    """
    sweeps = nodes = 1
    while turn ** (2 * sweeps + 1) / factorial(2 * sweeps + 1) > PRECISION:
        sweeps += 1
    while _left_out(nodes, turn) > PRECISION or RIPPLE * _left_out(nodes, ripple) > RIPPLE_PRECISION:
        nodes += 1
    return gauss_rule(max(nodes, 2), sweeps)


def _left_out(nodes: int, turn: float) -> float:
    """Return what Gauss's rule leaves out of the integral of a wave that turns so far in the step, as a share."""
    return factorial(nodes) ** 4 / ((2 * nodes + 1) * factorial(2 * nodes) ** 3) * turn ** (2 * nodes)


@cache
def gauss_rule(size: int, sweeps: int) -> Rule:
    """Return Gauss's rule with `size` nodes: order 2 `size`."""
    roots, weights = np.polynomial.legendre.leggauss(size)
    nodes, velocity = (roots + 1) / 2, weights / 2
    # Integrals of the Lagrange polynomials through the nodes, from Vandermonde's matrix in Legendre polynomials.
    values = np.polynomial.legendre.legvander(roots, size - 1)
    integrals = np.stack(
        [np.polynomial.legendre.legval(roots, np.polynomial.legendre.legint(row, lbnd=-1)) / 2 for row in np.eye(size)],
        axis=1,
    )
    once = integrals @ np.linalg.inv(values)
    return Rule(nodes, once @ once, velocity * (1 - nodes), velocity, sweeps)
