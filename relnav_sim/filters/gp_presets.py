"""The filters of Wei, Song and Zhang (2012): other files' algorithms over learned dynamics, with their settings."""

from __future__ import annotations

from pydantic import Field

from relnav_sim.filters.particle import ParticleFilter, ParticleOptions, particle_operations
from relnav_sim.filters.registry import register_filter
from relnav_sim.filters.ukf import UnscentedKalmanFilter, UnscentedOptions, unscented_operations
from relnav_sim.filters.unscented_particle import (
    UnscentedParticleFilter,
    UnscentedParticleOptions,
    unscented_particle_operations,
)


class GpParticleOptions(ParticleOptions):
    """Options of the particle filter over learned dynamics."""

    particles: int = Field(
        default=500, ge=2, le=1_000_000, description="Number of particles N; the paper does not tell; default 500"
    )
    ess_fraction: float = Field(
        default=1.0,
        ge=0,
        le=1,
        description="Resample when the effective sample size falls below this fraction of N; default 1: always, as the "
        "paper's listed steps do",
    )
    mcmc_steps: int = Field(
        default=1, ge=0, le=100, description="Metropolis moves after resampling; default 1, the paper's last step"
    )


@register_filter(
    "gp_particle",
    GpParticleOptions,
    cost_us=2900.0,
    learned_dynamics=True,
    overhead_us=2500.0,
    operations=particle_operations,
)
class GpParticleFilter(ParticleFilter):
    """Particle filter over learned dynamics: `particle` that resamples at every measurement and moves once.

    Ko and Fox, Autonomous Robots 27, 2009. It is also what the listed steps of Wei, Song and Zhang (2012) amount to:
    they draw from the Gaussian process, weigh, resample and move, and run no unscented filter; with that proposal the
    transition densities of their equation 7 cancel and the weight is the likelihood. Use it with dynamics of kind `gp`.
    The process's variance is all the process noise there is: tiny where training data are dense, which is why
    `roughening` is on, and too small off the training data unless it was calibrated there.
    """


class GpUkfOptions(UnscentedOptions):
    """Options of the unscented Kalman filter over learned dynamics."""


@register_filter(
    "gp_ukf", GpUkfOptions, cost_us=26.0, learned_dynamics=True, overhead_us=230.0, operations=unscented_operations
)
class GpUnscentedKalmanFilter(UnscentedKalmanFilter):
    """Unscented Kalman filter over learned dynamics: `ukf` whose sigma points go through a Gaussian process.

    Ko and Fox, Autonomous Robots 27, 2009, with the process noise taken at the mean. Use it with dynamics of kind `gp`:
    as accurate as the particle filters of the same model where the belief is close to a Gaussian, at a hundredth of
    their cost.
    """


class MfUpfOptions(UnscentedParticleOptions):
    """Options of the model-free unscented particle filter."""

    particles: int = Field(
        default=500, ge=2, le=1_000_000, description="Number of particles N; the paper does not tell; default 500"
    )


@register_filter(
    "mf_upf",
    MfUpfOptions,
    cost_us=3000.0,
    learned_dynamics=True,
    overhead_us=2500.0,
    operations=unscented_particle_operations,
)
class ModelFreeUnscentedParticleFilter(UnscentedParticleFilter):
    """Model-free unscented particle filter: `unscented_particle` over learned dynamics.

    Wei, Song and Zhang, Systems Engineering and Electronics 34(6), 2012: each particle's mean and process noise come
    from a Gaussian process, and the unscented filter's proposal from them. The paper names this filter, but the steps
    it lists are those of `gp_particle`. Use it with dynamics of kind `gp`. Nearly all of its cost is the variance at
    every particle; the dynamics' `variance: cloud_mean` saves most of that.

    The paper's velocities, ten times better than those of a particle filter with Clohessy-Wiltshire dynamics, rest on
    the process noise of that filter, 1e-3 m/s a step where 1e-6 m/s^2 act: the same filter with the right noise does as
    well.
    """
