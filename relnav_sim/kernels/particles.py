"""Many weighted particles a run: moving them, weighing them, and their moments.

Particles are stored component by component, (runs, n, N), so that they lie side by side as they are. Loops go over
`BLOCK` of them at a time, which stay in the processor's fastest cache from one step to the next; a sum over particles
has a partial sum for each place in the block.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.kernels.compiling import given, inner, kernel, number, written
from relnav_sim.kernels.elementary import exp
from relnav_sim.kernels.lanes import LANES, factor, load

BLOCK = 64


@kernel(given(3), given(3), given(2))
def affine(x: Array, F: Array, c: Array) -> Array:
    """Return F x + c of every particle, (runs, n, N).

    Args:
        x: Particles (runs, n, N).
        F: (runs, n, n), or (1, n, n) for all runs.
        c: (runs, n).
    """
    runs, n, N = x.shape
    moved = np.empty((runs, n, N))
    for run in range(runs):
        f = F[run if len(F) > 1 else 0]
        for i in range(n):
            for p in range(N):
                moved[run, i, p] = c[run, i]
            _add_product(f[i], x[run], moved[run, i])
    return moved


@kernel(written(3), given(4), given(3))
def add_noise(x: Array, G: Array, xi: Array) -> None:
    """Add G xi to every particle x, (runs, n, N).

    Args:
        x: (runs, n, N), written to.
        G: (1, 1, n, r), (runs, 1, n, r), or (runs, N, n, r) with one for each particle.
        xi: (runs, r, N).
    """
    runs, n, N = x.shape
    for run in range(runs):
        g = G[run if len(G) > 1 else 0]
        if len(g) == 1:
            for i in range(n):
                _add_product(g[0, i], xi[run], x[run, i])
        else:
            for p in range(N):
                for i in range(n):
                    for j in range(xi.shape[1]):
                        x[run, i, p] += g[p, i, j] * xi[run, j, p]


@inner
def _add_product(row: Array, x: Array, out: Array) -> None:
    """Add row x to out (N,); row (n,), x (n, N). Zeros of the row cost nothing."""
    for j in range(len(row)):
        factor = row[j]
        if factor != 0:
            for p in range(len(out)):
                out[p] += factor * x[j, p]


@kernel(given(3))
def roots(Q: Array) -> tuple[Array, Mask]:
    """Return lower triangular G with G G^T = Q, and where Q is positive definite to six digits, else G does not count.

    G is the Cholesky factor of the correlations times the standard deviations: scaling first keeps all digits where
    metres and metres per second, or tiny and large noises, share a matrix.

    Args:
        Q: Covariances (count, n, n).
    """
    count, n, _ = Q.shape
    G, regular = np.zeros((count, n, n)), np.empty(count, dtype=np.bool_)
    q, L, deviation = np.empty((n, n, LANES)), np.zeros((n, n, LANES)), np.empty((n, LANES))
    for first in range(0, count, LANES):
        used = min(LANES, count - first)
        load(Q, first, used, q)
        for i in range(n):
            for b in range(used):
                deviation[i, b] = math.sqrt(q[i, i, b]) if q[i, i, b] != 0 else 1.0
        for i in range(n):
            for j in range(i + 1):
                for b in range(used):
                    q[i, j, b] /= deviation[i, b] * deviation[j, b]
        factor(q, used, L)
        for b in range(used):
            regular[first + b] = True
            for i in range(n):
                # A pivot below is rounding, not variance.
                regular[first + b] &= L[i, i, b] > 1e-6
                for j in range(i + 1):
                    G[first + b, i, j] = deviation[i, b] * L[i, j, b]
    return G, regular


@kernel(given(3), given(2), given(2))
def weigh(x: Array, log_weights: Array, log_factors: Array) -> tuple[Array, Array, Array, Array, Array, Mask]:
    """Return normalised log-weights (runs, N), mean (runs, n), covariance (runs, n, n), evidence, ESS and lost runs.

    The evidence's logarithm is that of the weighted mean factor, (runs,); the effective sample size is 1 / sum w^2
    (Kong, Liu and Wong, JASA 89, 1994). A particle whose factor is no density, NaN or infinite, weighs nothing and
    adds nothing to the moments whatever its state; the last array says which runs have one. Without any other
    particle everything is NaN.

    Args:
        x: Particles (runs, n, N).
        log_weights: The logarithms of what they weighed before, normalised, (runs, N).
        log_factors: Logarithms of what each weight is multiplied by, (runs, N).
    """
    runs, n, N = x.shape
    weighed, mean, covariance = np.empty((runs, N)), np.empty((runs, n)), np.empty((runs, n, n))
    evidence, ess, lost = np.empty(runs), np.empty(runs), np.empty(runs, dtype=np.bool_)
    w = np.empty(N)
    for run in range(runs):
        highest, lowest = _add_logarithms(log_weights[run], 1.0, log_factors[run], weighed[run])
        total, squares = exponentials(weighed[run], highest, w)
        evidence[run] = highest + math.log(total)
        ess[run] = total * total / squares
        lost[run] = lowest == -math.inf
        for p in range(N):
            weighed[run, p] -= evidence[run]
            w[p] /= total
        moments_of(x[run], w, mean[run], covariance[run])
    return weighed, mean, covariance, evidence, ess, lost


@kernel(given(2), given(2), given(1), number)
def power_that_leaves_half(log_weights: Array, score: Array, most: Array, fewest: float) -> Array:
    """Return the powers of the likelihoods exp(score) that halve the number of effective particles, (runs,).

    Zero where the likelihood to the power `most` leaves at least `fewest`; found by bisection.

    Args:
        log_weights: What the particles weigh before, (runs, N); they need not be normalised.
        score: (runs, N).
        most: Upper bounds, (runs,).
        fewest: Number of particles.
    """
    runs, N = score.shape
    power = np.zeros(runs)
    logarithms, w = np.empty(N), np.empty(N)
    for run in range(runs):
        if _tempered_ess(log_weights[run], most[run], score[run], logarithms, w) < fewest:
            wanted = _tempered_ess(log_weights[run], 0.0, score[run], logarithms, w) / 2
            low, high = 0.0, most[run]
            for _ in range(40):
                middle = (low + high) / 2
                if _tempered_ess(log_weights[run], middle, score[run], logarithms, w) < wanted:
                    high = middle
                else:
                    low = middle
            power[run] = high
    return power


@inner
def _tempered_ess(log_weights: Array, power: float, score: Array, logarithms: Array, w: Array) -> float:
    highest, _ = _add_logarithms(log_weights, power, score, logarithms)
    total, squares = exponentials(logarithms, highest, w)
    return total * total / squares


@inner
def _add_logarithms(a: Array, power: float, b: Array, out: Array) -> tuple[float, float]:
    """Set out to a + power b, minus infinity where that is no logarithm of a weight; return the extremes. All (N,)."""
    top, bottom = np.full(BLOCK, -math.inf), np.full(BLOCK, math.inf)
    for first in range(0, len(a), BLOCK):
        a_block, b_block, out_block = a[first : first + BLOCK], b[first : first + BLOCK], out[first : first + BLOCK]
        for p in range(len(out_block)):
            number = a_block[p] + power * b_block[p]
            number = number if number < math.inf else -math.inf
            out_block[p] = number
            top[p] = number if number > top[p] else top[p]
            bottom[p] = number if number < bottom[p] else bottom[p]
    highest, lowest = top[0], bottom[0]
    for p in range(1, BLOCK):
        highest, lowest = max(highest, top[p]), min(lowest, bottom[p])
    return highest, lowest


@inner
def exponentials(logarithms: Array, highest: float, w: Array) -> tuple[float, float]:
    """Set w to exp(logarithms - highest), (N,); return its sum and the sum of its squares."""
    total, squares = np.zeros(BLOCK), np.zeros(BLOCK)
    for first in range(0, len(w), BLOCK):
        given_block, block = logarithms[first : first + BLOCK], w[first : first + BLOCK]
        for p in range(len(block)):
            block[p] = exp(given_block[p] - highest)
        for p in range(len(block)):
            total[p] += block[p]
            squares[p] += block[p] * block[p]
    return total_of(total), total_of(squares)


@inner
def moments_of(x: Array, w: Array, mean: Array, covariance: Array) -> None:
    """Set mean (n,) and covariance (n, n) of particles (n, N) by normalised weights (N,); zero is passed over."""
    n, N = x.shape
    first_sums, second_sums = np.zeros((n, BLOCK)), np.zeros((n, n, BLOCK))
    d, weighted = np.empty((n, BLOCK)), np.empty(BLOCK)
    for first in range(0, N, BLOCK):
        weight = w[first : first + BLOCK]
        for i in range(n):
            x_i = x[i, first : first + BLOCK]
            for p in range(len(weight)):
                first_sums[i, p] += weight[p] * x_i[p] if weight[p] != 0 else 0.0
    for i in range(n):
        mean[i] = total_of(first_sums[i])
    for first in range(0, N, BLOCK):
        weight = w[first : first + BLOCK]
        for i in range(n):
            x_i = x[i, first : first + BLOCK]
            for p in range(len(weight)):
                d[i, p] = x_i[p] - mean[i] if weight[p] != 0 else 0.0
                weighted[p] = weight[p] * d[i, p]
            for j in range(i + 1):
                for p in range(len(weight)):
                    second_sums[i, j, p] += weighted[p] * d[j, p]
    for i in range(n):
        for j in range(i + 1):
            covariance[i, j] = covariance[j, i] = total_of(second_sums[i, j])


@inner
def total_of(partial: Array) -> float:
    """Return the sum of (BLOCK,) partial sums, which are overwritten."""
    half = BLOCK // 2
    while half > 0:
        for c in range(half):
            partial[c] += partial[c + half]
        half //= 2
    return partial[0]
