"""Where a run starts again that has locked itself out: at the next fix, as a run starts at its first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relnav_sim.arrays import Array
from relnav_sim.campaign.entries import FilterEntry
from relnav_sim.campaign.models import CaseConfig
from relnav_sim.campaign.restarts import restart_sensors
from relnav_sim.dynamics.augmentation.extension import Extension
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Gaussian
from relnav_sim.simulation.augmented_states import extended_by
from relnav_sim.simulation.chunks import Chunk
from relnav_sim.simulation.start import FixMaker


class FixRestart:
    """Starts runs again from the fixes of a filter's sensors.

    The position is that of the fix, with its covariance. No fix tells the velocity: the estimate keeps the one it has,
    with the start's variance added to its own, so that a second restart is the more cautious one. A fix that was taken
    before its epoch, as recorded ones are, is moved on by that velocity. What the filter carries besides starts as it
    did at first.

    Args:
        entry: The filter.
        config: The case.
        extension: Its augmented states, if any.
    """

    def __init__(self, entry: FilterEntry, config: CaseConfig, extension: Extension | None) -> None:
        self._config, self._extension = config, extension
        self._makers = {name: FixMaker(config, name) for name in restart_sensors(config.sensors, entry.sensors)}
        self._velocity_noise = np.diag(np.square(config.start.velocity_sigma_m_s) * np.ones(3))
        self._chunk: Chunk | None = None

    def take(self, chunk: Chunk) -> None:
        """Be told what arrives in the next chunk of epochs."""
        self._chunk = chunk

    def __call__(self, sensor: str, belief: Gaussian, step: Step) -> Gaussian | None:
        """Return where runs start again from the sensor's measurement at this epoch, NaN in runs without a fix.

        None where the sensor gives no position by itself.
        """
        if sensor not in self._makers or self._chunk is None:
            return None
        k = step.epoch - self._chunk.first_epoch
        position, covariance = self._makers[sensor].fix(self._chunk, k)
        velocity: Array = belief.mean[:, 3:6]
        P = np.zeros((len(position), 6, 6))
        P[:, :3, :3] = covariance
        P[:, 3:, 3:] = V = belief.covariance[:, 3:6, 3:6] + self._velocity_noise
        if sensor in self._chunk.late:
            late_s = np.nan_to_num(self._chunk.late[sensor][:, k, None])  # NaN where nothing is read
            position = position + late_s * velocity
            P[:, 3:, :3] = P[:, :3, 3:] = late_s[..., None] * V
            P[:, :3, :3] += np.square(late_s)[..., None] * V
        again = Gaussian(np.concatenate([position, velocity], axis=1), P)
        if self._extension is None:
            return again
        # Runs without a fix are left out by the caller; the equations must not fail for all of them together.
        known = np.isfinite(position.sum(axis=1))
        sound = replace(again, mean=np.where(known[:, None], again.mean, belief.mean[:, :6]))
        extended = extended_by(sound, self._extension, self._config, sensor, step.epoch)
        return replace(extended, mean=np.where(known[:, None], extended.mean, np.nan))
