"""Moment-matching Kalman filter: the alpha-divergence filter at alpha = 1."""

from __future__ import annotations

from relnav_sim.dynamics.interface import Dynamics
from relnav_sim.filters.alpha_kf import AlphaKalmanFilter, AlphaOptions, ImportanceOptions, sampled_operations
from relnav_sim.filters.registry import register_filter
from relnav_sim.measurements.interface import Measurement


@register_filter("mkf", ImportanceOptions, cost_us=180.0, overhead_us=140.0, operations=sampled_operations)
class MomentMatchingFilter(AlphaKalmanFilter):
    """Moment-matching Kalman filter: the Gaussian with the posterior's own mean and covariance, KL(p|q).

    Gultekin and Paisley (IEEE Trans. Signal Processing 65(23), 2017, algorithm 2), which is the Gaussian particle
    filter of Kotecha and Djuric (IEEE Trans. Signal Processing 51(10), 2003): `alpha_kf` at alpha = 1, same options
    and extras. It covers the whole posterior, also where that has two modes.

    Use it where the measurement bends over the prediction's spread and the posterior is still unimodal: it then
    has no linearisation error. For a linear measurement it is the Kalman filter plus sampling noise. Samples of the
    prediction are wasted where the prediction is much wider than the measurement; take `proposal: posterior`.
    """

    def __init__(self, dynamics: Dynamics, measurement: Measurement, options: ImportanceOptions) -> None:
        super().__init__(dynamics, measurement, _at_one(options))


def _at_one(options: ImportanceOptions) -> AlphaOptions:
    """Return the options with alpha = 1; a campaign's entry holds keys of its own as well."""
    return AlphaOptions(alpha=1.0, **{name: getattr(options, name) for name in ImportanceOptions.model_fields})
