"""The difference of each measurement from its prediction, channel by channel, for those who look at residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from relnav_sim.arrays import Array, Mask
from relnav_sim.dynamics.interface import Step
from relnav_sim.filters.belief import Belief, Filter, believed_noise
from relnav_sim.filters.readings import Readings
from relnav_sim.kernels.compiling import working_cpu_s
from relnav_sim.measurements.interface import linearised


@dataclass(frozen=True)
class ChannelResiduals:
    """The residuals of one sensor before its updates, NaN where a channel was not read.

    Attributes:
        residual: z - h(mean), (runs, T, m), SI units and rad.
        sigma: Square root of the diagonal of H P H^T + R, (runs, T, m): what the filter expects of them, by the R that
            it works with.
        rejected: Channels that were read and that the filter did not take, (runs, T, m).
    """

    residual: Array
    sigma: Array
    rejected: Mask

    @property
    def accepted(self) -> Array:
        """The residuals of what the filter took, (runs, T, m); NaN elsewhere.

        Those of rejected measurements tell of faults and outliers, and the counts of editing do so.
        """
        return np.where(self.rejected, np.nan, self.residual)

    @property
    def normalised(self) -> Array:
        """The accepted residuals in sigmas, (runs, T, m): white with variance 1 where filter and models are right."""
        return self.accepted / self.sigma

    def after(self, epochs: int) -> ChannelResiduals:
        """Return the residuals with so many more epochs at the start, at which nothing was read."""

        def preceded(series: Array) -> Array:
            return np.concatenate([np.full((len(series), epochs, series.shape[2]), np.nan), series], axis=1)

        unread = np.zeros((len(self.rejected), epochs, self.rejected.shape[2]), dtype=bool)
        rejected = np.concatenate([unread, self.rejected], axis=1)
        return ChannelResiduals(preceded(self.residual), preceded(self.sigma), rejected)


class ResidualRecorder:
    """Takes down the residuals of a chunk of epochs, of any filter: by the mean and covariance of its belief.

    Args:
        readings: What arrives in the chunk.
        runs: Number of runs.
        epochs: Number K of epochs.

    Attributes:
        cpu_s: CPU time spent on it so far, s.
    """

    def __init__(self, readings: Readings, runs: int, epochs: int) -> None:
        self.cpu_s = 0.0
        self._readings = readings
        shapes = [(runs, epochs, one.z.shape[-1]) for one in readings.sensors]
        self._series = [
            ChannelResiduals(np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(shape, dtype=bool))
            for shape in shapes
        ]

    def add(self, place: int, k: int, filter: Filter, belief: Belief, z: Array, read: Mask, epoch: int) -> None:
        """Take down the residuals of the sensor in that place at column k, before its update.

        Args:
            place: The sensor's place.
            k: The column.
            filter: The filter, whose measurement attends to that sensor.
            belief: The belief before the update.
            z: The measurement (runs, m) in the channels of the filter's measurement.
            read: Runs that have one, (runs,).
            epoch: Number of the epoch.
        """
        begin, measurement = working_cpu_s(), filter.measurement
        mean = np.ascontiguousarray(belief.mean)
        expected = np.where(read[:, None], z, measurement.predict(mean, epoch))
        residual, H, R = linearised(measurement, expected, mean, epoch)
        believed = believed_noise(filter, belief, epoch)
        R = R if believed is None else believed
        H = np.broadcast_to(H, (*z.shape, mean.shape[1]))
        variance = np.einsum("bmi,bij,bmj->bm", H, belief.covariance, H) + np.diagonal(R, axis1=-2, axis2=-1)
        one = self._readings.sensors[place]
        there = read[:, None] if one.present is None else read[:, None] & one.present[:, k]
        own = self._series[place]
        channels = one.sensor.channels
        own.residual[:, k] = np.where(there, residual[:, channels], np.nan)
        own.sigma[:, k] = np.where(there, np.sqrt(variance[:, channels]), np.nan)
        self.cpu_s += working_cpu_s() - begin

    def reject(self, place: int, k: int, refused: Mask) -> None:
        """Take down what the filter has not taken of the measurement of the sensor in that place at column k.

        Args:
            place: The sensor's place.
            k: The column.
            refused: Channels of the filter's measurement, (runs, m).
        """
        own = self._series[place]
        there = ~np.isnan(own.residual[:, k])
        own.rejected[:, k] = refused[:, self._readings.sensors[place].sensor.channels] & there

    def by_sensor(self, failed: Mapping[int, int], first: Step) -> Mapping[str, ChannelResiduals]:
        """Return what was taken down, by the sensor's name.

        Args:
            failed: Epochs at which runs failed, by their place; nothing is left of theirs from there on.
            first: The chunk's first epoch.
        """
        for run, epoch in failed.items():
            for own in self._series:
                own.residual[run, epoch - first.epoch :] = own.sigma[run, epoch - first.epoch :] = np.nan
        return {one.sensor.name: own for one, own in zip(self._readings.sensors, self._series, strict=True)}
