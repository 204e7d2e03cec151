"""A fixed relative-navigation problem: Clohessy-Wiltshire motion seen by a radar whose azimuth crosses +-pi."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relnav_sim import FunctionMeasurement, LinearDynamics
from relnav_sim.dynamics.clohessy_wiltshire import cw_system
from relnav_sim.dynamics.process_noise import van_loan

MEAN_MOTION = 1.078e-3
SIGMAS = np.array([4.0, 1.2e-3, 1.2e-3])
ACCELERATION_PSD = 1e-6


def polar(states, epoch=0):
    position = states[..., :3]
    rho = np.sqrt(np.square(position).sum(axis=-1))
    z = np.empty((*states.shape[:-1], 3))
    z[..., 0] = rho
    z[..., 1] = np.arctan2(states[..., 1], states[..., 0])
    z[..., 2] = np.arcsin(-states[..., 2] / rho)
    return z


def polar_jacobian(states, epoch=0):
    x, y, z = states[..., 0], states[..., 1], states[..., 2]
    across = np.sqrt(x**2 + y**2)
    rho = np.sqrt(across**2 + z**2)
    H = np.zeros((*states.shape[:-1], 3, states.shape[-1]))
    H[..., 0, :3] = states[..., :3] / rho[..., None]
    H[..., 1, 0], H[..., 1, 1] = -y / across**2, x / across**2
    H[..., 2, 0], H[..., 2, 1] = x * z / (rho**2 * across), y * z / (rho**2 * across)
    H[..., 2, 2] = -across / rho**2
    return H


@dataclass(frozen=True)
class Problem:
    truth: np.ndarray
    z: np.ndarray
    mean0: np.ndarray
    cov0: np.ndarray
    dynamics: LinearDynamics
    measurement: FunctionMeasurement
    F: np.ndarray
    Q: np.ndarray
    R: np.ndarray


def radar_problem(runs=4, steps=300, step_s=2.0, seed=7, range_m=2000.0, psd=ACCELERATION_PSD):
    """Return a bounded relative orbit about the chief, driven by the process noise that the filter assumes."""
    rng = np.random.default_rng(seed)
    noise_input = np.vstack([np.zeros((3, 3)), np.eye(3)])
    F, Q = van_loan(cw_system(MEAN_MOTION), noise_input, psd * np.eye(3), step_s)
    R = np.diag(SIGMAS**2)
    start = np.array([range_m / 2, 0.0, range_m / 4, 0.0, -MEAN_MOTION * range_m, 0.0])
    cov0 = np.diag([10.0, 10.0, 10.0, 0.1, 0.1, 0.1]) ** 2
    x = np.broadcast_to(start, (runs, 6)).copy()
    mean0 = x + rng.standard_normal((runs, 6)) @ np.linalg.cholesky(cov0).T
    root_Q = np.linalg.cholesky(Q + 1e-18 * np.eye(6))
    truth = np.empty((runs, steps, 6))
    for k in range(steps):
        x = x @ F.T + rng.standard_normal((runs, 6)) @ root_Q.T
        truth[:, k] = x
    z = polar(truth) + SIGMAS * rng.standard_normal((runs, steps, 3))
    z[..., 1:] = np.mod(z[..., 1:] + np.pi, 2 * np.pi) - np.pi
    measurement = FunctionMeasurement(polar, R, polar_jacobian, angles=(1, 2))
    return Problem(truth, z, mean0, cov0, LinearDynamics(F, Q), measurement, F, Q, R)
