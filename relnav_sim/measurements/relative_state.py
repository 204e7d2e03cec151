"""Relative position, and velocity, as a filter takes them from a differential GNSS solution: linear in the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.measurements.frame_error import FrameError
from relnav_sim.measurements.given_noise import MixtureNoise
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.linear import LinearMeasurement


def relative_state(noise: ArrayLike | MixtureNoise, frame_covariance: ArrayLike | None = None) -> Measurement:
    """Return the deputy's position, or position and velocity, relative to the chief, RTN, m and m/s: z = x + v.

    The solution itself is inertial; whoever turns it into the chief's RTN axes by an estimate of the chief's orbit
    turns it into axes that err, and R gains what that does to the state: [r x] P [r x]^T for the position.

    Args:
        noise: R, (3, 3) of a position or (6, 6) with a velocity, one an epoch or a run and epoch, or a mixture, as of
            `LinearMeasurement`.
        frame_covariance: P, (6, 6), of turn (rad) and rate error (rad/s) of the frame, RTN, as `FrameError` takes it;
            None: it does not err.

    Raises:
        ValueError: The noise is no covariance of three or six numbers.
    """
    own = noise.covariances if isinstance(noise, MixtureNoise) else np.asarray(noise)
    m = own.shape[-1] if own.ndim else 0
    if m not in (3, 6):
        raise ValueError(f"noise has shape {own.shape}; it must be for a position (3) or a position and velocity (6)")
    state = LinearMeasurement(np.eye(m, 6), noise)
    return state if frame_covariance is None else FrameError(state, np.asarray(frame_covariance, dtype=float))


def relative_gnss(
    *,
    position_sigma_m: float | None = None,
    velocity_sigma_m_s: float | None = None,
    covariance: ArrayLike | None = None,
    frame_sigma_deg: float = 0.0,
) -> Measurement:
    """Return a differential GNSS solution for `create_filter`: the deputy relative to the chief, RTN.

    z is a position, m, or position and velocity, m and m/s. It is linear in the state, so that any filter takes it;
    `rtn_from_eci` turns an inertial solution into these axes.

    Args:
        position_sigma_m: Standard deviation of the position on each axis, m; 1 is common for differential code, 0.01 to
            0.05 for carrier phase with fixed ambiguities.
        velocity_sigma_m_s: The same of the velocity, m/s; None: no velocity is read.
        covariance: In place of both sigmas the receiver's formal covariance, RTN, (3, 3) or with a velocity (6, 6);
            one an epoch (T, ., .) or a run and epoch (runs, T, ., .).
        frame_sigma_deg: Standard deviation about each axis of the white error of the orbit frame into which the
            solution is turned, deg: 4e-4 with an orbit from single GNSS fixes of 0.05 m/s.

    Raises:
        ValueError: Sigmas and covariance together or neither, a sigma that is not positive (the frame's: negative), or
            a covariance that is none of three or six numbers.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import measurements
        >>> gnss = measurements.relative_gnss(position_sigma_m=1.0, velocity_sigma_m_s=0.05)
        >>> gnss.predict(np.array([[10.0, 200.0, 30.0, 0.1, 0.2, 0.3]]), 0).tolist()
        [[10.0, 200.0, 30.0, 0.1, 0.2, 0.3]]
    """
    sigmas = [] if position_sigma_m is None else [position_sigma_m]
    sigmas += [] if velocity_sigma_m_s is None else [velocity_sigma_m_s]
    if (position_sigma_m is None) == (covariance is None) or (covariance is not None and sigmas):
        raise ValueError("give position_sigma_m, with or without velocity_sigma_m_s, or covariance in their place")
    if not all(sigma > 0 for sigma in sigmas) or not frame_sigma_deg >= 0:
        raise ValueError("position_sigma_m and velocity_sigma_m_s must be positive, frame_sigma_deg not negative")
    noise = np.diag(np.square(np.repeat(sigmas, 3))) if covariance is None else covariance
    turn = np.diag(np.square(np.radians(frame_sigma_deg)) * np.repeat([1.0, 0.0], 3))
    return relative_state(noise, turn if frame_sigma_deg else None)
