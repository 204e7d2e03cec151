"""Gaussian mixtures: their moments, how the models of an IMM mix, the measurement they predict, and the new weights.

All of it run by run: the loops over the entries of a covariance are the innermost ones.
"""

from __future__ import annotations

import math

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import given, inner, kernel, written


@kernel(given(2), given(3), given(4))
def moment_match(w: Array, x: Array, P: Array) -> tuple[Array, Array]:
    """Return mean (runs, n) and covariance (runs, n, n) of mixtures.

    Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001, section 1.4.16.

    Args:
        w: Weights (runs, c).
        x: Means (runs, c, n).
        P: Covariances (runs, c, n, n).
    """
    runs, _, n = x.shape
    mean, covariance = np.empty((runs, n)), np.empty((runs, n, n))
    apart = np.empty(n)
    for run in range(runs):
        _match(w[run], x[run], P[run], apart, mean[run], covariance[run])
    return mean, covariance


@kernel(given(2), given(2), given(3), given(4))
def mix(log_weights: Array, chain: Array, x: Array, P: Array) -> tuple[Array, Array, Array]:
    """Return log-weights, means and covariances of k models after a step of the Markov chain that they follow.

    Model j's prior is the mixture of all models i with weights w_i p_ij / sum_i w_i p_ij (Blom and Bar-Shalom, IEEE
    Trans. Automatic Control 33(8), 1988).

    Args:
        log_weights: log w, (runs, k).
        chain: Probabilities p_ij of going from model i to model j, (k, k).
        x: Means (runs, k, n).
        P: Covariances (runs, k, n, n).
    """
    runs, k, n = x.shape
    predicted, means, covariances = np.empty((runs, k)), np.empty((runs, k, n)), np.empty((runs, k, n, n))
    share, apart = np.empty(k), np.empty(n)
    for run in range(runs):
        for j in range(k):
            total = 0.0
            for i in range(k):
                share[i] = math.exp(log_weights[run, i]) * chain[i, j]
                total += share[i]
            for i in range(k):
                share[i] /= total
            predicted[run, j] = math.log(total)
            _match(share, x[run], P[run], apart, means[run, j], covariances[run, j])
    return predicted, means, covariances


@kernel(given(2), given(3), given(4), given(4), given(4))
def expected_reading(w: Array, offsets: Array, H: Array, P: Array, R: Array) -> tuple[Array, Array]:
    """Return mean (runs, m) and covariance S (runs, m, m) of the mixture that a measurement is expected to be from.

    Component i has mean zhat_i and covariance H_i P_i H_i^T + R_i.

    Args:
        w: Weights (runs, c).
        offsets: zhat_i, from wherever the mean shall count, (runs, c, m).
        H: Jacobians (runs, c, m, n).
        P: Covariances (runs, c, n, n).
        R: Measurement noises (runs, c, m, m).
    """
    runs, c, m, n = H.shape
    mean, covariance = np.empty((runs, m)), np.empty((runs, m, m))
    S, row, apart = np.empty((c, m, m)), np.empty(n), np.empty(m)
    for run in range(runs):
        for component in range(c):
            for i in range(m):
                for j in range(n):
                    row[j] = 0.0
                for a in range(n):
                    for j in range(n):
                        row[j] += H[run, component, i, a] * P[run, component, a, j]
                for j in range(i + 1):
                    total = 0.0
                    for a in range(n):
                        total += row[a] * H[run, component, j, a]
                    S[component, i, j] = total + R[run, component, i, j]
                    S[component, j, i] = S[component, i, j]
        _match(w[run], offsets[run], S, apart, mean[run], covariance[run])
    return mean, covariance


@inner
def _match(w: Array, x: Array, P: Array, apart: Array, mean: Array, covariance: Array) -> None:
    """Set mean (n,) and covariance (n, n) of one mixture: sum w_c x_c, and sum w_c (P_c + d d^T), d = x_c - mean."""
    c, n = x.shape
    for i in range(n):
        mean[i] = 0.0
        for component in range(c):
            mean[i] += w[component] * x[component, i]
        for j in range(n):
            covariance[i, j] = 0.0
    for component in range(c):
        for i in range(n):
            apart[i] = x[component, i] - mean[i]
        for i in range(n):
            for j in range(n):
                covariance[i, j] += w[component] * (P[component, i, j] + apart[i] * apart[j])


@kernel(given(2), written(3), written(4), written(2), given(3), given(4))
def reweigh(
    log_prior: Array, x: Array, P: Array, log_likelihood: Array, x_before: Array, P_before: Array
) -> tuple[Array, Array]:
    """Return log-weights (runs, c) after a measurement, and the log of its likelihood (runs,).

    A component whose update gives no number gets back what it was before, and no weight: a weight of zero does not
    keep NaN out of the moments.

    Args:
        log_prior: Log-weights before (runs, c); c = b k, for k noises a component.
        x: Means after (runs, c, n), written to.
        P: Covariances after (runs, c, n, n), written to.
        log_likelihood: (runs, c), written to.
        x_before: Means before (runs, b, n).
        P_before: Covariances before (runs, b, n, n).
    """
    runs, c, n = x.shape
    k = c // x_before.shape[1]
    log_weights, total_log_likelihood = np.empty((runs, c)), np.empty(runs)
    for run in range(runs):
        largest = -math.inf
        for component in range(c):
            total = log_likelihood[run, component]
            for i in range(n):
                total += x[run, component, i]
                for j in range(n):
                    total += P[run, component, i, j]
            if not math.isfinite(total):
                for i in range(n):
                    x[run, component, i] = x_before[run, component // k, i]
                    for j in range(n):
                        P[run, component, i, j] = P_before[run, component // k, i, j]
                log_likelihood[run, component] = -math.inf
            log_weights[run, component] = log_prior[run, component] + log_likelihood[run, component]
            if not log_weights[run, component] <= largest:
                largest = log_weights[run, component]  # also where it is not a number
        total = 0.0
        for component in range(c):
            total += math.exp(log_weights[run, component] - largest)
        total_log_likelihood[run] = largest + math.log(total)
        for component in range(c):
            log_weights[run, component] -= total_log_likelihood[run]
    return log_weights, total_log_likelihood
