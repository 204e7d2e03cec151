"""Two-step filter that estimates the measurement noise as it runs."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.two_step import TwoStepBelief, TwoStepFilter, TwoStepOptions, two_step_operations
from relnav_sim.linalg import CholeskyFactor, cholesky, transpose
from relnav_sim.measurements.interface import Measurement
from relnav_sim.measurements.partial import all_channels, present_channels
from relnav_sim.options import Tunable
from relnav_sim.streams import RandomSource


class AdaptiveTwoStepOptions(TwoStepOptions):
    """Options of the adaptive two-step filter."""

    forgetting: Annotated[float, Tunable(0.9, 0.998, log=False)] = Field(
        default=0.98,
        gt=0,
        lt=1,
        description="Forgetting factor b of the noise estimate, 0.95 to 0.995: it remembers about 1 / (1 - b) updates; "
        "default 0.98: a sigma is then known to 7 % and a step of it is followed within 100 updates",
    )
    initial_weight: float = Field(
        default=20.0,
        ge=0,
        description="Updates that the measurement's own R counts for at the start; default 20, so that the first "
        "residuals, which still hold the error of the start, do not take over",
    )
    channels: Literal["independent", "joint"] = Field(
        default="independent",
        description="independent: one variance a channel, in the axes in which the measurement's own R is white; "
        "joint: a full matrix",
    )
    smallest: float = Field(default=0.1, gt=0, le=1, description="Least variance, in units of the measurement's own R")
    largest: float = Field(default=100.0, ge=1, description="Greatest variance, in units of the measurement's own R")


@dataclass(frozen=True)
class AdaptiveTwoStepBelief(TwoStepBelief):
    """A two-step belief with the noise estimate.

    Args:
        noise_ratio: The estimate R_k in the axes in which the measurement's own R is the identity, (runs, m, m).
        memory: Sum of the weights b^j of the updates so far, by axis, (runs, m).
    """

    noise_ratio: Array
    memory: Array


@register_filter(
    "adaptive_two_step", AdaptiveTwoStepOptions, cost_us=12.0, overhead_us=530.0, operations=two_step_operations
)
class AdaptiveTwoStepFilter(TwoStepFilter):
    """Two-step filter that estimates its measurement noise (Sage and Husa), positive definite at every step.

    Sage and Husa, Joint Automatic Control Conference, 1969, with the forgetting factor usual since; on the two-step
    filter after Zhou Di et al., JGCD 1999. With e = z - H y after the first step, R becomes
    (1 - d) R + d (e e^T + H Py H^T), d the weight of the newest update: a sum of positive parts, where the form on
    the innovation subtracts a covariance and may lose its sign. Use it when the sensor's noise is not known or drifts.

    The ratio to the measurement's own R is what is estimated, so noise that depends on the state keeps its shape.
    Extras: `noise_sigma_ratio_0` and so on, the estimated sigma of each channel in units of the nominal one.

    Limits: no noise mean is estimated (it cannot be told from an angle bias) and Q is not adapted, whose errors
    therefore show up as measurement noise. Glint averages into a wide Gaussian: robust filters do better there.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: AdaptiveTwoStepOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._adaptation = options

    def start(self, prior: Gaussian, source: RandomSource) -> AdaptiveTwoStepBelief:
        """Return the prior, with the measurement's own R as the first noise estimate."""
        runs, m = len(prior.mean), self.measurement.dimension
        return _with_noise(
            super().start(prior, source),
            np.tile(np.eye(m), (runs, 1, 1)),
            np.full((runs, m), self._adaptation.initial_weight),
        )

    def correct(self, belief: Any, z: Array, step: Step) -> tuple[AdaptiveTwoStepBelief, Innovation]:
        """Return the belief after both steps under the present noise estimate, and the estimate renewed."""
        prior: AdaptiveTwoStepBelief = belief
        nominal = self._nominal_noise(prior, step.epoch)
        R = _estimated(nominal, prior.noise_ratio)
        corrected, (residual, covariance), innovation = self.two_steps(prior, z, R, step)
        factor, memory = CholeskyFactor(nominal), self._adaptation.forgetting * prior.memory + 1
        weight, present = 1 / memory, present_channels(self.seen)
        if present is not None:
            # An axis into which an absent channel enters has seen nothing.
            enters = factor.whiten_rows(np.broadcast_to(np.eye(present.shape[1], dtype=self.kind), nominal.shape)) != 0
            seen = ~(enters & ~present[:, None]).any(axis=2)
            memory, weight = np.where(seen, memory, prior.memory), np.where(seen, weight, 0.0)
        ratio = self._renewed(prior.noise_ratio, factor, residual, covariance, weight)
        sigma = np.sqrt(np.einsum("bii->bi", ratio))
        extras = {f"noise_sigma_ratio_{i}": np.ascontiguousarray(sigma[:, i]) for i in range(sigma.shape[1])}
        return _with_noise(corrected, ratio, memory), replace(innovation, extras={**innovation.extras, **extras})

    def believed_noise(self, belief: Any, epoch: int) -> Array:
        """Return the noise as estimated so far, (runs, m, m)."""
        return _estimated(self._nominal_noise(belief, epoch), belief.noise_ratio)

    def _nominal_noise(self, belief: Any, epoch: int) -> Array:
        nominal = all_channels(self.seen).noise(belief.mean, epoch)
        return np.broadcast_to(nominal, belief.noise_ratio.shape)

    def _renewed(
        self, ratio: Array, factor: CholeskyFactor, residual: Array, covariance: Array, weight: Array
    ) -> Array:
        """Return the noise estimate after a residual (runs, m) whose y has the given H Py H^T (runs, m, m).

        With weights d_i by axis, (runs, m), it is D' R D' + D (e e^T + H Py H^T) D, D^2 = diag(d), D'^2 = I - D^2: a
        sum of positive parts whatever the weights.
        """
        options = self._adaptation
        white = factor.whiten(residual)
        half = factor.whiten_rows(covariance)
        seen = white[:, :, None] * white[:, None, :] + factor.whiten_rows(transpose(half))
        if options.channels == "independent":
            seen = seen * np.eye(seen.shape[-1], dtype=seen.dtype)
        estimate = _geometric_means(1 - weight) * ratio + _geometric_means(weight) * seen
        # The bounds rescale channels, so that the matrix stays positive definite.
        variances = np.einsum("bii->bi", estimate)
        scale = np.sqrt(np.clip(variances, options.smallest, options.largest) / variances)
        return estimate * scale[:, :, None] * scale[:, None, :]


def _estimated(nominal: Array, ratio: Array) -> Array:
    """Return R of a ratio to the nominal one, both (runs, m, m)."""
    root = cholesky(nominal)
    return np.asarray(root @ ratio @ transpose(root))


def _geometric_means(weights: Array) -> Array:
    """Return sqrt(w_i w_j), (runs, m, m), of weights (runs, m); exactly w_i where the two are equal."""
    return np.sqrt(weights[:, :, None] * weights[:, None, :])


def _with_noise(belief: TwoStepBelief, ratio: Array, memory: Array) -> AdaptiveTwoStepBelief:
    own = {item.name: getattr(belief, item.name) for item in fields(TwoStepBelief)}
    return AdaptiveTwoStepBelief(**own, noise_ratio=ratio, memory=memory)
