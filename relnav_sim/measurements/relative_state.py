"""Relative position, and velocity, as a filter takes them from a differential GNSS solution: linear in the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.measurements.frame_error import FrameError
from relnav_sim.measurements.given_noise import MixtureNoise
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.linear import LinearMeasurement

Array = NDArray[np.float64]


def relative_gnss(noise: ArrayLike | MixtureNoise, frame_covariance: ArrayLike | None = None) -> Measurement:
    """Return the deputy's position, or position and velocity, relative to the chief, RTN, m and m/s.

    z = x + v, or the first three of it. The solution itself is inertial; whoever turns it into the chief's RTN axes by
    an estimate of the chief's orbit turns it into axes that err, by theta and phi, and R gains what that does to the
    state: [r x] P [r x]^T for the position.

    Args:
        noise: The formal covariance: (3, 3) of a position (m^2), (6, 6) with a velocity, one an epoch or a run and
            epoch, or a mixture, as of `LinearMeasurement`.
        frame_covariance: P, (6, 6), of turn (rad) and rate error (rad/s) of the frame, RTN; default: it does not err.

    Raises:
        ValueError: The noise is no covariance of three or six numbers.

    Example:
        >>> measurement = relative_gnss(np.diag([1.0, 1.0, 1.0]))
        >>> measurement.predict(np.array([[10.0, 20.0, 30.0, 0.1, 0.2, 0.3]]), 0)
        array([[10., 20., 30.]])
    """
    own = noise.covariances if isinstance(noise, MixtureNoise) else np.asarray(noise)
    m = own.shape[-1] if own.ndim else 0
    if m not in (3, 6):
        raise ValueError(f"noise has shape {own.shape}; it must be for a position (3) or a position and velocity (6)")
    state = LinearMeasurement(np.eye(m, 6), noise)
    return state if frame_covariance is None else FrameError(state, np.asarray(frame_covariance, dtype=float))
