"""A time-correlated acceleration over one step of linear relative motion, in closed form.

With beta = 1 / tau the state moves by x' = A x + b a and the acceleration by a' = -beta a + w, w white with density
q = 2 sigma^2 beta, so that a keeps its standard deviation sigma. An acceleration 1 at the start of a step has moved x
by psi(t) = (A + beta I)^-1 (exp(A t) b - exp(-beta t) b) at its time t, and the noise of the step is
q int [psi; exp(-beta t)] [psi; exp(-beta t)]^T dt. Each part of it is known: int exp(A t) b b^T exp(A t)^T dt = W is
the noise of white acceleration of density 1, and int exp(A t) exp(-beta t) dt is another resolvent.

Where tau tends to 0 the resolvent tends to tau I and the noise to 2 sigma^2 tau W: white acceleration.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, expm1

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.process_noise import ACTS_ON_VELOCITY

LEAST_TAUS = 2.0
"""Correlation times in a step below which the resolvents' terms cancel; the power series of the whole does not."""
TERMS = 40
"""Of the power series, whose argument is below 2, or the angle that the orbit turns in a step: 6.3^40 / 40! < 1e-15."""


@dataclass(frozen=True)
class CorrelatedAcceleration:
    """A first-order Gauss-Markov acceleration on one RTN axis (Tapley, Schutz and Born, 2004, section 4.9).

    Attributes:
        axis: 0 radial, 1 along-track, 2 orbit normal.
        sigma_m_s2: Its standard deviation, m/s^2.
        tau_s: Its correlation time, s.
    """

    axis: int
    sigma_m_s2: float
    tau_s: float

    def over_step(self, A: Array, step_s: float) -> tuple[Array, Array]:
        """Return what an acceleration 1 at the start makes of [x; a] in a step, (7,), and the noise Q, (7, 7).

        Args:
            A: System matrix of position and velocity, (6, 6), 1/s.
            step_s: The step, s.
        """
        b = ACTS_ON_VELOCITY[:, self.axis]
        beta = 1 / self.tau_s
        moved = _together if step_s * beta < LEAST_TAUS else _by_resolvents
        end, Q = moved(A, b, beta, step_s)
        Q *= 2 * self.sigma_m_s2**2 * beta
        return end, (Q + Q.T) / 2


def _by_resolvents(A: Array, b: Array, beta: float, t: float) -> tuple[Array, Array]:
    n = len(A)
    unit = np.eye(n)
    faded = exp(-beta * t)
    both_faded = -expm1(-2 * beta * t) / (2 * beta)  # int exp(-2 beta t) dt
    pushed, W = _power_series(A, b, t)
    resolvent = np.linalg.inv(A + beta * unit)
    fading = np.linalg.solve(A - beta * unit, faded * pushed - b)  # int exp(A t) b exp(-beta t) dt
    crossed = np.outer(fading, b)
    Q = np.empty((n + 1, n + 1))
    Q[:n, :n] = resolvent @ (W - crossed - crossed.T + both_faded * np.outer(b, b)) @ resolvent.T
    Q[:n, n] = Q[n, :n] = resolvent @ (fading - both_faded * b)
    Q[n, n] = both_faded
    return np.append(resolvent @ (pushed - faded * b), faded), Q


def _together(A: Array, b: Array, beta: float, t: float) -> tuple[Array, Array]:
    n = len(A)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n], whole[n, n] = A, b, -beta
    return _power_series(whole, np.eye(n + 1)[n], t)


def _power_series(A: Array, b: Array, t: float) -> tuple[Array, Array]:
    """Return exp(A t) b, (n,), and the integral of exp(A s) b (exp(A s) b)^T from 0 to t, (n, n).

    With c_k = A^k b t^k / k! they are the sum of c_k, and t times the sum of c_j c_k^T / (j + k + 1).
    """
    c = np.empty((TERMS, len(b)))
    c[0] = b
    for k in range(1, TERMS):
        c[k] = A @ c[k - 1] * (t / k)
    order = np.arange(TERMS)
    return c.sum(axis=0), t * (c.T @ (1 / (order[:, None] + order + 1)) @ c)
