"""Fitting learned dynamics: hyperparameters by scikit-learn, and the calibration of their variance."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim.arrays import Array
from relnav_sim.dynamics.gp.dynamics import Base, GpDynamics, Target, Variance, straight_line, with_phase
from relnav_sim.dynamics.gp.process import LEAST_NOISE, GaussianProcess, Kernel, most_informative
from relnav_sim.dynamics.gp.regression import RegressionOptions
from relnav_sim.dynamics.gp.separate import SeparateProcesses, conditioned
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.given_arrays import covariances, numbers

# Least variance of the noise on the standardised outputs. Of 1e-12 ... 1e-5 it predicts the next revolution of a
# formation's orbit best, for all three targets, both in RMS error and in likelihood.
_LEAST_OUTPUT_NOISE = 1e-9
# Share of the training rows, the last ones, that calibrates the variance when there are no others to do it.
_CALIBRATION_SHARE = 0.2
# A column that varies by no more than this share of its size is constant: what varies is rounding.
_ROUNDING = 64 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Transitions:
    """States and what became of them one step later.

    Args:
        now: (S, n).
        next: (S, n).
        phase_rad: The chief's argument of latitude at `now`, (S,), where it is an input of the model.
        expected: What the base dynamics make of `now`, (S, n), where that depends on the epoch.
    """

    now: ArrayLike
    next: ArrayLike
    phase_rad: ArrayLike | None = None
    expected: ArrayLike | None = None


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
    expected: ArrayLike | None = None,
    held_out: Transitions | None = None,
    added_noise: ArrayLike | None = None,
    restarts: int = 2,
    seed: int = 0,
    regression: Mapping[str, Any] | None = None,
) -> GpDynamics:
    """Return dynamics learned from states and what became of them one step later.

    Ko and Fox, Autonomous Robots 27, 2009 (their "enhanced" process is the residual target); Wei, Song and Zhang 2012
    (the absolute one). One squared-exponential kernel with a length scale for every input serves all outputs; its
    parameters maximise the marginal likelihood of some of the rows. The variance is multiplied, state by state, by
    max(1, mean of e^2 / variance) over rows that the process has not seen. `regression` has all this otherwise.

    Training data of one closed relative orbit leave most directions of the state space unexplored: off that orbit, the
    absolute and difference targets fall back to their mean, the residual target to the base dynamics.

    Args:
        now: States (S, n), in the order of time.
        next: The same states one step later, (S, n).
        step_s: The step, s. `Step.duration_s` is not looked at later.
        base: What the residual is taken from, `LinearDynamics` of the Clohessy-Wiltshire equations say; its process
            noise is not used. If it depends on the epoch, give `expected` too. Default: motion at constant velocity.
        target: ``residual`` (next - base(now)), ``difference`` (next - now) or ``absolute`` (next).
        variance: ``exact`` (at every particle), ``cloud_mean`` (once a run, at the mean of its particles) or
            ``inducing`` (at every particle, given the most informative training points alone: never too small).
        inducing_points: How many those are.
        phase_rad: The chief's argument of latitude at `now`, (S,): its sine and cosine, doubled, become inputs.
        phase: The same by epoch, at the start of the step towards it; needed with `phase_rad`, see `PhaseClock`.
        expected: What the base makes of `now`, (S, n), each row at its own epoch; default: at epoch 0.
        held_out: Rows that calibrate the variance; default: the last fifth of the training rows, predicted from the
            first four. Rows of the next revolution tell more about the error there.
        added_noise: Covariance added to the process's own, (n, n).
        restarts: Further starts of the likelihood's maximisation, from random parameters.
        seed: Seed of those.
        regression: How the process is fitted, by the keys that `regression` has in a campaign's learned dynamics:
            ``{"processes": "one_per_output"}``, say. Default: as above.

    Raises:
        ValueError: Shapes do not fit together, a number is not finite, `phase` lacks its partner, `regression` has
            wrong keys, or the variance is ``inducing`` with a process for each output.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, Step, fit_gp_dynamics
        >>> turns = np.linspace(0.0, 12.0, 61)
        >>> states = np.column_stack([np.sin(turns), np.cos(turns)])  # an oscillator, 0.2 s apart
        >>> base = LinearDynamics([[1, 0.2], [-0.2, 1]], 1e-6 * np.eye(2))
        >>> learned = fit_gp_dynamics(states[:-1], states[1:], 0.2, base)
        >>> error = learned.propagate(states[None, 7], Step(0)) - states[8]
        >>> bool(abs(error).max() < 1e-3)  # the base model alone is wrong by 0.02
        True
    """
    training = _checked(
        Transitions(now, next, phase_rad, expected), "training", len(np.shape(now)) and np.shape(now)[-1]
    )
    n = training.now.shape[1]
    if (phase is None) != (phase_rad is None) or (held_out and (held_out.phase_rad is None) != (phase is None)):
        raise ValueError("phase by epoch, phase_rad of the training rows and of the held-out ones go together")
    if held_out and (held_out.expected is None) != (expected is None):
        raise ValueError("expected of the training rows and of the held-out ones go together")
    known = None if held_out is None else _checked(held_out, "held-out", n)
    added = None if added_noise is None else covariances(added_noise, "added_noise", f"({n}, {n})", [[]])
    if added is not None and added.shape != (n, n):
        raise ValueError(f"added_noise has shape {added.shape}; it must be ({n}, {n})")
    carried = _carried(target, base, n, step_s)
    if training.expected is not None and base is None:
        raise ValueError("expected is what base dynamics expect; give those too")
    inputs, outputs = training.inputs, training.outputs(carried, step_s)
    magnitude = np.abs(training.next).max(axis=0)
    form = RegressionOptions.model_validate(regression or {})
    kernels = fit_kernels(inputs, outputs, restarts, seed, magnitude, form)
    known_after = partial(conditioned, kernels, noise_counted=form.noise_counted)
    process = known_after(inputs, outputs)
    calibration = np.ones(n)
    if form.calibrated:
        calibration = _calibration(known_after, process, training, known, carried, step_s)
    uncertainty: GaussianProcess | SeparateProcesses | None = None
    if variance == "inducing":
        if len(kernels) > 1:
            raise ValueError("the inducing variance is that of one process for all outputs; take exact or cloud_mean")
        chosen = most_informative(kernels[0], inputs, min(inducing_points, len(inputs)))
        uncertainty = known_after(inputs[chosen], outputs[chosen])
    return GpDynamics(process, carried, calibration, variance, uncertainty, added, phase)


def fit_kernels(
    inputs: Array, outputs: Array, restarts: int, seed: int, output_magnitude: Array, regression: RegressionOptions
) -> list[Kernel]:
    """Return the kernel of all outputs, or one for each, that maximises the marginal likelihood of some of the rows.

    Args:
        inputs: (S, d).
        outputs: (S, q).
        restarts: Further starts, from random parameters.
        seed: Seed of those.
        output_magnitude: Size of the numbers that the outputs are differences of, (q,), for their rounding.
        regression: The form of the kernel, and how many rows.
    """
    if regression.processes == "shared":
        return [_fit_kernel(inputs, outputs, restarts, seed, output_magnitude, regression)]
    return [
        _fit_kernel(inputs, outputs[:, [j]], restarts, seed, output_magnitude[[j]], regression)
        for j in range(outputs.shape[1])
    ]


def _fit_kernel(
    inputs: Array, outputs: Array, restarts: int, seed: int, output_magnitude: Array, regression: RegressionOptions
) -> Kernel:
    """Return the kernel that maximises the marginal likelihood of some of the rows; arguments as above."""
    # Imported here: scikit-learn takes longer to import than the rest of the package.
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    input_mean, output_mean = inputs.mean(axis=0), outputs.mean(axis=0)
    input_scale = _deviation(inputs, np.abs(inputs).max(axis=0))
    output_scale = _deviation(outputs, output_magnitude)
    if not regression.standardised:
        # One unit of length for all inputs, and one for all outputs: they only set the bounds of the search. Where the
        # inputs' mean is makes no difference to the kernel.
        input_scale, output_mean = _common_size(inputs - input_mean), np.zeros(outputs.shape[1])
        output_scale = _common_size(outputs)
    x, y = (inputs - input_mean) / input_scale, (outputs - output_mean) / output_scale
    some = slice(None, None, ceil(len(x) / regression.fitted_points))
    lengths = np.full(x.shape[1], 3.0) if regression.length_scales == "one_per_input" else 3.0
    start = ConstantKernel(1.0, (np.exp(-6), np.exp(16))) * (
        RBF(lengths, (np.exp(-2), np.exp(6))) + WhiteKernel(LEAST_NOISE, "fixed")
    ) + WhiteKernel(1e-6, (_LEAST_OUTPUT_NOISE, np.exp(2)))
    regressor = GaussianProcessRegressor(start, alpha=0.0, n_restarts_optimizer=restarts, random_state=seed)
    with warnings.catch_warnings():
        # Inputs that say nothing take their length to its bound, and noise-free data their noise: both as they should.
        warnings.simplefilter("ignore")
        regressor.fit(x[some], y[some])
    signal, noise = regressor.kernel_.k1, regressor.kernel_.k2
    signal_variance = float(signal.k1.constant_value)
    return Kernel(
        input_mean=input_mean,
        length=input_scale * signal.k2.k1.length_scale,
        output_mean=output_mean,
        output_scale=output_scale,
        signal_variance=signal_variance,
        noise_ratio=LEAST_NOISE + float(noise.noise_level) / signal_variance,
    )


@dataclass(frozen=True)
class _Rows:
    now: Array
    next: Array
    inputs: Array
    expected: Array | None

    def outputs(self, carried: Base, step_s: float) -> Array:
        """Return what the process is to learn, (S, n)."""
        if carried is None:
            return self.next
        if self.expected is not None:
            return self.next - self.expected
        start = self.now if carried == "state" else carried.propagate(self.now[None], Step(0, step_s))[0]
        return self.next - start


def _checked(rows: Transitions, name: str, n: int) -> _Rows:
    now, next = numbers(rows.now, f"now of the {name} rows"), numbers(rows.next, f"next of the {name} rows")
    if now.ndim != 2 or now.shape != next.shape or now.shape[1] != n or len(now) < 10:
        raise ValueError(
            f"{name} rows have shapes {now.shape} and {next.shape}; both must be (S, {n or 'n'}) with S at least 10"
        )
    inputs = now
    if rows.phase_rad is not None:
        phase = numbers(rows.phase_rad, f"phase_rad of the {name} rows")
        if phase.shape != now.shape[:1]:
            raise ValueError(f"{name} rows have {len(now)} states and phases of shape {phase.shape}")
        inputs = with_phase(now, phase)
    expected = None if rows.expected is None else numbers(rows.expected, f"expected of the {name} rows")
    if expected is not None and expected.shape != now.shape:
        raise ValueError(f"{name} rows have states {now.shape} and expected ones {expected.shape}")
    if not all(np.isfinite(part).all() for part in (inputs, next, now if expected is None else expected)):
        raise ValueError(f"{name} rows hold numbers that are not finite")
    return _Rows(now, next, inputs, expected)


def _carried(target: Target, base: Dynamics | None, n: int, step_s: float) -> Base:
    if target == "residual":
        return straight_line(n, step_s) if base is None else base
    if base is not None:
        raise ValueError(f"the {target} target has no use for base dynamics")
    return "state" if target == "difference" else None


def _deviation(columns: Array, magnitude: Array) -> Array:
    """Return the standard deviations of the columns, one where a column is constant up to rounding at a magnitude."""
    deviation = columns.std(axis=0)
    return np.where(deviation > _ROUNDING * magnitude, deviation, 1.0)


def _common_size(columns: Array) -> Array:
    """Return the root mean square of all numbers, for each column; one where all are zero."""
    size = np.sqrt(np.square(columns).mean())
    return np.full(columns.shape[1], size if size > 0 else 1.0)


def _calibration(
    known_after: Callable[[Array, Array], GaussianProcess | SeparateProcesses],
    process: GaussianProcess | SeparateProcesses,
    training: _Rows,
    held_out: _Rows | None,
    carried: Base,
    step_s: float,
) -> Array:
    """Return the factors c >= 1 on the outputs' standard deviations, (n,)."""
    outputs = training.outputs(carried, step_s)
    if held_out is None:
        first = round(len(outputs) * (1 - _CALIBRATION_SHARE))
        process = known_after(training.inputs[:first], outputs[:first])
        inputs, outputs = training.inputs[first:], outputs[first:]
    else:
        inputs, outputs = held_out.inputs, held_out.outputs(carried, step_s)
    mean, variance = process.predict_with_variance(inputs[None])
    ratio = np.square((outputs - mean[0]) / process.output_scale) / variance[0].reshape(len(outputs), -1)
    return np.sqrt(np.maximum(ratio.mean(axis=0), 1.0))
