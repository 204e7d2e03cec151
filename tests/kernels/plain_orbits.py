"""Gravity, orbits and steps along them in plain NumPy, with 64 bits of mantissa, and what their kernels are given."""

import numpy as np

from relnav_sim import kernels
from relnav_sim.astro.constants import J2, J3, J4, MU_M3_S2, RADIUS_M
from relnav_sim.dynamics.collocation import rule_for

ZONALS = {"point mass": (), "J2": (J2,), "J2 to J4": (J2, J3, J4)}
RULE, PARTS, STEP = rule_for(0.02), 2, 20.0
INTEGRATION = RULE.tableau, RULE.sweeps


def field_of(zonals):
    return np.array([MU_M3_S2, RADIUS_M, *zonals, 0.0, 0.0, 0.0][:5])


def chiefs(runs, seed=0):
    """Return states (runs, 6) in low orbits, and relative states (runs, 6)."""
    rng = np.random.default_rng(seed)
    r, v = rng.normal(size=(2, runs, 3))
    r *= 7.1e6 / np.linalg.norm(r, axis=1, keepdims=True)
    v -= np.einsum("bi,bi->b", r, v)[:, None] * r / 7.1e6**2
    v *= 7.6e3 / np.linalg.norm(v, axis=1, keepdims=True)
    return np.concatenate([r, v + 10], axis=1), rng.normal(size=(runs, 6)) * np.repeat([5e3, 5.0], 3)


def legs_of(states, zonals):
    return kernels.chief_orbit.legs(states, *INTEGRATION, PARTS, STEP / PARTS, field_of(zonals))


def step_of(zonals):
    return *INTEGRATION, STEP / PARTS, field_of(zonals)


def polynomial(n, derivative, s):
    c = np.polynomial.legendre.leg2poly(np.polynomial.legendre.legder([0] * n + [1], derivative))
    return sum(np.longdouble(each) * s**k for k, each in enumerate(c))


def pulled(zonals, p):
    """Return the acceleration at p (..., 3) by a point mass and the one by the harmonics."""
    p = p.astype(np.longdouble)
    r = np.sqrt(np.square(p).sum(axis=-1))
    s, bulge = p[..., 2] / r, np.zeros_like(p)
    for n, J in enumerate(zonals, start=2):
        size = np.longdouble(MU_M3_S2) / r**3 * np.longdouble(J) * (RADIUS_M / r) ** n
        bulge += (size * polynomial(n + 1, 1, s))[..., None] * p
        bulge[..., 2] -= size * r * polynomial(n, 1, s)
    return -np.longdouble(MU_M3_S2) / r[..., None] ** 3 * p, bulge


def collocated(slope, r, v, h):
    """Return position and velocity after a part of a step, and the nodes of the last sweep; slope(j, r) at node j."""
    r, v = r.astype(np.longdouble), v.astype(np.longdouble)
    line = r + h * RULE.nodes[:, None] * v
    nodes, f = line, np.zeros_like(line)
    for sweep in range(RULE.sweeps):
        if sweep:
            nodes = line + h * h * RULE.inner @ f
        f = np.stack([slope(j, each) for j, each in enumerate(nodes)])
    return r + h * v + h * h * RULE.position @ f, v + h * RULE.velocity @ f, nodes


def orbit_step(zonals, x):
    """Return a state (6,) after a step, and the nodes (parts, s, 3)."""
    r, v, nodes = x[:3], x[3:], []
    for _ in range(PARTS):
        r, v, there = collocated(lambda j, p: sum(pulled(zonals, p)), r, v, STEP / PARTS)
        nodes.append(there)
    return np.concatenate([r, v]), np.stack(nodes)


def orbit_frame(zonals, x):
    r, v = x[:3], x[3:]
    h = np.cross(r, v)
    R, N = r / np.sqrt(r @ r), h / np.sqrt(h @ h)
    tilt = np.sqrt(r @ r) * (sum(pulled(zonals, r)) @ N) / np.sqrt(h @ h)
    return np.stack([R, np.cross(N, R), N]), np.array([tilt, 0, np.sqrt(h @ h) / (r @ r)])


def slopes(step, x, sizes):
    """Return the Jacobian (6, 6) by central differences."""
    columns = []
    for j, size in enumerate(sizes):
        aside = np.zeros(6, dtype=np.longdouble)
        aside[j] = size
        columns.append((step(x + aside) - step(x - aside)) / (2 * size))
    return np.stack(columns, axis=1).astype(float)
