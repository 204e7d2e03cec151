"""Alpha-divergence Kalman filter: importance-sampled moments of the tempered posterior."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.dynamics.interface import Dynamics, Step
from relnav_sim.filters.belief import Gaussian, Innovation, where_runs
from relnav_sim.filters.gaussian_sampling import (
    Linearisation,
    SamplingFilter,
    SamplingOptions,
    WhitenedPrior,
    fixed_normals,
    whitened_prior,
)
from relnav_sim.filters.iekf import search_operations
from relnav_sim.filters.operations import (
    Operations,
    Size,
    bytes_of,
    definite_in_single,
    gaussian_numbers,
    unscented_prediction,
)
from relnav_sim.filters.particle_set import log_likelihood, standard_normals
from relnav_sim.filters.registry import register_filter
from relnav_sim.linalg import DOUBLE, CholeskyFactor, by_run, cholesky, kernel_for, symmetric, transpose
from relnav_sim.measurements.interface import CompiledUpdate, Measurement, Stretch, affine, squared_errors
from relnav_sim.measurements.partial import all_channels, present_channels
from relnav_sim.options import AddedLater, Tunable
from relnav_sim.streams import RandomSource, Streams


class ImportanceOptions(SamplingOptions):
    """Options of a filter that takes its moments from weighted samples."""

    samples: int = Field(
        default=10_000,
        ge=32,
        description="Number N of samples; default that of Shi et al. (2025). The estimate's own noise is about "
        "sqrt(trace R / (alpha N)) whatever the process noise; 512 fixed samples do better than 10000 random ones",
    )
    sampling: Literal["random", "antithetic", "fixed"] = Field(
        default="random",
        description="random: new independent samples each epoch, as published; antithetic: in pairs +e, -e; "
        "fixed: one scrambled Sobol set with exact mean and covariance, made once, without noise from epoch to epoch",
    )
    proposal: Literal["prior", "posterior"] = Field(
        default="prior",
        description="What the samples are drawn from. prior: the prediction, as published; posterior: where the "
        "predicted effective sample size is below max(50 d, N / 20) (d observed states), the widened posterior of "
        "an iterated extended Kalman filter",
    )
    proposal_spread: float = Field(
        default=2.0,
        ge=1,
        description="Factor kappa on the covariance of the posterior proposal; default 2: tails heavier than the "
        "target's keep the weights bounded",
    )
    likelihood: Literal["gaussian", "mixture"] = Field(
        default="gaussian",
        description="gaussian: N(0, R), as published, whatever the noise; mixture: the measurement's own "
        "likelihood, which is the density of the noise's components where it has them (`assumed_noise: mixture`)",
    )
    sampled_states: Annotated[Literal["observed", "all"], AddedLater()] = Field(
        default="observed",
        description="observed: those that the measurement depends on, the others following by regression, which is "
        "the same in distribution with less noise of sampling; all: as published",
    )
    covariance_correction: Annotated[bool, AddedLater()] = Field(
        default=True,
        description="Multiply the weighted covariance of random or antithetic samples by 1 / (1 - sum w^2), w their "
        "weights, or its like for pairs, without which it is too small by a factor of 1 - 1 / ESS at each "
        "measurement; false: the weighted covariance itself, as published. Fixed samples need none",
    )

    @model_validator(mode="after")
    def _pairs(self) -> ImportanceOptions:
        if self.sampling == "antithetic" and self.samples % 2:
            raise ValueError("antithetic sampling needs an even number of samples")
        return self


class AlphaOptions(ImportanceOptions):
    """Options of the alpha-divergence filter."""

    alpha: Annotated[float, Tunable(0.01, 1, scales_noise=True)] = Field(
        default=0.5,
        gt=0,
        le=1,
        description="Order alpha of the divergence; default that of Shi et al. (2025), tables 2 and 3. With one "
        "fixed-point step it is the exponent on the likelihood: R acts as R / alpha",
    )
    fixed_point: int = Field(
        default=1,
        ge=1,
        description="Steps of the fixed point q <- moments of p^alpha q^(1 - alpha). 1: as published, the tempered "
        "posterior; ceil(3 / alpha) or more: the true alpha-projection, which for nearly linear problems is the "
        "exact posterior whatever alpha",
    )


def sampled_operations(size: Size, options: Any) -> Operations:
    """Return what weighted samples cost where all states are sampled: drawn, weighed, and their moments taken.

    What is done once, whatever the number of samples, counts as one search of `iekf` with two iterations.
    """
    n, m, width = size.n, size.m, bytes_of(options)
    each = 2 * n * n + m * m + 2 * m + 4 + n * (n + 1) + 2 * n
    once = search_operations(size, 2, width) + definite_in_single(n, width)
    count = unscented_prediction(n) + once + options.samples * each
    return Operations(count, gaussian_numbers(n, m) + options.samples * (2 * n + m + 1), width)


@register_filter(
    "alpha_kf", AlphaOptions, measurement="cartesian", cost_us=200.0, overhead_us=150.0, operations=sampled_operations
)
class AlphaKalmanFilter(SamplingFilter):
    """Alpha-divergence Kalman filter.

    Gultekin and Paisley (IEEE Trans. Signal Processing 65(23), 2017, algorithm 3); Shi et al. (J. Chinese Inertial
    Technology 33(10), 2025) on relative navigation. Samples of the prediction are weighted with the likelihood to
    the power alpha; their mean and covariance are the new belief.

    Use it to study alpha, or with `likelihood: mixture` and alpha 1 as an accurate non-Gaussian update. With a
    Gaussian likelihood and a linear measurement it only approximates `kf` with `r_scale: 1/alpha`, at hundreds of
    times the cost: include that filter in every comparison, and tune the process noise of both, since R / alpha
    with Q has the gain of R with alpha Q. It is not robust to outliers beyond its larger R: a Gaussian to a power
    is a Gaussian.

    In plain words where the literature misleads: one step tends to the prediction as alpha goes to 0, not to the
    mode-seeking KL(q|p) filter; that is the limit of many fixed-point steps. Self-normalised weights shrink the
    covariance by 1 - 1/ESS a step; random samples are corrected for it here, unless `covariance_correction` is false
    as in the published code. Plain samples add noise to the estimate that the covariance does not show; `fixed` does
    not.

    Only the states the measurement depends on are sampled (its `depends_on`), unless `sampled_states` is all; the
    others follow by regression, which is exact in distribution. nis and log_likelihood are those of the Gaussian
    innovation with the measurement's R, so that they compare between alphas; extras: `nis_tempered` with R / alpha,
    `ess` (smallest over the fixed-point steps), `fallback` (1 where the weights collapsed or the numbers broke down,
    and the iterated extended Kalman update with the same tempered R replaced the samples).
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: AlphaOptions) -> None:
        super().__init__(dynamics, measurement, options)
        self._options = options
        self.stochastic = options.sampling != "fixed"
        # For a Gaussian, t steps temper the likelihood by 1 - (1 - alpha)^t in all.
        self._total_alpha = 1 - (1 - options.alpha) ** options.fixed_point
        # As `kernels.sampling.moments` has it; a set with exact moments is the one that it does not correct.
        self._kind = ("random", "antithetic", "fixed").index(
            options.sampling if options.covariance_correction else "fixed"
        )
        if options.sampled_states == "all":
            self._observed = np.arange(dynamics.dimension)
        self._tempering = (np.sqrt(options.alpha / 2) * np.eye(measurement.dimension)[None]).astype(self.kind)
        self._streams = Streams([])

    def start(self, prior: Gaussian, source: RandomSource) -> Gaussian:
        """Return the prior; random samples come from the stream ``filter.alpha_kf.samples``, fixed ones are drawn now.

        To draw them takes 0.6 s of processor time, most of it to import SciPy, which is no cost of a step.
        """
        if self.stochastic:
            self._streams = source.streams("filter.alpha_kf.samples")
        else:
            fixed_normals(len(self._observed), self._options.samples)
        return prior

    def believed_noise(self, belief: Gaussian, epoch: int) -> Array:
        """Return R / alpha."""
        return self.measurement.noise(belief.mean, epoch) / self._total_alpha

    def compiled_epochs(self, belief: Gaussian, stretch: Stretch, first_epoch: int) -> int | None:
        """Take as many epochs of a stretch in one go as dynamics and measurement can; None: they can't."""
        options, d = self._options, len(self._observed)
        published = options.proposal == "prior" and options.likelihood == "gaussian" and options.fixed_point == 1
        if self.stochastic or not published or self._observed.tolist() != [0, 1, 2]:
            return None
        tempered = kernels.sample_step.Tempered(
            fixed_normals(d, options.samples)[0],
            self._observed,
            float(np.sqrt(options.alpha / 2)),
            1 / self._total_alpha,
            d * (d + 3) / 2,
        )
        update = CompiledUpdate("filtered_by_samples", tempered, ("ess", "fallback", "nis_tempered"))
        return self.epochs_by(AlphaKalmanFilter, update, belief, stretch, first_epoch)

    def correct(self, belief: Gaussian, z: Array, step: Step) -> tuple[Gaussian, Innovation]:
        """Return the Gaussian with the weighted samples' moments."""
        prior = whitened_prior(belief, self._observed)
        model = self.linearise(belief, z, step.epoch)
        mean, covariance, ess = self._project(prior, belief, model, z, step)
        posterior = prior.posterior(mean, covariance)
        # Fewer effective samples than moments say nothing of a covariance; NaN fails the comparison too.
        d = mean.shape[1]
        P = posterior.covariance
        usable = (ess > d * (d + 3) / 2) & np.isfinite(P.reshape(len(P), P.shape[1] ** 2).sum(axis=1))
        posterior, failed = self.with_fallback(posterior, usable, belief, z, self._total_alpha, step)
        innovation = model.innovation()
        extras = {
            "ess": ess,
            "fallback": 1.0 - usable,
            "nis_tempered": model.innovation(1 / self._total_alpha).nis,
        }
        return posterior, replace(innovation, extras=extras, failed=failed)

    def _project(
        self, prior: WhitenedPrior, belief: Gaussian, model: Linearisation, z: Array, step: Step
    ) -> tuple[Array, Array, Array]:
        """Return mean (runs, d), covariance (runs, d, d) of the whitened observed states, and ESS (runs,)."""
        options = self._options
        proposal = self._first_proposal(prior, belief, model, z, step)
        R = by_run(self._independent_noise(belief, model, step.epoch), self.kind)
        # W with W^T W = (alpha / 2) R^-1
        scale, *_ = kernel_for(R, kernels.roots, "whiten")(R, self._tempering)
        sizes = []
        for _ in range(options.fixed_point):
            e = self._draw(prior)
            centre, root = prior.samples() if proposal is None else prior.samples(proposal.mean, proposal.root)
            costs = self._cost((centre, root, e), belief.mean, scale, z, step.epoch)
            if proposal is not None and proposal.exponent.any():
                costs -= proposal.log_ratio(e)
            mean, covariance, ess = kernel_for(e, kernels.sampling, "moments")(costs, e, self._kind)
            if proposal is not None:
                mean = proposal.mean + np.einsum("bij,bj->bi", proposal.root, mean)
                covariance = symmetric(proposal.root @ covariance @ transpose(proposal.root))
            sizes.append(ess)
            if options.fixed_point > 1:
                # p^alpha q^(1 - alpha) / q = (p / q)^alpha: the last q is the next step's proposal.
                proposal = _Proposal(mean, cholesky(covariance), np.full(len(z), options.alpha, self.kind))
        return mean, covariance, ess if len(sizes) == 1 else np.fmin.reduce(sizes)

    def _independent_noise(self, belief: Gaussian, model: Linearisation, epoch: int) -> Array:
        """Return R for the likelihood, as every run has it where channels are independent: absent ones add nothing."""
        if present_channels(self.seen) is not None:
            R = all_channels(self.seen).noise(belief.mean, epoch)
            if R.ndim == 2 and np.count_nonzero(R) == np.count_nonzero(np.diagonal(R)):
                return R
        return model.R

    def _first_proposal(
        self, prior: WhitenedPrior, belief: Gaussian, model: Linearisation, z: Array, step: Step
    ) -> _Proposal | None:
        """Return the widened posterior in runs where the prediction's samples would be wasted; None: in no run."""
        options = self._options
        d = prior.roots.shape[1]
        if options.proposal == "prior":
            return None
        efficiency = sampling_efficiency(model, options.alpha)
        low = ~(efficiency * options.samples >= max(50 * d, options.samples / 20))
        if not low.any():
            return None
        posterior, _ = self.iterated_update(belief, z, options.alpha, step)
        mean, root = prior.coordinates(posterior)
        widened = _Proposal(mean, options.proposal_spread**0.5 * root, np.ones(len(z), self.kind))
        unit = np.broadcast_to(np.eye(d, dtype=self.kind), root.shape)
        prediction = _Proposal(np.zeros((len(z), d), self.kind), unit, np.zeros(len(z), self.kind))
        return where_runs(low, widened, prediction)

    def _draw(self, prior: WhitenedPrior) -> Array:
        """Return standard normal samples, (runs, d, N) or (1, d, N)."""
        d, N = prior.roots.shape[1], self._options.samples
        if self._options.sampling == "fixed":
            return fixed_normals(d, N).astype(self.kind, copy=False)
        if self._options.sampling == "random":
            return standard_normals(self._streams, d, N).astype(self.kind, copy=False)
        half = standard_normals(self._streams, d, N // 2).astype(self.kind, copy=False)
        return np.concatenate([half, -half], axis=2)

    def _cost(self, samples: tuple[Array, Array, Array], mean: Array, scale: Array, z: Array, epoch: int) -> Array:
        """Return -alpha log p(z | states) up to a constant, (runs, N).

        Args:
            samples: Centre (runs, n), root (runs, n, d) and e of the states centre + root e.
            mean: Predicted means (runs, n).
            scale: (runs or 1, m, m), scale^T scale = alpha R^-1 / 2.
            z: Measurements (runs, m).
            epoch: Their epoch.
        """
        if self._options.likelihood == "mixture":
            # A density is a part of the model, and evaluated as that: in float64.
            states, z, mean = (A.astype(DOUBLE, copy=False) for A in (affine(*samples), z, mean))
            costs = -self._options.alpha * log_likelihood(self.measurement, z, states, mean, epoch)
            return costs.astype(self.kind, copy=False)
        return squared_errors(self.seen, z, scale, *samples, epoch)


@dataclass(frozen=True)
class _Proposal:
    """N(mean, root root^T) of the whitened observed states; `exponent` on target over proposal, 0 for the prior."""

    mean: Array
    root: Array
    exponent: Array

    def log_ratio(self, e: Array) -> Array:
        """Return exponent (log N(y; 0, I) - log N(e; 0, I)), (runs, N), y = mean + root e: the prior over this one."""
        y = self.mean[:, :, None] + self.root @ e
        ratio = np.einsum("bin,bin->bn", e, e) - np.einsum("bin,bin->bn", y, y)
        return 0.5 * self.exponent[:, None] * ratio


def sampling_efficiency(model: Linearisation, alpha: float) -> Array:
    """Return the expected ESS / N of samples of the prediction weighted by the likelihood to the power alpha.

    Exact for a linear measurement: with M = H P H^T and A = alpha M it is |R|^1/2 |R + 2 A|^1/2 / |R + A|
    exp(-alpha nu^T [(R + A)^-1 - (R + 2 A)^-1] nu), from the Gaussian integrals E[l^alpha]^2 / E[l^(2 alpha)].
    """
    A = alpha * model.HPH
    R = CholeskyFactor(np.broadcast_to(model.R, A.shape))
    once, twice = CholeskyFactor(model.R + A), CholeskyFactor(model.R + 2 * A)
    exponent = np.square(once.whiten(model.residual)).sum(axis=1) - np.square(twice.whiten(model.residual)).sum(axis=1)
    log_volume = (R.log_determinant() + twice.log_determinant()) / 2 - once.log_determinant()
    return np.exp(log_volume - alpha * exponent)
