"""A measurement that was taken some time before its epoch, as a filter that knows the latency sees it."""

from __future__ import annotations

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.measurements.around import Around
from relnav_sim.measurements.interface import Measurement, Mixture, linearised


class Delayed(Around):
    """The base measurement of the state some time ago: h(r - v latency, v).

    The relative velocity is taken as constant meanwhile. What that leaves out is half the relative acceleration times
    the square of the latency, 1e-3 m at 1e-3 m/s^2 and 1.4 s, and thrust within the latency: an impulse dv puts the
    measurements of the next `latency_s` off by at most dv times the latency.

    Args:
        base: The measurement without latency; its state begins with position and velocity.
        latency_s: Time from the measurement to its epoch, s.
        told: Whether each measurement has a latency of its own behind it, from `with_latency`, on top of that.
    """

    change = "a latency"

    def __init__(self, base: Measurement, latency_s: float, told: bool = False) -> None:
        super().__init__(base)
        self.latency_s = latency_s
        self._is_told = told
        self._told: Array | None = None
        self._first_epoch = 0
        # The position some time ago depends on the velocity as well.
        self.depends_on = None

    def take(self, z: Array, first_epoch: int) -> Array:
        """Return the measurements (runs, K, m) without the latencies behind them, which are kept."""
        if self._is_told:
            # An epoch after the other in memory; where nothing is read, none is of account.
            self._told, self._first_epoch = np.nan_to_num(z[..., -1].T, copy=True), first_epoch
            z = z[..., :-1]
        return super().take(z, first_epoch)

    def _own_density(self, z: Array, states: Array, epoch: int) -> Array:
        """Return the base's own log p(z | states) at the states some time ago, (runs, ...)."""
        return self.base.log_likelihood(z, self._earlier(states, epoch), epoch)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the base's h at the states some time ago, (runs, ..., m)."""
        return self.base.predict(self._earlier(states, epoch), epoch)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the derivatives with respect to the states now."""
        return self._by_states_now(self.base.jacobian(self._earlier(states, epoch), epoch), epoch)

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), Jacobian and R at the means (runs, n)."""
        residual, H, R = linearised(self.base, z, self._earlier(mean, epoch), epoch)
        return residual, self._by_states_now(H, epoch), R

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the base's R at the mean some time ago."""
        return self.base.noise(self._earlier(mean, epoch), epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the base's noise, if it has any."""
        return self.base.mixture(self._earlier(mean, epoch), epoch)

    def turning(self, states: Array, epoch: int) -> Array:
        """Return what a small turn of the host does to the base's measurement at the states some time ago.

        Raises:
            TypeError: The base can't say.
        """
        return super().turning(self._earlier(states, epoch), epoch)

    def _by_states_now(self, by_earlier: Array, epoch: int) -> Array:
        if self._told is not None and by_earlier.ndim == 2:  # a constant (m, n) is no longer that where runs differ
            by_earlier = np.broadcast_to(by_earlier, (self._told.shape[1], *by_earlier.shape))
        H = by_earlier.copy()
        H[..., 3:6] -= self._latency(epoch, H.ndim) * H[..., :3]
        return H

    def _earlier(self, states: Array, epoch: int) -> Array:
        earlier = states.copy()
        earlier[..., :3] -= self._latency(epoch, states.ndim) * states[..., 3:6]
        return earlier

    def _latency(self, epoch: int, axes: int) -> Array | float:
        """Return the latency of an epoch, s: one, or of each run with so many axes, (runs, 1, ...)."""
        if self._told is None:
            return self.latency_s
        late_s = self._told[epoch - self._first_epoch]
        return self.latency_s + late_s.reshape(-1, *[1] * (axes - 1))


def with_latency(z: Array, late_s: Array) -> Array:
    """Return measurements (runs, K, m) with their latencies (runs, K), s, behind: (runs, K, m + 1)."""
    return np.concatenate([z, late_s[..., None]], axis=-1)
