"""Integration of r'' = f(t, r) over one step by Gauss collocation, solved by fixed-point iteration.

Gauss's implicit Runge-Kutta methods (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 2nd ed.,
sections II.7 and II.14), in Nystroem's form. Orbits are smooth and steps short, so a few sweeps of the fixed-point
iteration reach rounding error; one evaluation of f serves all nodes, which suits arrays with many runs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import factorial

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.linalg import product

PRECISION = 1e-16
"""Truncation of one step, relative to the state."""


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


def rule_for(turn: float) -> Rule:
    """Return the smallest rule that reaches `PRECISION` where f's slope, times the step squared, is up to turn^2.

    S sweeps from a straight line leave out y^(2 S + 1) / (2 S + 1)! of the velocity's series sinh y, y = `turn`; s
    nodes integrate up to (s!)^4 / ((2 s + 1) (2 s)!^3) of the next derivative, y^(2 s).
    """
    sweeps = nodes = 1
    while turn ** (2 * sweeps + 1) / factorial(2 * sweeps + 1) > PRECISION:
        sweeps += 1
    while factorial(nodes) ** 4 / ((2 * nodes + 1) * factorial(2 * nodes) ** 3) * turn ** (2 * nodes) > PRECISION:
        nodes += 1
    return gauss_rule(max(nodes, 2), sweeps)


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


@dataclass(frozen=True)
class Path:
    """One step of r'' = f.

    Attributes:
        nodes: r at the nodes, (s, ..., N).
        position: r at the end, (..., N).
        velocity: r' at the end, (..., N).
    """

    nodes: Array
    position: Array
    velocity: Array


def integrate(rule: Rule, slope: Callable[[Array], Array], position: Array, velocity: Array, step_s: float) -> Path:
    """Return the path over one step.

    Args:
        rule: From `rule_for`.
        slope: f at the nodes: maps r (s, ..., N) to r'' of the same shape. A column's bits must not depend on the
            others.
        position: r at the start, (..., N).
        velocity: r' at the start, (..., N).
        step_s: Length of the step.
    """
    shape = position.shape
    r, v = position.reshape(1, 1, -1), velocity.reshape(1, 1, -1)
    inner, last = (step_s * step_s) * rule.inner[..., None], (step_s * step_s) * rule.position[None, :, None]
    line = r + (step_s * rule.nodes)[:, None, None] * v
    nodes = line
    for _ in range(rule.sweeps - 1):
        nodes = line + product(inner, _flat(slope(nodes.reshape(-1, *shape))))
    acceleration = _flat(slope(nodes.reshape(-1, *shape)))
    end = r + step_s * v + product(last, acceleration)
    speed = v + product(step_s * rule.velocity[None, :, None], acceleration)
    return Path(nodes.reshape(-1, *shape), end.reshape(shape), speed.reshape(shape))


def _flat(values: Array) -> Array:
    return values.reshape(len(values), 1, -1)
