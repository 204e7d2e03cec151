"""Prediction by a Gaussian process (Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, ch. 2).

Up to `POINTS` points lie side by side. Each has its own sums, in one order, so its bits do not depend on the others.
"""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import flag, given, inner, kernel
from relnav_sim.kernels.elementary import exp, fused

POINTS = 64
"""Points side by side: more than `LANES`, because a number of the whitener then serves more of them."""
FEW = 8
"""So many points cost less one by one."""
WIDEST = 16
"""Numbers that a loop takes at once: other counts are rounded up to a multiple, because single ones take as long."""


@kernel(given(2), given(1), given(1), given(2), given(2), given(2), flag, flag)
def predict(
    points: Array,
    centre: Array,
    length: Array,
    inputs: Array,
    weights: Array,
    whitener: Array,
    with_mean: bool,
    with_variance: bool,
) -> tuple[Array, Array]:
    """Return the means of the standardised outputs, (P, q), and what share of the variance the data explain, (P,).

    With the correlations c(x) = exp(-|x - x_s|^2 / 2) to the training inputs these are W^T c and |L^-1 c|^2 (Rasmussen
    and Williams, eqs. 2.25 and 2.26, algorithm 2.1). What is not asked for counts for nothing.

    Args:
        points: (P, d).
        centre: Taken from each point, (d,).
        length: By which it is divided then, (d,).
        inputs: Training inputs in lengths, (S, d).
        weights: W, (S, q).
        whitener: L^-1, lower triangular, (S, S).
        with_mean: Whether the means are asked for.
        with_variance: Whether the explained shares are.
    """
    P, d = points.shape
    S, q = weights.shape
    means, explained = np.zeros((P, q)), np.zeros(P)
    x, c, one = np.zeros((d, POINTS)), np.zeros((S, POINTS)), np.empty(S)
    mean, white, share = np.empty((q, POINTS)), np.empty((4, POINTS)), np.empty(POINTS)
    for first in range(0, P, POINTS):
        used = min(POINTS, P - first)
        width = used if used < FEW else (used + WIDEST - 1) // WIDEST * WIDEST
        scale(points, first, used, centre, length, x)
        correlate(x, width, inputs, c)
        if with_mean:
            weigh(weights, c, width, mean)
            for b in range(used):
                for j in range(q):
                    means[first + b, j] = mean[j, b]
        if with_variance:
            if used < FEW:
                for b in range(used):
                    for s in range(S):
                        one[s] = c[s, b]
                    explained[first + b] = square_of_white(whitener, one)
            else:
                squares_of_white(whitener, c, white, share)
                for b in range(used):
                    explained[first + b] = share[b]
    return means, explained


@kernel(given(2), given(1), given(1), given(2), given(2))
def slopes(points: Array, centre: Array, length: Array, inputs: Array, weights: Array) -> Array:
    """Return the derivatives of the means with respect to the points in lengths, (P, q, d); arguments as above.

    The derivative of c_s is c_s (x_s - x).
    """
    P, d = points.shape
    S, q = weights.shape
    found = np.empty((P, q, d))
    x, c = np.zeros((d, POINTS)), np.empty((S, POINTS))
    dc, sums = np.empty((S, POINTS)), np.empty((q, POINTS))
    for first in range(0, P, POINTS):
        used = min(POINTS, P - first)
        scale(points, first, used, centre, length, x)
        correlate(x, used, inputs, c)
        for i in range(d):
            for s in range(S):
                for b in range(used):
                    dc[s, b] = c[s, b] * (inputs[s, i] - x[i, b])
            weigh(weights, dc, used, sums)
            for b in range(used):
                for j in range(q):
                    found[first + b, j, i] = sums[j, b]
    return found


@inner
def scale(points: Array, first: int, used: int, centre: Array, length: Array, x: Array) -> None:
    """Set the lanes x (d, POINTS) to points (P, d) from `first` on, less the centre and in lengths."""
    for b in range(used):
        for i in range(len(centre)):
            x[i, b] = (points[first + b, i] - centre[i]) / length[i]


@inner
def correlate(x: Array, used: int, inputs: Array, c: Array) -> None:
    """Set c (S, POINTS) to exp(-|x - x_s|^2 / 2) of points x (d, POINTS) and inputs (S, d)."""
    if used < FEW:
        for b in range(used):
            for s in range(len(inputs)):
                square = 0.0
                for i in range(len(x)):
                    offset = x[i, b] - inputs[s, i]
                    square = fused(offset, offset, square)
                c[s, b] = exp(-0.5 * square)
        return
    for s in range(len(inputs)):
        for b in range(used):
            c[s, b] = 0.0
        for i in range(len(x)):
            for b in range(used):
                offset = x[i, b] - inputs[s, i]
                c[s, b] = fused(offset, offset, c[s, b])
        for b in range(used):
            c[s, b] = exp(-0.5 * c[s, b])


@inner
def weigh(W: Array, c: Array, used: int, mean: Array) -> None:
    """Set mean (q, POINTS) to W^T c, W (S, q), c (S, POINTS)."""
    S = len(W)
    mean[:] = 0.0
    for s in range(0, S - S % 4, 4):
        for j in range(len(mean)):
            w0, w1, w2, w3 = W[s, j], W[s + 1, j], W[s + 2, j], W[s + 3, j]
            for b in range(used):
                mean[j, b] = fused(
                    w3, c[s + 3, b], fused(w2, c[s + 2, b], fused(w1, c[s + 1, b], fused(w0, c[s, b], mean[j, b])))
                )
    for s in range(S - S % 4, S):
        for j in range(len(mean)):
            for b in range(used):
                mean[j, b] = fused(W[s, j], c[s, b], mean[j, b])


@inner
def squares_of_white(A: Array, c: Array, white: Array, share: Array) -> None:
    """Set share (POINTS,) to |A c|^2, A (S, S) lower triangular, c (S, POINTS).

    Sixteen numbers of A stay in registers while the points pass by; all of the lanes do, used or not, because a loop
    of known length is a tenth faster.
    """
    S = len(A)
    share[:] = 0.0
    for i in range(0, S - S % 4, 4):
        white[:] = 0.0
        for k in range(0, i + 4, 4):
            a00, a01, a02, a03 = A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3]
            a10, a11, a12, a13 = A[i + 1, k], A[i + 1, k + 1], A[i + 1, k + 2], A[i + 1, k + 3]
            a20, a21, a22, a23 = A[i + 2, k], A[i + 2, k + 1], A[i + 2, k + 2], A[i + 2, k + 3]
            a30, a31, a32, a33 = A[i + 3, k], A[i + 3, k + 1], A[i + 3, k + 2], A[i + 3, k + 3]
            for b in range(POINTS):
                c0, c1, c2, c3 = c[k, b], c[k + 1, b], c[k + 2, b], c[k + 3, b]
                white[0, b] = fused(a03, c3, fused(a02, c2, fused(a01, c1, fused(a00, c0, white[0, b]))))
                white[1, b] = fused(a13, c3, fused(a12, c2, fused(a11, c1, fused(a10, c0, white[1, b]))))
                white[2, b] = fused(a23, c3, fused(a22, c2, fused(a21, c1, fused(a20, c0, white[2, b]))))
                white[3, b] = fused(a33, c3, fused(a32, c2, fused(a31, c1, fused(a30, c0, white[3, b]))))
        for row in range(4):
            for b in range(POINTS):
                share[b] = fused(white[row, b], white[row, b], share[b])
    for i in range(S - S % 4, S):
        white[0] = 0.0
        for k in range(i + 1):
            for b in range(POINTS):
                white[0, b] = fused(A[i, k], c[k, b], white[0, b])
        for b in range(POINTS):
            share[b] = fused(white[0, b], white[0, b], share[b])


@inner
def square_of_white(A: Array, c: Array) -> float:
    """Return |A c|^2 for one point, c (S,), with the sums of `squares_of_white`: four rows at a time."""
    S = len(A)
    share = 0.0
    for i in range(0, S - S % 4, 4):
        w0, w1, w2, w3 = 0.0, 0.0, 0.0, 0.0
        for k in range(i + 4):
            w0, w1 = fused(A[i, k], c[k], w0), fused(A[i + 1, k], c[k], w1)
            w2, w3 = fused(A[i + 2, k], c[k], w2), fused(A[i + 3, k], c[k], w3)
        share = fused(w3, w3, fused(w2, w2, fused(w1, w1, fused(w0, w0, share))))
    for i in range(S - S % 4, S):
        white = 0.0
        for k in range(i + 1):
            white = fused(A[i, k], c[k], white)
        share = fused(white, white, share)
    return share
