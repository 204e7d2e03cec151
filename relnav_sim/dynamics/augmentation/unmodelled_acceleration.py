"""The unmodelled acceleration of dynamic model compensation, as augmented states of a filter."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.dynamics.augmentation.kinds import AugmentedStateOptions
from relnav_sim.dynamics.correlated_acceleration import CorrelatedAcceleration
from relnav_sim.dynamics.process_noise import DmcOptions, ProcessNoiseOptions


class UnmodelledAcceleration(AugmentedStateOptions):
    """The three states of `dmc`: no entry of `augment`, for they are the filter's process noise."""

    names: ClassVar[tuple[str, ...]] = (
        "unmodelled_acceleration_x",
        "unmodelled_acceleration_y",
        "unmodelled_acceleration_z",
    )
    units: ClassVar[tuple[str, ...]] = ("m/s^2",) * 3

    kind: Literal["unmodelled_acceleration"] = "unmodelled_acceleration"
    dmc: DmcOptions

    @property
    def sigmas(self) -> Array:
        """Standard deviations (3,) at the start, m/s^2, which the processes keep."""
        return np.array([axis.sigma_m_s2 for axis in self.dmc.axes])

    @property
    def correlated(self) -> tuple[CorrelatedAcceleration, ...]:
        """The processes, one a state."""
        return tuple(
            CorrelatedAcceleration(place, axis.sigma_m_s2, axis.tau_s) for place, axis in enumerate(self.dmc.axes)
        )

    def motion(self, step_s: float) -> tuple[Array, Array]:
        """Return the factors of the three processes, and the variances that they gain."""
        per_tau = step_s / np.array([axis.tau_s for axis in self.dmc.axes])
        return np.diag(np.exp(-per_tau)), np.diag(self.sigmas**2 * -np.expm1(-2 * per_tau))


def process_noise_states(noise: ProcessNoiseOptions) -> tuple[AugmentedStateOptions, ...]:
    """Return the augmented states that a filter's process noise brings."""
    return () if noise.dmc is None else (UnmodelledAcceleration(dmc=noise.dmc),)
