"""A measurement that was taken some time before its epoch, as a filter that knows the latency sees it."""

from __future__ import annotations

from relnav_sim.arrays import Array
from relnav_sim.measurements.around import Around
from relnav_sim.measurements.interface import Measurement, Mixture, linearised


class Delayed(Around):
    """The base measurement of the state some time ago: h(r - v latency, v).

    The relative velocity is taken as constant meanwhile. What that leaves out is half the relative acceleration times
    the square of the latency, 1e-3 m at 1e-3 m/s^2 and 1.4 s, and thrust within the latency: an impulse dv puts the
    readings of the next `latency_s` off by at most dv times the latency.

    Args:
        base: The measurement without latency; its state begins with position and velocity.
        latency_s: Time from the measurement to its epoch, s.
    """

    change = "a latency"

    def __init__(self, base: Measurement, latency_s: float) -> None:
        super().__init__(base)
        self.latency_s = latency_s
        # The position some time ago depends on the velocity as well.
        self.depends_on = None

    def _own_density(self, z: Array, states: Array, epoch: int) -> Array:
        """Return the base's own log p(z | states) at the states some time ago, (runs, ...)."""
        return self.base.log_likelihood(z, self._earlier(states), epoch)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return the base's h at the states some time ago, (runs, ..., m)."""
        return self.base.predict(self._earlier(states), epoch)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the derivatives with respect to the states now."""
        return self._by_states_now(self.base.jacobian(self._earlier(states), epoch))

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), Jacobian and R at the means (runs, n)."""
        residual, H, R = linearised(self.base, z, self._earlier(mean), epoch)
        return residual, self._by_states_now(H), R

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return the base's R at the mean some time ago."""
        return self.base.noise(self._earlier(mean), epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the base's noise, if it has any."""
        return self.base.mixture(self._earlier(mean), epoch)

    def turning(self, states: Array, epoch: int) -> Array:
        """Return what a small turn of the host does to the base's reading at the states some time ago.

        Raises:
            TypeError: The base can't say.
        """
        return super().turning(self._earlier(states), epoch)

    def _by_states_now(self, by_earlier: Array) -> Array:
        H = by_earlier.copy()
        H[..., 3:6] -= self.latency_s * H[..., :3]
        return H

    def _earlier(self, states: Array) -> Array:
        earlier = states.copy()
        earlier[..., :3] -= self.latency_s * states[..., 3:6]
        return earlier
