"""Process noise: white or correlated acceleration, discretised exactly over a step, or a matrix as given."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from relnav_sim.arrays import Array
from relnav_sim.options import AddedLater, Options, Tunable

Row = tuple[float, float, float, float, float, float]
Density = Annotated[float, Tunable(1e-14, 1e-2)]

ACTS_ON_VELOCITY = np.vstack([np.zeros((3, 3)), np.eye(3)])
"""What an acceleration does to the derivative of position and velocity, (6, 3)."""
ACTS_ON_VELOCITY.setflags(write=False)


class SncRtnOptions(Options):
    """White acceleration with a power spectral density of its own on each axis of the chief's RTN frame.

    State noise compensation, as Tapley, Schutz and Born, Statistical Orbit Determination, 2004, section 4.9, call it.
    """

    radial_psd_m2_s3: Density = Field(ge=0, description="Power spectral density along the radius, m^2/s^3")
    along_track_psd_m2_s3: Density = Field(ge=0, description="Power spectral density along the track, m^2/s^3")
    normal_psd_m2_s3: Density = Field(ge=0, description="Power spectral density along the orbit normal, m^2/s^3")

    @property
    def densities(self) -> Array:
        """Power spectral densities, RTN, (3,), m^2/s^3."""
        return np.array([self.radial_psd_m2_s3, self.along_track_psd_m2_s3, self.normal_psd_m2_s3])


class DmcAxisOptions(Options):
    """A first-order Gauss-Markov acceleration on one axis."""

    sigma_m_s2: Annotated[float, Tunable(1e-10, 1e-3)] = Field(
        gt=0, description="Standard deviation of the acceleration, which it has at the start and keeps, m/s^2"
    )
    tau_s: Annotated[float, Tunable(1, 1e5)] = Field(gt=0, description="Correlation time, s")


class DmcOptions(Options):
    """Dynamic model compensation: an unmodelled acceleration a' = -a / tau + w that the filter estimates, by RTN axis.

    w is white with power spectral density 2 sigma^2 / tau (Tapley, Schutz and Born, 2004, section 4.9). The filter
    carries three more states.
    """

    radial: DmcAxisOptions = Field(description="Along the radius")
    along_track: DmcAxisOptions = Field(description="Along the track")
    normal: DmcAxisOptions = Field(description="Along the orbit normal")

    @property
    def axes(self) -> tuple[DmcAxisOptions, DmcAxisOptions, DmcAxisOptions]:
        """The three axes, RTN."""
        return self.radial, self.along_track, self.normal


class AdaptiveOptions(Options):
    """White acceleration whose densities the filter finds by itself, from what its measurements correct.

    Covariance matching (Myers and Tapley, IEEE Trans. Automatic Control 21(4), 1976) with the weights of maximum
    likelihood, recursively (Ljung and Soderstrom, 1983). For filters with one Gaussian.
    """

    start: SncRtnOptions = Field(description="Densities before any measurement")
    window: Annotated[int, Tunable(10, 300)] = Field(
        default=50,
        ge=2,
        le=10_000,
        description="Number of measurements that the densities come from; older ones fade, none ends; default 50",
    )

    @model_validator(mode="after")
    def _some_noise(self) -> AdaptiveOptions:
        if self.start.densities.min() == 0:
            raise ValueError("start must have a density above 0 on each axis: densities grow by factors, 0 never does")
        return self


class ProcessNoiseOptions(Options):
    """What the filter adds to its covariance each step: exactly one of the forms."""

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

    snc_rtn: Annotated[SncRtnOptions | None, AddedLater()] = Field(
        default=None, description="White acceleration with one power spectral density for each RTN axis"
    )
    dmc: Annotated[DmcOptions | None, AddedLater()] = Field(
        default=None,
        description="Time-correlated acceleration on each RTN axis, which the filter estimates as three more states",
    )

    adaptive: Annotated[AdaptiveOptions | None, AddedLater()] = Field(
        default=None,
        description="White acceleration with one power spectral density for each RTN axis, found during each run",
    )

    @model_validator(mode="after")
    def _one_form(self) -> ProcessNoiseOptions:
        forms = list(ProcessNoiseOptions.model_fields)
        if sum(getattr(self, name) is not None for name in forms) != 1:
            raise ValueError(f"give exactly one of {', '.join(forms[:-1])} and {forms[-1]}")
        if self.diagonal is not None and min(self.diagonal) < 0:
            raise ValueError("diagonal must not have negative values")
        if self.matrix is not None:
            Q = np.array(self.matrix)
            if not np.allclose(Q, Q.T, rtol=1e-10, atol=0.0):
                raise ValueError("matrix must be symmetric")
            if np.linalg.eigvalsh(Q)[0] < -1e-12 * np.trace(Q):
                raise ValueError("matrix must be positive semidefinite")
        return self

    @property
    def density(self) -> Array:
        """Power spectral density of the white acceleration at the start, (3, 3), m^2/s^3; 0 where there is none."""
        if self.adaptive is not None:
            return np.diag(self.adaptive.start.densities)
        if self.snc_rtn is not None:
            return np.diag(self.snc_rtn.densities)
        return (self.acceleration_psd_m2_s3 or 0.0) * np.eye(3)


class AddedNoiseOptions(ProcessNoiseOptions):
    """Process noise for dynamics without any, as `create_filter` takes it."""

    mean_motion_rad_s: float = Field(gt=0, description="The chief's mean motion, by which an acceleration acts, rad/s")
    step_s: float = Field(gt=0, description="Time between epochs, s")


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
    from scipy.linalg import expm

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
    """Return Q (6, 6) for one step of the linear relative motion dx/dt = A x.

    That of a correlated acceleration (`dmc`) is 0 here: it moves with the states that it is.
    """
    if options.diagonal is not None:
        Q = np.diag(options.diagonal).copy()
    elif options.matrix is not None:
        Q = np.array(options.matrix)
    else:
        Q = van_loan(A, ACTS_ON_VELOCITY, options.density, duration_s)[1]
    Q.setflags(write=False)  # it serves every step, and a filter that wrote into it would change the next ones
    return Q
