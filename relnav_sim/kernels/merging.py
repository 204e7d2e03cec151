"""Gaussian mixtures kept small by merging (Runnalls, IEEE Trans. Aerospace and Electronic Systems 43(3), 2007).

Run by run. What lies side by side as the last axis here are pairs of components of one mixture, up to `LANES`.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array, Indices
from relnav_sim.kernels.compiling import given, inner, integer, kernel
from relnav_sim.kernels.lanes import LANES, factor
from relnav_sim.kernels.scores import log_determinant

_TRIFLE = 1e-12
"""Share of the variances by which singular covariances are widened to compare them, well above their rounding."""
_TINY = float(np.finfo(float).tiny)


@kernel(given(2), given(3), given(4), integer)
def reduce(w: Array, x: Array, P: Array, components: int) -> tuple[Array, Array, Array]:
    """Return weights, means and covariances of so many components, the heaviest first; the mixture's moments stay.

    Greedy: the pair whose merging costs the least goes first. The cost is Runnalls' bound (his eq. 21) on the
    Kullback-Leibler divergence, ((w_i + w_j) log det P_ij - w_i log det P_i - w_j log det P_j) / 2.

    Args:
        w: Weights (runs, c), c > components.
        x: Means (runs, c, n).
        P: Covariances (runs, c, n, n), symmetric.
        components: Number of components to keep.
    """
    runs, c, n = x.shape
    weights, means = np.empty((runs, components)), np.empty((runs, components, n))
    covariances = np.empty((runs, components, n, n))
    weight, mean, covariance = np.empty(c), np.empty((c, n)), np.empty((c, n, n))
    log_det, cost, alive = np.empty(c), np.empty((c, c)), np.empty(c, dtype=np.bool_)
    one, other = np.empty(LANES, dtype=np.int64), np.empty(LANES, dtype=np.int64)
    total, share, apart = np.empty(LANES), np.empty(LANES), np.empty((n, LANES))
    merged, L, found = np.empty((n, n, LANES)), np.zeros((n, n, LANES)), np.empty(LANES)
    for run in range(runs):
        for component in range(c):
            alive[component] = True
            weight[component] = w[run, component]
            for i in range(n):
                mean[component, i] = x[run, component, i]
                for j in range(n):
                    covariance[component, i, j] = P[run, component, i, j]
        used = 0
        for i in range(c):
            one[used] = other[used] = i  # merged with itself a component stays what it is
            used += 1
            if used == LANES or i == c - 1:
                _merge(weight, mean, covariance, one, other, used, total, share, apart, merged)
                _log_determinants(merged, used, L, found)
                for b in range(used):
                    log_det[one[b]] = found[b]
                used = 0
        for i in range(c - 1):
            for j in range(i + 1, c):
                one[used], other[used] = i, j
                used += 1
                if used == LANES or i == c - 2:
                    _merge(weight, mean, covariance, one, other, used, total, share, apart, merged)
                    _log_determinants(merged, used, L, found)
                    _set_costs(weight, log_det, one, other, used, total, found, cost)
                    used = 0
        for _ in range(c - components):
            keep, drop = _cheapest(cost)
            one[0], other[0] = keep, drop
            _merge(weight, mean, covariance, one, other, 1, total, share, apart, merged)
            weight[keep] = total[0]
            for i in range(n):
                mean[keep, i] += share[0] * apart[i, 0]
                for j in range(i + 1):
                    covariance[keep, i, j] = covariance[keep, j, i] = merged[i, j, 0]
            _log_determinants(merged, 1, L, found)
            log_det[keep] = found[0]
            weight[drop], alive[drop] = 0.0, False
            for i in range(c):
                cost[drop, i] = cost[i, drop] = math.inf
            for i in range(c):
                if alive[i] and i != keep:
                    one[used], other[used] = keep, i
                    used += 1
                if used == LANES or (used > 0 and i == c - 1):
                    _merge(weight, mean, covariance, one, other, used, total, share, apart, merged)
                    _log_determinants(merged, used, L, found)
                    _set_costs(weight, log_det, one, other, used, total, found, cost)
                    used = 0
        for place in range(components):
            heaviest = -1
            for i in range(c):
                if alive[i] and (heaviest < 0 or weight[i] > weight[heaviest]):
                    heaviest = i
            alive[heaviest] = False
            weights[run, place] = weight[heaviest]
            for i in range(n):
                means[run, place, i] = mean[heaviest, i]
                for j in range(n):
                    covariances[run, place, i, j] = covariance[heaviest, i, j]
    return weights, means, covariances


@inner
def _merge(
    weight: Array,
    mean: Array,
    covariance: Array,
    one: Indices,
    other: Indices,
    used: int,
    total: Array,
    share: Array,
    apart: Array,
    merged: Array,
) -> None:
    """Set of every pair the weight, the other's share of it, how far the means are apart, and the covariance."""
    for b in range(used):
        total[b] = weight[one[b]] + weight[other[b]]
        # Two components that weigh nothing merge like equals.
        share[b] = weight[other[b]] / total[b] if total[b] > 0 else 0.5
    for i in range(len(apart)):
        for b in range(used):
            apart[i, b] = mean[other[b], i] - mean[one[b], i]
        for j in range(i + 1):
            for b in range(used):
                merged[i, j, b] = (
                    share[b] * covariance[other[b], i, j]
                    + (1 - share[b]) * covariance[one[b], i, j]
                    + share[b] * (1 - share[b]) * apart[i, b] * apart[j, b]
                )


@inner
def _log_determinants(P: Array, used: int, L: Array, found: Array) -> None:
    """Set log det of P (n, n); a singular matrix gets a trifle of its variances first, and is written to."""
    factor(P, used, L)
    singular = False
    for b in range(used):
        found[b] = log_determinant(L, b)
        singular |= not math.isfinite(found[b])
    if not singular:
        return
    for i in range(len(P)):
        for b in range(used):
            if not math.isfinite(found[b]):
                P[i, i, b] += P[i, i, b] * _TRIFLE + _TINY
    factor(P, used, L)
    for b in range(used):
        found[b] = log_determinant(L, b)


@inner
def _set_costs(
    weight: Array, log_det: Array, one: Indices, other: Indices, used: int, total: Array, found: Array, cost: Array
) -> None:
    """Set the cost of merging each pair; in a broken run it stays infinite."""
    for b in range(used):
        i, j = one[b], other[b]
        bound = 0.5 * (total[b] * found[b] - weight[i] * log_det[i] - weight[j] * log_det[j])
        cost[min(i, j), max(i, j)] = bound if bound < math.inf else math.inf


@inner
def _cheapest(cost: Array) -> tuple[int, int]:
    """Return the pair i < j that costs the least."""
    keep, drop = 0, 1
    for i in range(len(cost)):
        for j in range(i + 1, len(cost)):
            if cost[i, j] < cost[keep, drop]:
                keep, drop = i, j
    return keep, drop
