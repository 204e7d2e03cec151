"""The chief's orbit from its own GNSS fixes: a small extended Kalman filter, for all runs of a block at once."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.kepler import initial_state
from relnav_sim.dynamics.known_thrust import kicks_of
from relnav_sim.dynamics.motion import Fixes, Motion, ZonalMotion
from relnav_sim.options import Options

_LEFT_OUT_PSD, _DRAG_PSD = 1e-7, 1e-8
_PRIOR_SIGMAS = np.repeat([1e5, 1e2], 3)
"""Prior about the nominal orbit, m and m/s: so wide that the first fix decides."""
_NO_KICKS = np.empty((1, 0, 3))
_NUDGES = np.repeat([1.0, 1e-3], 3)
"""Differences for derivatives, m and m/s: nine digits above rounding, and the orbit is straight to seven."""


class OrbitFilterOptions(Options):
    """The filter that estimates the chief's orbit: an extended Kalman filter with the dynamics' own gravity."""

    acceleration_psd_m2_s3: float | None = Field(
        default=None,
        ge=0,
        description="Power spectral density of the acceleration that the orbit model leaves out, m^2/s^3; default 1e-7 "
        "for J3, J4 and drag in low orbit, about 1.5e-5 m/s^2 over some 200 s, and 1e-8 with `zonals: 4` for drag "
        "alone (1e-9 is better from 400 km on, 1e-7 at 300 km)",
    )


class OrbitFilter:
    """Estimates position and velocity in ECI from fixes of both, epoch by epoch; remembers where it stands.

    It starts at epoch 0 from the nominal orbit with a prior of 100 km and 100 m/s, so from the first fix. An estimate
    knows the fixes up to its own epoch only. A run's bits do not depend on the others.

    Args:
        options: Its process noise.
        orbit: The nominal orbit: constants, step division and prior.
        fix_sigmas: Standard deviations of a fix, (6,), m and m/s.
        step_s: Time between epochs, s.
        runs: Number of runs.
        motion: How the craft moves; default: under the zonal harmonics of the orbit's body.
    """

    def __init__(
        self,
        options: OrbitFilterOptions,
        orbit: ChiefOrbit,
        fix_sigmas: Array,
        step_s: float,
        runs: int,
        motion: Motion | None = None,
    ) -> None:
        self._step_s = step_s
        self._motion = motion or ZonalMotion(orbit, step_s)
        self._R = np.square(fix_sigmas)
        growth = np.array([[step_s**3 / 3, step_s**2 / 2], [step_s**2 / 2, step_s]])
        psd = options.acceleration_psd_m2_s3
        if psd is None:
            psd = _DRAG_PSD if orbit.j4 else _LEFT_OUT_PSD
        self._Q = psd * np.kron(growth, np.eye(3))
        self._mean = np.repeat(initial_state(orbit)[None], runs, axis=0)
        self._P = np.repeat(np.diag(np.square(_PRIOR_SIGMAS))[None], runs, axis=0)
        self._next_epoch = 0

    @property
    def covariance(self) -> Array:
        """Covariance at the latest epoch, (runs, 6, 6)."""
        return self._P.copy()

    def advance(self, fixes: Array, forces: Array | None = None) -> Array:
        """Return the estimates at the next K epochs, (runs, K, 6), ECI, m and m/s.

        Args:
            fixes: Fixes (runs, K, 6), ECI, NaN = none.
            forces: Known thrust in the steps that end there, the two means of `KnownThrust.take`, (runs or 1, K, 2, 3),
                m/s^2, RTN; default: none.
        """
        before, after = self._kicks(forces)
        seen = Fixes(
            np.ascontiguousarray(fixes), np.ascontiguousarray(before), np.ascontiguousarray(after), self._next_epoch > 0
        )
        estimates, self._P = self._motion.follow(seen, self._next_epoch, self._mean, self._P, self._Q, self._R)
        if fixes.shape[1]:
            self._mean = estimates[:, -1].copy()
            self._next_epoch += fixes.shape[1]
        return estimates

    def linearised(self, fixes: Array, forces: Array | None = None) -> tuple[Array, Array, Array]:
        """Return what `advance` would, and how an estimate depends on the one before and on its own fix.

        The filter stays where it stands. To first order, at epoch k: error_k = A_k error_{k-1} + G_k (error of fix k).

        Args:
            fixes: Fixes of one run, (1, K, 6), ECI, NaN = none.
            forces: As `advance` has them, of one run.

        Returns:
            Estimates (K, 6), A (K, 6, 6) and G (K, 6, 6).
        """
        before, after = self._kicks(forces)
        K = fixes.shape[1]
        # Run 0 is the filter itself; six have another estimate before, six another fix.
        moved = np.concatenate([np.zeros((1, 6)), np.diag(_NUDGES), np.zeros((6, 6))])
        misread = np.concatenate([np.zeros((7, 6)), np.diag(_NUDGES)])
        mean, P = self._mean, self._P
        estimates, A, G = np.empty((K, 6)), np.empty((K, 6, 6)), np.empty((K, 6, 6))
        for k in range(K):
            epoch = self._next_epoch + k
            first, last = (np.ascontiguousarray(side[:, k : k + 1]) for side in (before, after))
            seen = Fixes(fixes[:, k : k + 1] + misread[:, None], first, last, epoch > 0)
            found, covariance = self._motion.follow(
                seen, epoch, mean + moved, np.repeat(P, 13, axis=0), self._Q, self._R
            )
            mean, P = found[:1, 0], covariance[:1]
            slopes = (found[1:, 0] - mean).T / np.concatenate([_NUDGES, _NUDGES])
            estimates[k], A[k], G[k] = mean[0], slopes[:, :6], slopes[:, 6:]
        return estimates, A, G

    def _kicks(self, forces: Array | None) -> tuple[Array, Array]:
        before, after = (_NO_KICKS, _NO_KICKS) if forces is None else kicks_of(forces, self._step_s)
        return (before, after) if before.any() or after.any() else (_NO_KICKS, _NO_KICKS)
