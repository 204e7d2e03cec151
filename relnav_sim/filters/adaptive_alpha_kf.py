"""Alpha-divergence Kalman filter with alpha found online, in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.arithmetic import ArithmeticOptions
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.channel_quantile import ChannelQuantile
from relnav_sim.filters.components import noise_components, normalised
from relnav_sim.filters.either_arithmetic import EitherArithmetic
from relnav_sim.filters.kalman import (
    GaussianFilterOptions,
    innovation_of,
    joseph_update,
)
from relnav_sim.filters.noise_scale import empty_window, modes, push, scale_for
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.reweighting import reweighted, reweighted_operations
from relnav_sim.filters.square_root import NEEDS_NOISE, not_definite
from relnav_sim.linalg import CholeskyFactor, by_run, kernel_for
from relnav_sim.measurements.interface import CompiledUpdate, Measurement, Stretch, linearised
from relnav_sim.measurements.partial import channel_count, present_channels
from relnav_sim.options import Tunable
from relnav_sim.streams import RandomSource


class AdaptiveAlphaOptions(GaussianFilterOptions, ArithmeticOptions):
    """Options of the adaptive alpha filter."""

    scheme: Literal["gate", "student_t", "responsibilities", "windowed_nis"] = Field(
        default="student_t",
        description="How alpha_k follows from the residuals. gate, student_t, responsibilities: from this epoch's, "
        "against outliers; windowed_nis: from the last `window` epochs, for a noise level that drifts. Default "
        "student_t, which needs to know neither the mixture nor a threshold; take responsibilities where the "
        "mixture is known (`assumed_noise: mixture`), and `assumed_noise: nominal` for the others",
    )
    alpha_min: float = Field(
        default=1e-3, gt=0, le=1, description="Least alpha; default 1e-3: a deviation 30 times the nominal one"
    )
    alpha_max: float = Field(
        default=1.0, ge=1, le=4, description="Largest alpha; above 1 (at most 4) where R may be stated too large"
    )
    gate_scheme_probability: Annotated[float, Tunable(0.5, 0.999, log=False, when=("scheme", "gate"))] = Field(
        default=0.95,
        gt=0,
        lt=1,
        description="Scheme gate: alpha is lowered until the NIS is at most the chi-square quantile c of this "
        "probability; default 0.95",
    )
    degrees_of_freedom: Annotated[float, Tunable(1, 100, when=("scheme", "student_t"))] = Field(
        default=4.0, gt=0, description="Scheme student_t: of the noise; 3 to 5 suit glint, smaller trusts R less"
    )
    per_channel: bool = Field(
        default=True,
        description="Scheme student_t: an alpha for each channel, as range and angles glint by themselves; false: one "
        "for all, better where one switch drives all channels",
    )
    iterations: int = Field(default=5, ge=1, le=50, description="Scheme student_t: variational steps; 3 to 5 settle")
    window: int = Field(
        default=100,
        ge=10,
        description="Scheme windowed_nis: epochs W; default 100, 20 s at 5 Hz, knows the deviation to 1 / sqrt(2 m W)",
    )


@register_filter(
    "adaptive_alpha_kf", AdaptiveAlphaOptions, cost_us=4.0, overhead_us=145.0, operations=reweighted_operations
)
class AdaptiveAlphaFilter(EitherArithmetic):
    """Adaptive alpha Kalman filter: R / alpha_k with alpha_k from the residuals.

    What Shi et al. (J. Chinese Inertial Technology 33(10), 2025) leave to future work. With one fixed-point step a
    Gaussian to the power alpha is a Gaussian with R / alpha, so nothing needs sampling: this is the extended Kalman
    filter with a noise covariance of its own at each epoch.

    `gate`: alpha = 1 while the NIS is at most c, else such that it is c; the influence of an outlier is bounded.
    `student_t`: the expected precision of Student-t noise, by variational Bayes, as in the filter `student_t`, here
    held in [alpha_min, alpha_max]. `responsibilities`: the precision of the mixture's components, averaged with
    their probabilities given the innovation (mean-field; one component of `gaussian_sum` is the collapse of all the
    updates). `windowed_nis`: the scale at which the window's mean NIS is m, Mehra (1970), frozen while the
    innovations are correlated, because the NIS alone cannot separate alpha from the process noise.

    Use the first three against glint. The window is for a slow drift of the noise level and gains nothing against
    single outliers: it only finds the total variance. None removes a constant bias.

    nis is that of the innovation with the measurement's own R, log_likelihood likewise, except that
    `responsibilities` gives the evidence of the mixture. Extras: `alpha` (of the least trusted channel where there
    is one each), `nis_after` with R / alpha_k, and for the window the same as `nis_tempered`, and `white` (1 where the
    innovations count as white).
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: AdaptiveAlphaOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options
        self._threshold = ChannelQuantile(measurement, options.gate_scheme_probability)
        self._limits = 1 / options.alpha_max, 1 / options.alpha_min

    def start(self, prior: Gaussian, source: RandomSource) -> Any:
        """Return the prior, with an empty window where the scheme has one."""
        if self._options.scheme == "windowed_nis":
            return empty_window(prior, self._options.window, self.measurement.dimension)
        return prior

    def believed_noise(self, belief: Any, epoch: int) -> Array | None:
        """Return the window's R / alpha_k; None: alpha_k follows from the measurement itself."""
        if self._options.scheme != "windowed_nis":
            return None
        return np.asarray(belief.scale[:, None, None] * self.measurement.noise(belief.mean, epoch))

    def predict(self, belief: Any, step: Step) -> Any:
        """Return the belief with mean f(m) and covariance F P F^T + Q; the window stays."""
        predicted = super().predict(belief, step)
        return replace(belief, mean=predicted.mean, covariance=predicted.covariance)

    def compiled_epochs(self, belief: Any, stretch: Stretch, first_epoch: int) -> int | None:
        """Take as many epochs of a stretch in one go as dynamics and measurement can; None: they can't."""
        options = self._options
        if options.scheme != "student_t" or not options.per_channel:
            return None
        student = kernels.reweighted_step.StudentT(
            options.degrees_of_freedom, options.alpha_min, options.alpha_max, options.iterations
        )
        update = CompiledUpdate("filtered_by_student_t", student, ("alpha", "nis_after"))
        return self.epochs_by(AdaptiveAlphaFilter, update, belief, stretch, first_epoch)

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[Any, Innovation]:
        """Return the Kalman update with R / alpha_k."""
        nu, H, R = linearised(self.seen, z, belief.mean, step.epoch)
        P, nu, R = np.ascontiguousarray(belief.covariance), np.ascontiguousarray(nu), by_run(R, self.kind)
        singular = dict.fromkeys(np.flatnonzero(not_definite(R, len(nu))).tolist(), NEEDS_NOISE)
        if self._options.scheme == "student_t":
            posterior, innovation = self._student_update(belief, nu, H, R)
        else:
            no_noise = np.zeros((1, nu.shape[1], nu.shape[1]), self.kind)
            M = kernel_for(P, kernels.kalman, "predict")(P, by_run(H, self.kind), no_noise)
            posterior, innovation = self._scaled_update(belief, z, nu, H, M, np.broadcast_to(R, M.shape), step.epoch)
        return posterior, replace(innovation, failed={**innovation.failed, **singular})

    def _scaled_update(
        self, belief: Any, z: Array, nu: Array, H: Array, M: Array, R: Array, epoch: int
    ) -> tuple[Any, Innovation]:
        """Return the Kalman update with R / alpha_k, alpha_k a number for all channels or of a mixture."""
        before = innovation_of(M + R, nu, np.abs(z) + np.abs(z - nu))
        log_likelihood, extras = before.log_likelihood, {}
        match self._options.scheme:
            case "gate":
                alpha = self._gate_alpha(nu, M, R)
                used = R / alpha[:, None, None]
            case "windowed_nis":
                alpha = 1 / belief.scale
                used = R / alpha[:, None, None]
                belief, extras["white"] = push(belief, nu, M, R, present_channels(self.measurement), *self._limits)
            case _:
                used, alpha, log_likelihood = self._mixture_noise(nu, M, belief.mean, epoch)
        posterior, after = joseph_update(belief, nu, H, used)
        extras = {"alpha": alpha, "nis_after": after.nis, **extras}
        if self._options.scheme == "windowed_nis":  # whose alpha_k was known before the measurement
            extras["nis_tempered"] = after.nis
        return (
            replace(belief, mean=posterior.mean, covariance=posterior.covariance),
            replace(before, log_likelihood=log_likelihood, extras=extras, failed=after.failed),
        )

    def _gate_alpha(self, nu: Array, M: Array, R: Array) -> Array:
        """Return 1 where the NIS is within the threshold, else the alpha that brings it there, (runs,)."""
        s, d = modes(nu, M, R)
        return 1 / scale_for(s, d, self._threshold.of_present(), 1.0, self._limits[1])

    def _student_update(self, belief: Gaussian, nu: Array, H: Array, R: Array) -> tuple[Gaussian, Innovation]:
        """Return the variational update, with the smallest alpha (runs,)."""
        options = self._options

        def weigh(e: Array, spread: Array) -> Array:
            freedom, squared = options.degrees_of_freedom, np.square(e) + spread
            if options.per_channel:
                weights = (freedom + 1) / (freedom + squared)
            else:
                channels = np.reshape(channel_count(self.measurement), (-1, 1))
                one = (freedom + channels) / (freedom + squared.sum(axis=-1, keepdims=True))
                weights = np.broadcast_to(one, e.shape)
            return np.minimum(np.maximum(weights, options.alpha_min), options.alpha_max)

        update = reweighted(belief, nu, H, R, weigh, options.iterations)
        extras = {"alpha": update.weights.min(axis=-1), "nis_after": update.weighted.nis}
        return update.posterior, replace(
            update.unweighted, extras=extras, failed={**update.failed, **update.weighted.failed}
        )

    def _mixture_noise(self, nu: Array, M: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return the covariance of the expected precision (runs, m, m), alpha (runs,), and the log evidence (runs,).

        alpha is the m-th root of the determinants' ratio to the most precise component, m the channels present.
        """
        weights, covariances = noise_components(self.seen, mean, epoch)
        covariances = np.broadcast_to(covariances, (len(nu), *covariances.shape[-3:]))
        components = [np.ascontiguousarray(covariances[:, j]) for j in range(len(weights))]
        log_terms = [
            np.log(weight) + innovation_of(M + covariance, nu, np.abs(nu)).log_likelihood
            for weight, covariance in zip(weights, components, strict=True)
        ]
        responsibilities, evidence = normalised(np.stack(log_terms, axis=-1))
        responsibilities = responsibilities.astype(self.kind, copy=False)
        identity = np.broadcast_to(np.eye(nu.shape[-1], dtype=self.kind), M.shape)
        precision = np.zeros(M.shape, self.kind)
        least_volume = np.full(len(nu), np.inf)
        for j, covariance in enumerate(components):
            factor = CholeskyFactor(covariance)
            precision += responsibilities[:, j, None, None] * factor.solve(identity)
            least_volume = np.minimum(least_volume, factor.log_determinant())
        factor = CholeskyFactor(precision)
        alpha = np.exp((factor.log_determinant() + least_volume) / channel_count(self.measurement))
        return factor.solve(identity), alpha, evidence
