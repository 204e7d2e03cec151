"""Textbook steps on matrices of up to `LANES` runs, which lie side by side along the last axis.

The innermost loop goes over the runs in use, 0 to `used`, and touches neighbouring numbers, so that one instruction of
the processor does the same for several runs. Every run sees the same operations in the same order whatever its lane.
A matrix that is not positive definite gives NaN in its own lane.
"""

from __future__ import annotations

import math

from relnav_sim.arrays import Array
from relnav_sim.kernels.compiling import inner

LANES = 32
"""Runs side by side: enough to fill the processor's registers, few enough to stay in its fastest cache."""


@inner
def load_vectors(x: Array, first: int, used: int, out: Array) -> None:
    """Copy vectors (runs, n) of the runs from `first` on to lanes (n, LANES)."""
    for b in range(used):
        for i in range(x.shape[1]):
            out[i, b] = x[first + b, i]


@inner
def store_vectors(x: Array, first: int, used: int, out: Array) -> None:
    """Copy lanes (n, LANES) back to vectors (runs, n)."""
    for b in range(used):
        for i in range(out.shape[1]):
            out[first + b, i] = x[i, b]


@inner
def load(A: Array, first: int, used: int, out: Array) -> None:
    """Copy matrices (runs, p, q), or one (1, p, q) that all runs share, to lanes (p, q, LANES)."""
    if len(A) == 1:
        for i in range(A.shape[1]):
            for j in range(A.shape[2]):
                for b in range(used):
                    out[i, j, b] = A[0, i, j]
        return
    # Four runs at once: less of the time goes into counting.
    whole = used - used % 4
    for b in range(0, whole, 4):
        run = first + b
        for i in range(A.shape[1]):
            for j in range(A.shape[2]):
                out[i, j, b], out[i, j, b + 1] = A[run, i, j], A[run + 1, i, j]
                out[i, j, b + 2], out[i, j, b + 3] = A[run + 2, i, j], A[run + 3, i, j]
    for b in range(whole, used):
        for i in range(A.shape[1]):
            for j in range(A.shape[2]):
                out[i, j, b] = A[first + b, i, j]


@inner
def store(A: Array, first: int, used: int, out: Array) -> None:
    """Copy lanes (p, q, LANES) back to matrices (runs, p, q)."""
    for b in range(used):
        for i in range(out.shape[1]):
            for j in range(out.shape[2]):
                out[first + b, i, j] = A[i, j, b]


@inner
def store_symmetric(A: Array, first: int, used: int, out: Array) -> None:
    """Copy lanes (n, n, LANES), of which the lower triangle counts, back to symmetric matrices (runs, n, n)."""
    for b in range(used):
        for i in range(out.shape[1]):
            for j in range(i + 1):
                out[first + b, i, j] = out[first + b, j, i] = A[i, j, b]


@inner
def copy_vectors(x: Array, used: int, out: Array) -> None:
    """Set out (n,) to x."""
    for i in range(len(x)):
        for b in range(used):
            out[i, b] = x[i, b]


@inner
def mirror(A: Array, used: int, out: Array) -> None:
    """Set out (n, n) to the symmetric matrix whose lower triangle A has."""
    for i in range(out.shape[0]):
        for j in range(i + 1):
            for b in range(used):
                out[i, j, b] = A[i, j, b]
            for b in range(used):
                out[j, i, b] = A[i, j, b]


@inner
def copy(A: Array, used: int, out: Array) -> None:
    """Set out (p, q) to A; an assignment of whole arrays would be compiled for every way they could lie in memory."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            for b in range(used):
                out[i, j, b] = A[i, j, b]


@inner
def product(A: Array, B: Array, used: int, out: Array) -> None:
    """Set out (p, r) to A B of A (p, q), B (q, r).

    Two terms at once, in their order: less of the time goes into loading and storing their sum.
    """
    q = A.shape[1]
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            if q % 2 == 1:
                for b in range(used):
                    out[i, j, b] = A[i, 0, b] * B[0, j, b]
            else:
                for b in range(used):
                    out[i, j, b] = A[i, 0, b] * B[0, j, b] + A[i, 1, b] * B[1, j, b]
            for k in range(2 - q % 2, q, 2):
                for b in range(used):
                    out[i, j, b] = out[i, j, b] + A[i, k, b] * B[k, j, b] + A[i, k + 1, b] * B[k + 1, j, b]


@inner
def product_by_transpose(A: Array, B: Array, used: int, out: Array) -> None:
    """Set out (p, r) to A B^T of A (p, q), B (r, q), as `product` does."""
    q = A.shape[1]
    for i in range(A.shape[0]):
        for j in range(B.shape[0]):
            if q % 2 == 1:
                for b in range(used):
                    out[i, j, b] = A[i, 0, b] * B[j, 0, b]
            else:
                for b in range(used):
                    out[i, j, b] = A[i, 0, b] * B[j, 0, b] + A[i, 1, b] * B[j, 1, b]
            for k in range(2 - q % 2, q, 2):
                for b in range(used):
                    out[i, j, b] = out[i, j, b] + A[i, k, b] * B[j, k, b] + A[i, k + 1, b] * B[j, k + 1, b]


@inner
def add(A: Array, used: int, out: Array) -> None:
    """Add A to out, (p, q) both."""
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            for b in range(used):
                out[i, j, b] += A[i, j, b]


@inner
def add_image(A: Array, x: Array, used: int, y: Array) -> None:
    """Add A x, A (p, q), to y (p,)."""
    for i in range(len(A)):
        for j in range(len(x)):
            for b in range(used):
                y[i, b] += A[i, j, b] * x[j, b]


@inner
def factor(A: Array, used: int, L: Array) -> None:
    """Set the lower triangle of L to the Cholesky factor of A, column by column.

    Golub and Van Loan, Matrix Computations, 4th ed., section 4.2.
    """
    n = len(A)
    for i in range(n):
        for j in range(i + 1):
            for b in range(used):
                L[i, j, b] = A[i, j, b]
    for k in range(n):
        for b in range(used):
            L[k, k, b] = math.sqrt(L[k, k, b])
        for i in range(k + 1, n):
            for b in range(used):
                L[i, k, b] /= L[k, k, b]
        for i in range(k + 1, n):
            for j in range(k + 1, i + 1):
                for b in range(used):
                    L[i, j, b] -= L[i, k, b] * L[j, k, b]


@inner
def forward(L: Array, used: int, X: Array) -> None:
    """Replace X (m, p) by L^-1 X."""
    for i in range(len(L)):
        for j in range(X.shape[1]):
            for k in range(i - 1):
                for b in range(used):
                    X[i, j, b] -= L[i, k, b] * X[k, j, b]
            if i == 0:
                for b in range(used):
                    X[i, j, b] /= L[i, i, b]
            else:
                for b in range(used):
                    X[i, j, b] = (X[i, j, b] - L[i, i - 1, b] * X[i - 1, j, b]) / L[i, i, b]


@inner
def forward_vectors(L: Array, used: int, x: Array) -> None:
    """Replace x (m,) by L^-1 x."""
    for i in range(len(L)):
        for k in range(i):
            for b in range(used):
                x[i, b] -= L[i, k, b] * x[k, b]
        for b in range(used):
            x[i, b] /= L[i, i, b]


@inner
def back(L: Array, used: int, X: Array) -> None:
    """Replace X (m, p) by L^-T X."""
    for i in range(len(L) - 1, -1, -1):
        for j in range(X.shape[1]):
            for k in range(i + 1, len(L)):
                for b in range(used):
                    X[i, j, b] -= L[k, i, b] * X[k, j, b]
            for b in range(used):
                X[i, j, b] /= L[i, i, b]


@inner
def solve(A: Array, used: int, X: Array) -> None:
    """Replace X (m, n) by A^-1 X, by elimination with row exchanges; A is lost, X is NaN where it is singular.

    Golub and Van Loan, Matrix Computations, 4th ed., section 3.4. Lane by lane, for each has its own exchanges.
    """
    m, n, _ = X.shape
    for b in range(used):
        for k in range(m):
            pivot = k
            for i in range(k + 1, m):
                if abs(A[i, k, b]) > abs(A[pivot, k, b]):
                    pivot = i
            # Zero here, it makes all that follows NaN.
            inverse = 1 / A[pivot, k, b] if A[pivot, k, b] != 0 else math.nan
            for j in range(m):
                A[k, j, b], A[pivot, j, b] = A[pivot, j, b], A[k, j, b]
            for j in range(n):
                X[k, j, b], X[pivot, j, b] = X[pivot, j, b], X[k, j, b]
                X[k, j, b] *= inverse
            for j in range(k + 1, m):
                A[k, j, b] *= inverse
            for i in range(k + 1, m):
                for j in range(k + 1, m):
                    A[i, j, b] -= A[i, k, b] * A[k, j, b]
                for j in range(n):
                    X[i, j, b] -= A[i, k, b] * X[k, j, b]
        for k in range(m - 1, -1, -1):
            for j in range(n):
                for i in range(k + 1, m):
                    X[k, j, b] -= A[k, i, b] * X[i, j, b]
