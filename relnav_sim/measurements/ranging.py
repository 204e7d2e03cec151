"""Range, and range and range rate, as a filter sees them; and a range whose noise grows with the distance.

The range rate is rho' = u . v with the line of sight u and the state's relative velocity v, the derivative of the
position's components: the turn of the frame moves r and u alike, so it needs no frame rate, and it is the same from
either craft (Montenbruck and Gill 2000, section 6.1).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from relnav_sim import kernels
from relnav_sim.arrays import Array
from relnav_sim.astro.chief_orbit import ChiefOrbit
from relnav_sim.astro.line_of_sight import components, dot, mounting_matrix
from relnav_sim.linalg import in_rows, matrices
from relnav_sim.measurements.around import Around
from relnav_sim.measurements.given_noise import MixtureNoise, checked_noise, mixture_of, noise_at
from relnav_sim.measurements.interface import Measurement, MeasurementDefaults, Mixture, linearised
from relnav_sim.measurements.spherical_radar import SightNoise, SphericalRadar


class Ranging(MeasurementDefaults):
    """Range of the other craft, m, and with two channels its range rate, m/s.

    The state begins with the deputy's position and velocity relative to the chief, RTN (m, m/s); more states may
    follow. From chief and deputy alike. Neither channel has derivatives where the craft meet.

    Args:
        noise: R, (1, 1) or (2, 2), or a mixture; its size says how many channels there are.

    Raises:
        ValueError: The noise is no covariance, or of another size.
    """

    leaves_arguments_alone = True

    def __init__(self, noise: ArrayLike | MixtureNoise) -> None:
        self._noise = checked_noise(noise, None)
        matrix = self._noise.covariance if isinstance(self._noise, MixtureNoise) else self._noise
        self.dimension = int(matrix.shape[-1])
        if self.dimension > 2:
            raise ValueError(f"the noise is for {self.dimension} channels; there are range and range rate")
        self.depends_on = (0, 1, 2) if self.dimension == 1 else (0, 1, 2, 3, 4, 5)

    def predict(self, states: Array, epoch: int) -> Array:
        """Return range and range rate of states (runs, ..., n): (runs, ..., 1 or 2)."""
        return kernels.ranging.readings(in_rows(states), self.dimension).reshape(*states.shape[:-1], self.dimension)

    def jacobian(self, states: Array, epoch: int) -> Array:
        """Return the derivatives, (runs, ..., 1 or 2, n): u by position; (v - rho' u) / rho and u for the rate."""
        return kernels.ranging.jacobian(in_rows(states), self.dimension).reshape(
            *states.shape[:-1], self.dimension, states.shape[-1]
        )

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R."""
        return noise_at(self._noise, epoch)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the components of the noise, if it is a mixture."""
        return mixture_of(self._noise)


class GrowingRangeNoise(Around):
    """A measurement whose first channel, the range, is noisier the farther the target: sigma = (1 + c rho) sigma_0.

    R is taken at the predicted range. Taken at the measurement it would depend on the noise, give short ranges more
    weight and bias the filter. Its derivative by the state is left out, as in any filter of this kind.

    Args:
        base: The measurement with sigma_0, the noise at no distance.
        growth_per_m: c, 1/m.
    """

    change = "a noise that grows with the range"

    def __init__(self, base: Measurement, growth_per_m: float) -> None:
        super().__init__(base)
        self._growth = growth_per_m

    def noise(self, mean: Array, epoch: int) -> Array:
        """Return R at the predicted mean (runs, n), (runs, m, m)."""
        return kernels.ranging.grown(matrices(self.base.noise(mean, epoch)), in_rows(mean), self._growth)

    def linearised(self, z: Array, mean: Array, epoch: int) -> tuple[Array, Array, Array]:
        """Return residual (runs, m), Jacobian and R at the means (runs, n)."""
        residual, H, R = linearised(self.base, z, mean, epoch)
        return residual, H, kernels.ranging.grown(matrices(R), in_rows(mean), self._growth)

    def mixture(self, mean: Array, epoch: int) -> Mixture | None:
        """Return the base's components, each with its range as noisy as at the mean, (runs, k, m, m)."""
        mixture = self.base.mixture(mean, epoch)
        if mixture is None:
            return None
        covariances = mixture.covariances
        scaled = np.array(np.broadcast_to(covariances, (len(mean), *covariances.shape[-3:])))
        r = components(mean)
        scaled[:, :, 0, 0] *= np.square(1 + self._growth * np.sqrt(dot(r, r)))[:, None]
        return Mixture(mixture.weights, scaled, mixture.shared)


def lidar(
    *,
    range_sigma_m: float,
    range_sigma_m_per_km: float = 0.0,
    angle_sigma_deg: float | None = None,
    mounting_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    host: Literal["chief", "deputy"] = "chief",
    chief_orbit: ChiefOrbit | None = None,
    step_s: float | None = None,
) -> Measurement:
    """Return what a filter believes of a lidar or rangefinder: range, and with an angle sigma two angles.

    z is the range (m), or range, azimuth and elevation (m, rad, rad) in the lidar's frame. The range's sigma is
    `range_sigma_m` + `range_sigma_m_per_km` x distance / km, in R at the predicted distance.

    Args:
        range_sigma_m: Range noise at no distance, 1 sigma, m.
        range_sigma_m_per_km: What a kilometre of distance adds to it, m.
        angle_sigma_deg: Noise of azimuth and of elevation, 1 sigma, deg; None: the range alone.
        mounting_deg: Yaw, pitch and roll from the host's LVLH frame to the lidar's frame, deg.
        host: Craft that carries it.
        chief_orbit: The chief's orbit at epoch 0; a lidar with angles on the deputy needs it.
        step_s: Time between epochs, s; a lidar with angles on the deputy of an elliptic orbit needs it.

    Raises:
        ValueError: A sigma is not positive, or the orbit or the step is missing.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import measurements
        >>> state = np.array([[3.0, 400.0, 0.0, 0.0, -0.1, 0.0]])
        >>> rangefinder = measurements.lidar(range_sigma_m=0.02, range_sigma_m_per_km=0.1)
        >>> rangefinder.predict(state, 0).round(3), np.sqrt(rangefinder.noise(state, 0)).round(3)
        (array([[400.011]]), array([[[0.06]]]))
    """
    _check_positive(range_sigma_m=range_sigma_m)
    if not 0 <= range_sigma_m_per_km < np.inf:
        raise ValueError(f"range_sigma_m_per_km is {range_sigma_m_per_km:g}; it must be 0 or more")
    base: Measurement
    if angle_sigma_deg is None:
        base = Ranging([[range_sigma_m**2]])
    else:
        _check_positive(angle_sigma_deg=angle_sigma_deg)
        sigmas = np.array([range_sigma_m, *np.radians([angle_sigma_deg] * 2)])
        noise = SightNoise(np.ones(1), sigmas[None], sigmas, np.zeros((3, 3)))
        base = SphericalRadar(mounting_matrix(*mounting_deg), noise, host, chief_orbit, step_s)
    return GrowingRangeNoise(base, 1e-3 * range_sigma_m_per_km / range_sigma_m) if range_sigma_m_per_km else base


def crosslink(*, range_sigma_m: float, range_rate_sigma_m_s: float | None = None) -> Ranging:
    """Return what a filter believes of a radio link between the craft: range (m), or range and range rate (m/s).

    Args:
        range_sigma_m: Range noise, 1 sigma, m.
        range_rate_sigma_m_s: Range-rate noise, 1 sigma, m/s; default: it measures the range alone.

    Raises:
        ValueError: A sigma is not positive.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import measurements
        >>> link = measurements.crosslink(range_sigma_m=0.5, range_rate_sigma_m_s=1e-3)
        >>> link.predict(np.array([[0.0, 300.0, 400.0, 0.0, 0.1, 0.2]]), 0).round(3).tolist()
        [[500.0, 0.22]]
    """
    _check_positive(range_sigma_m=range_sigma_m)
    if range_rate_sigma_m_s is None:
        return Ranging([[range_sigma_m**2]])
    _check_positive(range_rate_sigma_m_s=range_rate_sigma_m_s)
    return Ranging(np.diag(np.square([range_sigma_m, range_rate_sigma_m_s])))


def _check_positive(**sigmas: float) -> None:
    for name, sigma in sigmas.items():
        if not 0 < sigma < np.inf:
            raise ValueError(f"{name} is {sigma:g}; it must be positive and finite")
