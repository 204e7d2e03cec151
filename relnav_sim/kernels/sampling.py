"""Gaussians by weighted samples: whitening where a measurement looks, weights, and moments.

Samples lie along the last axis, so that the innermost loops go over those of one run. Kernels that end
in `_single` compute in float32, the others in float64.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.kernels.compiling import given, inlined, inner, integer, kernel, kernel_like, single
from relnav_sim.kernels.elementary import exp_of_loss, fused
from relnav_sim.kernels.lanes import LANES, factor, forward, load, load_vectors, store, store_symmetric, store_vectors

CHUNK = 4 * LANES
"""Samples at a time: four for every sum that is kept, which saves most of the trips of the sums to the cache."""
SAMPLES = 8 * LANES
"""Samples at a time where nothing is summed over them."""
INDEPENDENT, PAIRED, EXACT = 0, 1, 2
"""Samples of their own, in pairs +e and -e (the second half), or a set whose mean and covariance are exact."""


@kernel(given(3), given(1, integer))
def whitened(P: Array, observed: Indices) -> tuple[Array, Array]:
    """Return G^T = L^-1 P_o (runs, d, n) and P - G G^T (runs, n, n), of which the observed part is zero.

    Args:
        P: Covariances (runs, n, n).
        observed: Numbers of the observed states (d,); P_o are these rows of P, L L^T their block on the diagonal.
    """
    runs, n, _ = P.shape
    d = len(observed)
    roots, remainder = np.empty((runs, d, n), P.dtype), np.empty((runs, n, n), P.dtype)
    p, g = np.empty((n, n, LANES), P.dtype), np.empty((d, n, LANES), P.dtype)
    block, L = np.empty((d, d, LANES), P.dtype), np.zeros((d, d, LANES), P.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load(P, first, used, p)
        split(p, observed, used, block, L, g)
        store(g, first, used, roots)
        store_symmetric(p, first, used, remainder)
    return roots, remainder


@inner
def split(p: Array, observed: Indices, used: int, block: Array, L: Array, g: Array) -> None:
    """Do as `whitened` in lanes: set g (d, n) to G^T and the lower triangle of p (n, n) to P - G G^T.

    Room are block (d, d) and L (d, d), which is zero above its diagonal.
    """
    d, n, _ = g.shape
    for i in range(d):
        for j in range(n):
            for b in range(used):
                g[i, j, b] = p[observed[i], j, b]
        for j in range(d):
            for b in range(used):
                block[i, j, b] = p[observed[i], observed[j], b]
    factor(block, used, L)
    forward(L, used, g)
    for i in range(n):
        for j in range(i + 1):
            for k in range(d):
                for b in range(used):
                    p[i, j, b] -= g[k, i, b] * g[k, j, b]
    for k in range(d):
        for j in range(n):
            for b in range(used):
                p[observed[k], j, b] = p[j, observed[k], b] = 0.0


@kernel(given(2), given(3), given(3), given(2), given(3))
def regressed(m: Array, roots: Array, remainder: Array, a: Array, C: Array) -> tuple[Array, Array]:
    """Return m + G a (runs, n) and G C G^T + remainder (runs, n, n), the Gaussian that N(a, C) of the observed gives.

    Args:
        m: Means (runs, n).
        roots: G^T (runs, d, n), from `whitened`, as the remainder (runs, n, n).
        remainder: Covariance of what is not observed.
        a: Means (runs, d) in whitened coordinates.
        C: Their covariances (runs, d, d), symmetric.
    """
    runs, d, n = roots.shape
    mean, covariance = np.empty((runs, n), m.dtype), np.empty((runs, n, n), m.dtype)
    x, y, g = np.empty((n, LANES), m.dtype), np.empty((d, LANES), m.dtype), np.empty((d, n, LANES), m.dtype)
    c, cg, p = np.empty((d, d, LANES), m.dtype), np.empty((d, n, LANES), m.dtype), np.empty((n, n, LANES), m.dtype)
    for first in range(0, runs, LANES):
        used = min(LANES, runs - first)
        load_vectors(m, first, used, x)
        load_vectors(a, first, used, y)
        load(roots, first, used, g)
        load(C, first, used, c)
        load(remainder, first, used, p)
        regress(g, y, c, used, cg, x, p)
        store_vectors(x, first, used, mean)
        store_symmetric(p, first, used, covariance)
    return mean, covariance


@inner
def regress(g: Array, a: Array, C: Array, used: int, cg: Array, x: Array, p: Array) -> None:
    """Do as `regressed` in lanes: add G a to x (n,), G C G^T to the lower triangle of p (n, n); cg (d, n) is room."""
    d, n, _ = g.shape
    cg[:] = 0.0
    for k in range(d):
        for i in range(n):
            for b in range(used):
                x[i, b] += g[k, i, b] * a[k, b]
            for j in range(d):
                for b in range(used):
                    cg[k, i, b] += C[k, j, b] * g[j, i, b]
    for i in range(n):
        for j in range(i + 1):
            for k in range(d):
                for b in range(used):
                    p[i, j, b] += g[k, i, b] * cg[k, j, b]


@kernel(given(3), given(3))
def squared(r: Array, W: Array) -> Array:
    """Return |W r|^2 (runs, N) of residuals r (runs, m, N), W (runs or 1, m, m) lower triangular."""
    runs, m, N = r.shape
    errors = np.empty((runs, N), r.dtype)
    part = np.empty((m, SAMPLES), r.dtype)
    for run in range(runs):
        for first in range(0, N, SAMPLES):
            used = min(SAMPLES, N - first)
            for i in range(m):
                residual = r[run, i, first : first + used]
                for b in range(used):
                    part[i, b] = residual[b]
            add_squares(part, used, W[0 if len(W) == 1 else run], errors[run, first : first + used])
    return errors


@kernel(given(2), given(3), given(3), given(3))
def squared_linear(r: Array, A: Array, W: Array, e: Array) -> Array:
    """Return |W (r - A e)|^2 (runs, N) of residuals r (runs, m) at the centre of samples e (runs or 1, d, N).

    Args:
        r: (runs, m).
        A: How far samples move the measurement, (runs, m, d).
        W: Whitening (runs or 1, m, m), lower triangular.
        e: Samples (runs or 1, d, N).
    """
    runs, N = len(r), e.shape[2]
    errors, white = np.empty((runs, N)), np.empty(SAMPLES)
    for run in range(runs):
        w, samples = W[0 if len(W) == 1 else run], e[0 if len(e) == 1 else run]
        square_linear(r[run], A[run], w, samples, white, errors[run])
    return errors


@inner
def square_linear(r: Array, A: Array, W: Array, e: Array, white: Array, errors: Array) -> None:
    """Do as `squared_linear` for one run, errors (N,); white (SAMPLES,) is room."""
    m, d = A.shape
    N = len(errors)
    for first in range(0, N, SAMPLES):
        used = min(SAMPLES, N - first)
        out = errors[first : first + used]
        for b in range(used):
            out[b] = 0.0
        for i in range(m):
            centre = 0.0
            for j in range(i + 1):
                centre += W[i, j] * r[j]
            for b in range(used):
                white[b] = centre
            for k in range(d):
                slope = 0.0
                for j in range(i + 1):
                    slope += W[i, j] * A[j, k]
                part = e[k, first : first + used]
                for b in range(used):
                    white[b] -= slope * part[b]
            for b in range(used):
                out[b] += white[b] * white[b]


@inner
def add_squares(r: Array, used: int, W: Array, errors: Array) -> None:
    """Set errors to |W r|^2 of residuals r (m, SAMPLES), which are lost; W lower triangular."""
    for b in range(used):
        errors[b] = 0.0
    for i in range(len(W) - 1, -1, -1):
        for b in range(used):
            r[i, b] *= W[i, i]
        for j in range(i):
            if W[i, j] != 0:
                for b in range(used):
                    r[i, b] += W[i, j] * r[j, b]
        for b in range(used):
            errors[b] += r[i, b] * r[i, b]


@kernel(given(2), given(3), integer, wide=True)
def moments(costs: Array, e: Array, kind: int) -> tuple[Array, Array, Array]:
    """Return weighted mean (runs, d) and covariance (runs, d, d) of samples, and the effective sample size (runs,).

    The covariance of independent samples is shrunk by the mean's own sampling error; 1 / (1 - sum w^2) undoes it,
    exactly for flat weights and at most 1/ESS too large for others. A pair +e, -e moves the mean by the difference of
    its weights. A set with exact moments gets no factor: above 1 it would act as fading memory.

    Args:
        costs: Minus the logarithm of the weights, to a constant, (runs, N).
        e: Samples (runs or 1, d, N).
        kind: INDEPENDENT, PAIRED or EXACT.
    """
    runs, N = costs.shape
    d = e.shape[1]
    mean, covariance, ess = np.empty((runs, d), e.dtype), np.empty((runs, d, d), e.dtype), np.empty(runs, e.dtype)
    w = np.zeros((N + CHUNK - 1) // CHUNK * CHUNK, e.dtype)
    x, wx = np.empty((d, CHUNK), e.dtype), np.empty(CHUNK, e.dtype)
    sums, squares = np.empty((1 + d + d * (d + 1) // 2, LANES), e.dtype), np.empty(LANES, e.dtype)
    for run in range(runs):
        samples = e[0 if len(e) == 1 else run]
        ess[run] = take_moments(costs[run], samples, kind, w, x, wx, sums, squares, mean[run], covariance[run])
    return mean, covariance, ess


@inner
def take_moments(
    costs: Array,
    e: Array,
    kind: int,
    w: Array,
    x: Array,
    wx: Array,
    sums: Array,
    squares: Array,
    mean: Array,
    covariance: Array,
) -> float:
    """Set mean (d,) and covariance (d, d) of one run to what `moments` says; return the effective sample size.

    Args:
        costs: (N,).
        e: Samples (d, N).
        kind: As for `moments`.
        w: Room for the weights: N, to the next multiple of CHUNK, zero behind the last.
        x: Room (d, CHUNK).
        wx: Room (CHUNK,).
        sums: Room (1 + d + d (d + 1) / 2, LANES).
        squares: Room (LANES,).
        mean: Is set.
        covariance: Is set.
    """
    d, N = e.shape
    _weights(costs, w)
    sums[:] = 0.0
    squares[:] = 0.0
    whole = N - N % CHUNK
    for first in range(0, whole, CHUNK):
        _add_moments(w[first : first + CHUNK], e, first, wx, sums, squares)
    if whole < N:
        _gather(e, whole, N - whole, x)
        _add_moments(w[whole:], x, 0, wx, sums, squares)
    total = _sum(sums[0])
    shares = _sum(squares) / (total * total)
    correction = 1.0
    if kind == INDEPENDENT:
        correction = 1 / (1 - shares)
    elif kind == PAIRED:
        moved = 0.0
        for n in range(N // 2):
            moved += (w[n] - w[n + N // 2]) ** 2
        correction = 1 / (1 - moved / (total * total))
    row = 1 + d
    for i in range(d):
        mean[i] = _sum(sums[1 + i]) / total
        for j in range(i + 1):
            entry = (_sum(sums[row]) / total - mean[i] * mean[j]) * correction
            covariance[i, j] = covariance[j, i] = entry
            row += 1
    return 1 / shares


@inner
def _weights(costs: Array, w: Array) -> None:
    """Set the first of w to the weights (N,), the largest 1."""
    N = len(costs)
    least = np.full(LANES, math.inf)
    for first in range(0, N, LANES):
        part = costs[first : first + LANES]
        for b in range(len(part)):
            least[b] = least[b] if least[b] < part[b] else part[b]
    lowest = math.inf
    for b in range(LANES):
        lowest = lowest if lowest < least[b] else least[b]
    for n in range(N):
        w[n] = exp_of_loss(lowest - costs[n])


@inner
def _add_moments(weight: Array, x: Array, first: int, wx: Array, sums: Array, squares: Array) -> None:
    """Add to the sums what CHUNK samples x (d, more) from `first` on give, and to `squares` those of their weights.

    The sums are those of the weights, of w x by state, and of w x x^T by entry of its lower triangle; wx (CHUNK,) is
    room.
    """
    d = len(x)
    _add(weight, sums[0])
    _add_product(weight, weight, 0, squares)
    row = 1 + d
    for i in range(d):
        for b in range(CHUNK):
            wx[b] = weight[b] * x[i, first + b]
        _add(wx, sums[1 + i])
        for j in range(i + 1):
            _add_product(wx, x[j], first, sums[row])
            row += 1


@inner
def _gather(samples: Array, first: int, used: int, x: Array) -> None:
    """Set x (d, CHUNK) to samples (d, N) from `first` on; zero behind the last, where weights are zero too."""
    for i in range(len(x)):
        part = samples[i, first : first + used]
        for b in range(used):
            x[i, b] = part[b]
        for b in range(used, CHUNK):
            x[i, b] = 0.0


@inlined
def _add(a: Array, sums: Array) -> None:
    """Add numbers (CHUNK,) to sums (LANES,)."""
    for b in range(LANES):
        sums[b] += (a[b] + a[b + LANES]) + (a[b + 2 * LANES] + a[b + 3 * LANES])


@inlined
def _add_product(a: Array, c: Array, first: int, sums: Array) -> None:
    """Add products of numbers (CHUNK,) and of as many from `first` on to sums (LANES,)."""
    for b in range(LANES):
        total = fused(a[b], c[first + b], sums[b])
        total = fused(a[b + LANES], c[first + b + LANES], total)
        total = fused(a[b + 2 * LANES], c[first + b + 2 * LANES], total)
        sums[b] = fused(a[b + 3 * LANES], c[first + b + 3 * LANES], total)


@inner
def _sum(a: Array) -> float:
    """Return the sum of numbers (LANES,)."""
    total = 0.0
    for b in range(LANES):
        total += a[b]
    return total


@kernel_like(whitened, given(3, single), given(1, integer))
def whitened_single(P: Array, observed: Indices) -> tuple[Array, Array]:
    """Return the same as `whitened`."""
    return P, P


@kernel_like(regressed, given(2, single), given(3, single), given(3, single), given(2, single), given(3, single))
def regressed_single(m: Array, roots: Array, remainder: Array, a: Array, C: Array) -> tuple[Array, Array]:
    """Return the same as `regressed`."""
    return m, C


@kernel_like(squared, given(3, single), given(3, single))
def squared_single(r: Array, W: Array) -> Array:
    """Return the same as `squared`."""
    return r


@kernel_like(moments, given(2, single), given(3, single), integer)
def moments_single(costs: Array, e: Array, kind: int) -> tuple[Array, Array, Array]:
    """Return the same as `moments`; sums are kept in float32, and four terms at a time are added up in float64."""
    return costs, costs, costs
