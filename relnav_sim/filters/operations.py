"""Floating-point operations and bytes of an epoch by formula: what filters add up theirs from.

An addition, a multiplication, a division and a square root count as one operation each; logarithms and exponentials do
not count. Counted are prediction and update of one run at one epoch with one sensor, with dense matrices, NIS and
log-likelihood included, and without what the models compute (f, F, Q, h, H and R). What iterates counts with the most
iterations that its options allow. Counts of factorisations: Golub and Van Loan, Matrix Computations, 4th ed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Size:
    """How large a filter's problem is.

    Args:
        n: States, augmented ones included.
        m: Channels of the sensor.
        noises: Components of the measurement noise as the filter knows it; they concern filters of mixtures.
    """

    n: int
    m: int
    noises: int = 2


@dataclass(frozen=True)
class Operations:
    """What an epoch costs.

    Args:
        count: Floating-point operations.
        numbers: Numbers that are read or written at least once: the belief before and after, sigma points or particles
            on their way, and what the models hand over. Work arrays, which stay in a cache, do not count.
        number_bytes: Bytes of a number.
    """

    count: float
    numbers: float
    number_bytes: int = 8

    @property
    def bytes(self) -> float:
        """Bytes that are read or written at least once."""
        return self.numbers * self.number_bytes


Formula = Callable[[Size, Any], Operations]
"""From a size and a filter's options to its operations."""


def bytes_of(options: Any) -> int:
    """Return the bytes of a number in the arithmetic that a filter's options name."""
    return 4 if getattr(options, "arithmetic", "float64") == "float32" else 8


def triangle(n: int) -> int:
    """Return the elements of a triangle of a matrix (n, n), its diagonal included."""
    return n * (n + 1) // 2


def product(p: int, q: int, r: int) -> int:
    """Return the operations of a product of matrices (p, q) and (q, r)."""
    return p * r * (2 * q - 1)


def cholesky(n: int) -> int:
    """Return the operations of a Cholesky factor, as of U D U^T but for the roots: n^3 / 3 at large n."""
    return n + n * (n - 1) // 2 + (n - 1) * n * (n + 1) // 3


def whitening(n: int, columns: int) -> int:
    """Return the operations of a factor L, of the test of its pivots, and of L^-1 times so many columns."""
    return cholesky(n) + 2 * n + n * n * columns


def covariance_prediction(n: int) -> int:
    """Return the operations of F P F^T + Q, of which one triangle is computed."""
    return product(n, n, n) + triangle(n) * (2 * n + 1)


def innovation_covariance(n: int, m: int) -> int:
    """Return the operations of H P and H P H^T + R."""
    return product(m, n, n) + product(m, n, m) + m * m


def gain_update(n: int, m: int) -> int:
    """Return the operations of mean and covariance from S and P H^T by a factor of S, with the tests of its digits."""
    solved = cholesky(m) + m * m * n + m * m
    return solved + 2 * m * n + triangle(n) * 2 * m + 6 * m + 4


def kalman_update(n: int, m: int) -> int:
    """Return the operations of the Kalman update in its short form, P - W^T W."""
    return innovation_covariance(n, m) + gain_update(n, m)


def joseph_form(n: int, m: int) -> int:
    """Return the operations of the update in Joseph's form, and of a factor that tells whether it is definite."""
    gain = innovation_covariance(n, m) + cholesky(m) + 2 * m * m * n + m * m + 2 * m * n + 5 * m + 2
    form = 2 * m * n * n + product(n, n, n) + product(m, m, n) + triangle(n) * (2 * n - 1 + 2 * m)
    return gain + form + cholesky(n) + 2 * n


def linearised_update(n: int, m: int, number_bytes: int) -> int:
    """Return the operations of a Kalman update: in its short form, or in Joseph's where numbers have 4 bytes."""
    return kalman_update(n, m) if number_bytes == 8 else joseph_form(n, m)


def mean_in_single(n: int, number_bytes: int) -> int:
    """Return the operations of F m, which linear dynamics leave to a filter in float32."""
    return 0 if number_bytes == 8 else 2 * n * n


def definite_in_single(n: int, number_bytes: int) -> int:
    """Return the operations of the test in float32 whether a covariance is definite: a factor, and its pivots."""
    return 0 if number_bytes == 8 else cholesky(n) + 2 * n


def digits_of_search(n: int, m: int, number_bytes: int) -> int:
    """Return the operations of how float32 rounds a search's cost: sizes of measurements, |U| and |W| times sizes."""
    return 0 if number_bytes == 8 else 2 * n + 2 * m * n + 2 * m + 2 * m * (m + 1) + 2 * n * (n + 1) + 3


def udu(n: int) -> int:
    """Return the operations of the factors U D U^T, with the tests of their pivots."""
    return 2 * n + n * (n - 1) // 2 + (n - 1) * n * (n + 1) // 3


def gram_schmidt(n: int, q: int) -> int:
    """Return the operations of the modified weighted Gram-Schmidt process on a matrix (n, q)."""
    return n * (3 * q - 1) + 2 * n * (n - 1) * q


def householder(p: int, q: int) -> int:
    """Return the operations of a triangular form of a matrix (p, q) by reflections."""
    return sum(2 * (q - i) + 5 + (p - 1 - i) * (5 + 4 * (q - i - 1)) for i in range(p))


def sigma_points(n: int) -> int:
    """Return the operations of 2 n + 1 points of a covariance."""
    return cholesky(n) + 2 * triangle(n) + 2 * n * n


def point_moments(n: int, points: int) -> int:
    """Return the operations of mean and covariance of so many deviations (n,) from the centre."""
    return n * (points + 1) + triangle(n) * (2 * points + 5) + n


def unscented_prediction(n: int) -> int:
    """Return the operations of a prediction by 2 n + 1 points."""
    return sigma_points(n) + point_moments(n, 2 * n)


def unscented_update(n: int, m: int) -> int:
    """Return the operations of an update by 2 n + 1 points."""
    cross = m * n * (4 * n + 4) + n * (2 * n + 1)
    return sigma_points(n) + point_moments(m, 2 * n) + cross + gain_update(n, m)


def point_update_in_single(n: int, m: int) -> int:
    """Return the operations of an update by 2 n + 1 points in Joseph's form, and of its test, as in `joseph_form`."""
    points = 2 * n
    cross = m * n * (2 * points + 4) + n * (points + 1)
    gain = cholesky(m) + 2 * m * m * n + m * m + 2 * m * n + 5 * m + 2
    shift = m * (2 * points + 1) + 2 * m * n
    form = points * 2 * m * n + product(m, m, n) + triangle(n) * (2 * points + 4 + 2 * m)
    moments = sigma_points(n) + point_moments(m, points) + cross
    return moments + gain + shift + form + cholesky(n) + 2 * n


def weighing(n: int, particles: int) -> int:
    """Return the operations of weights, mean and covariance of particles, whose sums are taken in blocks."""
    return particles * (n * n + 5 * n + 8) + 63 * (triangle(n) + n + 2)


def models(n: int, m: int) -> int:
    """Return the numbers of F, Q, H, R and the residual."""
    return 2 * n * n + m * n + m * m + m


def gaussian_numbers(n: int, m: int) -> int:
    """Return the numbers of a mean and a covariance, read and written, and of the models' matrices."""
    return 2 * (n + n * n) + models(n, m)


def point_numbers(n: int, m: int) -> int:
    """Return the same with 2 n + 1 points and their measurements in place of F and H."""
    return 2 * (n + n * n) + n * n + m * m + m + (2 * n + 1) * (2 * n + m)


def particle_numbers(n: int, m: int, particles: int) -> int:
    """Return the numbers of particles and weights, read and written, of their noise and of their measurements."""
    return particles * (2 * (n + 1) + n + m) + n * n + m * m + m
