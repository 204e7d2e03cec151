"""Fitting learned dynamics: hyperparameters by scikit-learn, and the calibration of their variance."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from relnav_sim.models.dynamics import Dynamics, Step
from relnav_sim.models.gaussian_process import LEAST_NOISE, GaussianProcess, Kernel, condition, most_informative
from relnav_sim.models.gp import GpDynamics, Target, Variance, straight_line, with_phase

Array = NDArray[np.float64]


def fit_gp_dynamics(
    now: ArrayLike,
    next: ArrayLike,
    step_s: float,
    base: Dynamics | None = None,
    target: Target = "residual",
    *,
    variance: Variance = "exact",
    inducing_points: int = 100,
    phase_rad: ArrayLike | None = None,
    phase: Callable[[int], float] | None = None,
    held_out: tuple[ArrayLike, ArrayLike] | None = None,
    held_out_phase_rad: ArrayLike | None = None,
    process_noise: ArrayLike | None = None,
    restarts: int = 3,
    seed: int = 0,
) -> GpDynamics:
    now, next = _training_array("now", now), _training_array("next", next)
    S, n = now.shape
    if next.shape != now.shape:
        raise ValueError(f"now has shape {now.shape}, next {next.shape}; they must be equal")
    if target == "residual" and base is None:
        base = straight_line(n, step_s)
    carried = {"absolute": None, "difference": "state", "residual": base}[target]
    def outputs_of(a, b):
        if target == "absolute": return b
        return b - (a if target == "difference" else base.propagate(a[None], Step(0, step_s))[0])
    inputs = now if phase_rad is None else with_phase(now, np.asarray(phase_rad))
    outputs = outputs_of(now, next)
    kernel = fit_kernel(inputs, outputs, restarts, seed)
    process = condition(kernel, inputs, outputs)
    return GpDynamics(process, carried, np.ones(n), variance, None, None, phase)

def _training_array(name: str, values: ArrayLike) -> Array:
    array = np.asarray(values, dtype=float)
    if array.ndim != 2 or not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite numbers of shape (S, n); its shape is {array.shape}")
    return array


def fit_kernel(inputs: Array, outputs: Array, restarts: int = 3, seed: int = 0) -> Kernel:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    input_scale = np.where((s := inputs.std(axis=0)) > 0, s, 1.0)
    output_scale = np.where((s := outputs.std(axis=0)) > 0, s, 1.0)
    x = (inputs - inputs.mean(axis=0)) / input_scale
    y = (outputs - outputs.mean(axis=0)) / output_scale
    d = x.shape[1]
    shape = ConstantKernel(1.0, (np.exp(-6), np.exp(16))) * (
        RBF(np.ones(d), (np.exp(-2), np.exp(6))) + WhiteKernel(1e-4, (LEAST_NOISE, 1e2)))
    rng = np.random.default_rng(seed)
    few = rng.choice(len(x), max(len(x)//3, min(len(x), 100)), replace=False)
    regressor = GaussianProcessRegressor(shape, alpha=0.0, n_restarts_optimizer=restarts, random_state=seed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        regressor.fit(x[few], y[few])
    k = regressor.kernel_
    return Kernel(inputs.mean(axis=0), input_scale * k.k2.k1.length_scale, outputs.mean(axis=0), output_scale, k.k1.constant_value, k.k2.k2.noise_level)
