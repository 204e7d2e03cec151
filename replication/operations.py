"""Floating-point operations of one prediction and update, counted by formula: the cost claim without a stopwatch.

A multiplication, an addition, a division and a square root count as 1, a function (exp, sin, atan2, ...) and a normal
random number as `FUNCTION`. n is the dimension of the state, m that of the measurement, N the number of samples. All
filters do the same prediction of their mean: 2 n^2. Symmetry is used by none, as in plain textbook code.
"""

from __future__ import annotations

FUNCTION = 20
"""Operations of one exp, sin or atan2 and of one normal number: 15 to 40 on current processors."""


def _product(rows: int, inner: int, columns: int) -> int:
    return 2 * rows * inner * columns


def _cholesky(n: int) -> int:
    return n**3 // 3 + 2 * n**2


def kalman(n: int = 6, m: int = 3) -> int:
    """Return the count for the linear Kalman filter on a converted position, H = [I 0].

    Phi x; Phi P Phi^T + Q; S = P_rr + R, factored; K = P_.r S^-1; x + K nu; P - K P_r.
    """
    predict = _product(n, n, 1) + 2 * _product(n, n, n) + n * n
    update = m * m + _cholesky(m) + 2 * n * m * m + _product(n, m, 1) + m + _product(n, m, n) + n * n
    return predict + update


def ekf(n: int = 6, m: int = 3) -> int:
    """Return the count for the extended Kalman filter on range and two angles.

    As `kalman` with a full H: H P, H P H^T; and h (three functions) and its Jacobian (some 30 operations).
    """
    return kalman(n, m) + _product(m, n, n) + _product(m, n, m) + m * FUNCTION + 30


def adaptive_responsibilities(n: int = 6, m: int = 3, components: int = 2) -> int:
    """Return the count for the adaptive alpha filter that is told the noise's mixture.

    As `ekf`; for each component S, factored, whitened innovation, log and exp, R_j^-1 and its share of the precision;
    the precision's inverse once. R_j^-1 depends on the range and is made anew.
    """
    inverse = _cholesky(m) + 2 * m**3
    each = m * m + _cholesky(m) + m * m + 2 * m + 2 * FUNCTION + inverse + 2 * m * m
    return ekf(n, m) + components * each + inverse


def adaptive_student_t(n: int = 6, m: int = 3, steps: int = 3) -> int:
    """Return the count for the adaptive alpha filter with Student-t noise.

    As `ekf`; R factored, L^-1 H and L^-1 nu once; for each step the residual and its variance (H P H^T's diagonal), a
    weight for each channel, R / w and the update with it.
    """
    once = _cholesky(m) + m * m * (n + 1)
    update = m * m + _cholesky(m) + 2 * n * m * m + _product(n, m, 1) + m + _product(n, m, n) + n * n
    each = _product(m, n, 1) + _product(m, n, n) + _product(m, n, 1) + 5 * m + _product(m, m, m) + update
    return ekf(n, m) + once + steps * each


def ukf(n: int = 6, m: int = 3) -> int:
    """Return the count for the unscented Kalman filter with 2 n + 1 points, additive noise, points drawn once.

    Root of P; 2 n + 1 points through Phi and through h; their mean, covariance, measurement mean, S and cross
    covariance; gain and update.
    """
    points = 2 * n + 1
    moved = _cholesky(n) + 2 * n * n + points * (_product(n, n, 1) + m * FUNCTION + 10)
    moments = points * (2 * n + 3 * n * n + 2 * m + 3 * m * m + 3 * n * m)
    update = m * m + _cholesky(m) + 2 * n * m * m + _product(n, m, 1) + m + _product(n, m, n) + n * n
    return moved + n * n + moments + update


def alpha_kf(samples: int, n: int = 6, m: int = 3) -> int:
    """Return the count for the alpha-divergence filter as published, N samples of the n-dimensional prediction.

    Once: Phi x, Phi P Phi^T + Q, root of P. For each sample: n normal numbers, x + L e (n^2 + n), residual of the
    position (m), R^-1-weighted square (2 m^2 + 2 m), alpha, exp, sum; then its share of the mean (2 n) and of the
    covariance (n for the deviation, 2 n^2 + n for the weighted outer product).
    """
    once = _product(n, n, 1) + 2 * _product(n, n, n) + n * n + _cholesky(n)
    draw = n * FUNCTION + n * n + n
    weight = m + 2 * m * m + 2 * m + 1 + FUNCTION + 2
    moments = 2 * n + n + 2 * n * n + n
    return once + samples * (draw + weight + moments)


def count(name: str, samples: int) -> int:
    """Return the count of a filter's step for the relative navigation problem, n = 6, m = 3.

    Args:
        name: ``kf``, ``ekf``, ``ukf``, ``alpha_kf``, ``adaptive_responsibilities`` or ``adaptive_student_t``.
        samples: Samples of ``alpha_kf``; nothing to the others.

    Raises:
        ValueError: Another name.
    """
    match name:
        case "kf":
            return kalman()
        case "ekf":
            return ekf()
        case "ukf":
            return ukf()
        case "alpha_kf":
            return alpha_kf(samples)
        case "adaptive_responsibilities":
            return adaptive_responsibilities()
        case "adaptive_student_t":
            return adaptive_student_t()
    raise ValueError(f"no count for {name!r}")


def break_even_samples(name: str) -> int:
    """Return the largest number of samples with which the alpha filter costs no more than another filter."""
    once, each = alpha_kf(0), alpha_kf(1) - alpha_kf(0)
    return max(0, (count(name, 0) - once) // each)
