"""First-order Gauss-Markov noise."""

from __future__ import annotations

from math import exp, expm1, sqrt
from typing import ClassVar, Literal

from pydantic import Field

from relnav_sim.arrays import Array
from relnav_sim.options import Effect, Options
from relnav_sim.sensors.noise.process import NoiseProcess, NoiseSetting


class GaussMarkovNoise(Options):
    """Noise correlated in time, E[v(t) v(t + d)] = scale^2 exp(-|d| / tau): multipath, star catalogue, thermal bending.

    Stationary from the first epoch. A filter whose memory is long against tau sees it as white noise of variance
    scale^2 coth(step / (2 tau)), about 2 scale^2 tau / step; one whose memory is short sees a bias. No filter is
    told of it (Maybeck, Stochastic Models, Estimation and Control 1, 1979, sec. 4.11).
    """

    stream: ClassVar[str] = "gauss_markov"
    effect: ClassVar[Effect] = Effect("correlated noise", "states")

    kind: Literal["gauss_markov"] = Field(default="gauss_markov", description="First-order Gauss-Markov noise")
    tau_s: float = Field(
        gt=0,
        description="Correlation time, s: the autocorrelation falls to 1/e; one far longer than the run makes a bias",
    )
    scale: float = Field(
        default=1.0,
        gt=0,
        description="Standard deviation in sigmas of the sensor; default 1: the sensor's sigma is the noise's",
    )

    def process(self, setting: NoiseSetting) -> NoiseProcess:
        """Return the process for one block."""
        return _GaussMarkov(setting, self.tau_s, self.scale)


class _GaussMarkov:
    """v_k = phi v_{k-1} + sqrt(1 - phi^2) w_k with v_0 = w_0; the filter's state is carried between chunks."""

    def __init__(self, setting: NoiseSetting, tau_s: float, scale: float) -> None:
        self._normals = setting.streams()
        self._channels = setting.channels
        self._scale = scale
        self._phi = exp(-setting.step_s / tau_s)
        self._gain = sqrt(-expm1(-2 * setting.step_s / tau_s))
        self._carried: Array | None = None

    def sample(self, times_s: Array) -> Array:
        from scipy.signal import lfilter  # here because it takes half a second to import

        draws = self._normals.normal(len(times_s), self._channels)
        if self._carried is None:
            # lfilter's state before v_0 that makes v_0 = w_0, a draw from the stationary law.
            self._carried = (1 - self._gain) * draws[:, :1]
        noise, self._carried = lfilter([self._gain], [1.0, -self._phi], draws, axis=1, zi=self._carried)
        scaled: Array = self._scale * noise
        return scaled
