"""Process noise: white acceleration, discretised by Van Loan's method, or a matrix as given."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator
from scipy.linalg import expm

from relnav_sim.arrays import Array
from relnav_sim.options import Options, Tunable

Row = tuple[float, float, float, float, float, float]


class ProcessNoiseOptions(Options):
    """What the filter adds to its covariance each step: exactly one of the three forms."""

    acceleration_psd_m2_s3: Annotated[float | None, Tunable(1e-14, 1e-2)] = Field(
        default=None,
        ge=0,
        description="Power spectral density S_a of a white acceleration on each axis, m^2/s^3 = (m/s^2)^2/Hz; "
        "an unmodelled constant acceleration a correlated over tau seconds acts as 2 a^2 tau",
    )
    diagonal: Row | None = Field(
        default=None, description="Diagonal of Q for one step: three values in m^2, three in (m/s)^2"
    )
    matrix: tuple[Row, Row, Row, Row, Row, Row] | None = Field(
        default=None, description="Q for one step, 6 x 6, symmetric and positive semidefinite, SI units"
    )

    @model_validator(mode="after")
    def _one_form(self) -> ProcessNoiseOptions:
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError("give exactly one of acceleration_psd_m2_s3, diagonal and matrix")
        if self.diagonal is not None and min(self.diagonal) < 0:
            raise ValueError("diagonal must not have negative values")
        if self.matrix is not None:
            Q = np.array(self.matrix)
            if not np.allclose(Q, Q.T, rtol=1e-10, atol=0.0):
                raise ValueError("matrix must be symmetric")
            if np.linalg.eigvalsh(Q)[0] < -1e-12 * np.trace(Q):
                raise ValueError("matrix must be positive semidefinite")
        return self


def white_acceleration(psd_m2_s3: float) -> ProcessNoiseOptions:
    """Return the process noise of a white acceleration on each axis.

    Args:
        psd_m2_s3: Its power spectral density, m^2/s^3.

    Raises:
        ValueError: It is negative or not finite.
    """
    if not 0 <= psd_m2_s3 < np.inf:
        raise ValueError(f"acceleration_psd_m2_s3 is {psd_m2_s3}; it must be a finite number from 0 up")
    return ProcessNoiseOptions(acceleration_psd_m2_s3=float(psd_m2_s3))


def van_loan(A: Array, B: Array, density: Array, duration_s: float) -> tuple[Array, Array]:
    """Return the exact transition matrix F and noise Q of dx = A x dt + B dw over one step.

    Van Loan, IEEE Trans. Automatic Control 23(3), 1978, eq. 2.

    Args:
        A: System matrix (n, n), 1/s.
        B: Noise input matrix (n, p).
        density: Power spectral density of w (p, p).
        duration_s: Step, s.
    """
    n = len(A)
    blocks = np.zeros((2 * n, 2 * n))
    blocks[:n, :n] = -A
    blocks[:n, n:] = B @ density @ B.T
    blocks[n:, n:] = A.T
    E = expm(blocks * duration_s)
    F = E[n:, n:].T
    Q = F @ E[:n, n:]
    return F, (Q + Q.T) / 2


def process_noise_matrix(options: ProcessNoiseOptions, A: Array, duration_s: float) -> Array:
    """Return Q (6, 6) for one step of the linear relative motion dx/dt = A x."""
    if options.diagonal is not None:
        Q = np.diag(options.diagonal).copy()
    elif options.matrix is not None:
        Q = np.array(options.matrix)
    else:
        acts_on_velocity = np.vstack([np.zeros((3, 3)), np.eye(3)])
        Q = van_loan(A, acts_on_velocity, (options.acceleration_psd_m2_s3 or 0.0) * np.eye(3), duration_s)[1]
    Q.setflags(write=False)  # it serves every step, and a filter that wrote into it would change the next ones
    return Q
