"""What a filter said at every epoch, and how it is put together over a chunk of epochs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from relnav_sim.arrays import Array, Integers
from relnav_sim.filters.belief import Innovation
from relnav_sim.filters.channel_residuals import ChannelResiduals
from relnav_sim.filters.failed_runs import FailedRun
from relnav_sim.filters.readings import Readings, SensorReadings
from relnav_sim.filters.returned import check_name
from relnav_sim.notebook import table_html
from relnav_sim.wording import MISSING, counted

_COUNTED = ("rejected",)
"""Extras of which an epoch with several sensors has the sum; of others it has that of the last sensor read."""


@dataclass(frozen=True, repr=False)
class FilterHistory:
    """What a filter said at every epoch.

    The numbers by sensor have the names with which the filter was made; a filter of one measurement without a name has
    none of them.

    Args:
        mean: State estimate after the measurement, (runs, T, n).
        covariance: Its covariance, (runs, T, n, n).
        nis: Normalised innovation squared, (runs, T), summed over the sensors read; NaN where there was no measurement.
        log_likelihood: log p(z_k | earlier z), (runs, T), summed alike; 0 where there was no measurement.
        extras: Further numbers of the algorithm by name, each (runs, T); NaN where there was no measurement. With
            several sensors ``rejected`` is the number of rejected measurements, and all else that of the last sensor
            read.
        failures: The runs that failed, with epoch and reason; from there on their mean, covariance and log-likelihood
            are NaN.
        dof: Channels read, (runs, T): the mean of the NIS where the filter knows its own uncertainty; 0 where there was
            no measurement.
        nis_by: The NIS by sensor, each (runs, T); NaN where that sensor was not read. Those of one epoch are
            independent where the filter is right: each is taken after the update with the sensors before.
        dof_by: The channels read by sensor, each (runs, T).
        extras_by: The further numbers by sensor, then by name.
        residuals_by: The residuals by sensor and channel, where they were asked for.
        residuals_cpu_s: CPU time that it took to work them out, which is none of the filter's, s.
        edits_by: Where measurements are edited, what happened to them by sensor (under "" where it has no name), each
            (runs, T): the counts of `filters.editing.EDITS`, 0 where nothing was read.

    Examples:
        >>> import numpy as np
        >>> from relnav_sim import LinearDynamics, LinearMeasurement, create_filter, run_filter
        >>> twice = LinearMeasurement(np.ones((2, 1)), np.eye(2))
        >>> filter = create_filter("kf", LinearDynamics(np.eye(1), np.eye(1)), twice)
        >>> history = run_filter(filter, [[[0.3, 0.1], [0.2, np.nan], [np.nan, np.nan]]], np.zeros(1), np.eye(1))
        >>> history.dof.tolist()
        [[2, 1, 0]]
    """

    mean: Array
    covariance: Array
    nis: Array
    log_likelihood: Array
    extras: Mapping[str, Array]
    failures: tuple[FailedRun, ...] = ()
    dof: Integers = field(default_factory=lambda: np.zeros((0, 0), dtype=np.int64))
    nis_by: Mapping[str, Array] = field(default_factory=dict)
    dof_by: Mapping[str, Integers] = field(default_factory=dict)
    extras_by: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    residuals_by: Mapping[str, ChannelResiduals] = field(default_factory=dict)
    edits_by: Mapping[str, Mapping[str, Integers]] = field(default_factory=dict)
    residuals_cpu_s: float = 0.0

    def __repr__(self) -> str:
        B, T, n = self.mean.shape
        sizes = f"{counted(B, 'run')}, {counted(T, 'epoch')}, {counted(n, 'state')}"
        return f"<FilterHistory: {sizes}{f', {len(self.failures)} failed' if self.failures else ''}>"

    def _repr_html_(self) -> str:
        T = self.mean.shape[1]
        rows = []
        for k in sorted({0, T // 2, T - 1} if T else ()):
            sigma = np.sqrt(np.diagonal(self.covariance[:, k], axis1=-2, axis2=-1))
            rows.append([str(k), *(_cell(each[:, k]) for each in (self.nis, self.log_likelihood)), _cell(sigma[:, 0])])
        return table_html(repr(self).strip("<>"), ["epoch", "mean NIS", "log-likelihood", "sigma of state 0"], rows)

    @property
    def believed_nis_by(self) -> Mapping[str, Array]:
        """The NIS by sensor with the R that the filter works with.

        A filter whose `nis` is with the measurement's own R instead, so that it compares between filters, has the
        other one among its extras, as `nis_tempered`.
        """
        return {
            sensor: np.where(np.isnan(nis), nis, self.extras_by.get(sensor, {}).get("nis_tempered", nis))
            for sensor, nis in self.nis_by.items()
        }

    def after(self, mean: Array, covariance: Array) -> FilterHistory:
        """Return the history with more epochs at its start, at which nothing was read.

        Args:
            mean: What was known there, (runs, E, n).
            covariance: Its covariance, (runs, E, n, n).
        """
        B, E = mean.shape[:2]

        def preceded(before: Array, series: Array) -> Array:
            # Epochs first, as the series lies in memory.
            return np.concatenate([before.swapaxes(0, 1), series.swapaxes(0, 1)]).swapaxes(0, 1)

        def unread(series: Array) -> Array:
            return np.concatenate([np.full((B, E), np.nan), series], axis=1)

        def uncounted(counts: Integers) -> Integers:
            return np.concatenate([np.zeros((B, E), dtype=np.int64), counts], axis=1)

        return FilterHistory(
            preceded(mean, self.mean),
            preceded(covariance, self.covariance),
            unread(self.nis),
            np.concatenate([np.zeros((B, E)), self.log_likelihood], axis=1),
            {name: unread(extra) for name, extra in self.extras.items()},
            self.failures,
            uncounted(self.dof),
            {name: unread(nis) for name, nis in self.nis_by.items()},
            {name: uncounted(dof) for name, dof in self.dof_by.items()},
            {
                sensor: {name: unread(extra) for name, extra in extras.items()}
                for sensor, extras in self.extras_by.items()
            },
            {sensor: residuals.after(E) for sensor, residuals in self.residuals_by.items()},
            {
                sensor: {name: uncounted(count) for name, count in edits.items()}
                for sensor, edits in self.edits_by.items()
            },
            self.residuals_cpu_s,
        )


def _cell(values: Array) -> str:
    known = values[np.isfinite(values)]
    return f"{known.mean():.4g}" if len(known) else MISSING


class Innovations:
    """The innovations of a chunk of epochs, put together sensor by sensor.

    Args:
        readings: What arrives in the chunk.
        runs: Number of runs.
        epochs: Number K of epochs.
    """

    def __init__(self, readings: Readings, runs: int, epochs: int) -> None:
        self._shape = epochs, runs  # what belongs to an epoch lies together
        self._readings = readings
        self._nis = [np.full(self._shape, np.nan) for _ in readings.sensors]
        self._extras: list[dict[str, Array]] = [{} for _ in readings.sensors]
        self._edits: list[dict[str, Integers]] = [{} for _ in readings.sensors]
        self._log_likelihood = np.zeros(self._shape)

    def add(self, place: int, k: int, innovation: Innovation) -> None:
        """Take down the innovation of the sensor in that place at column k."""
        self._nis[place][k] = innovation.nis
        if place == 0:
            self._log_likelihood[k] = innovation.log_likelihood
        else:
            self._log_likelihood[k] += innovation.log_likelihood
        for name, value in innovation.extras.items():
            self._extra(place, name)[k] = value
        if innovation.edits:
            edits = self._edits[place]
            for name, count in innovation.edits.items():
                if name not in edits:
                    edits[name] = np.zeros(self._shape, dtype=np.int64)
                edits[name][k] = count

    def add_extras(self, k: int, extras: Mapping[str, Array]) -> None:
        """Take down further numbers (count, runs) of the only sensor at as many columns from k on."""
        for name, values in extras.items():
            self._extra(0, name)[k : k + len(values)] = values

    def _extra(self, place: int, name: str) -> Array:
        extras = self._extras[place]
        if name not in extras:
            check_name(name)
            extras[name] = np.full(self._shape, np.nan)
        return extras[name]

    def room(self, k: int) -> tuple[Array, Array]:
        """Return where NIS and log-likelihood of the only sensor go from column k on, (K - k, runs)."""
        return self._nis[0][k:], self._log_likelihood[k:]

    def history(self, mean: Array, covariance: Array) -> FilterHistory:
        """Return the history of the chunk, without failures."""
        sensors = self._readings.sensors
        log_likelihood, lacking = _runs_first(self._log_likelihood), self._readings.lacking()
        all_nis = [_runs_first(nis) for nis in self._nis]
        all_extras = [{name: _runs_first(extra) for name, extra in extras.items()} for extras in self._extras]
        dof = [one.dof for one in sensors]
        by_name = {one.sensor.name: place for place, one in enumerate(sensors) if one.sensor.name}
        return FilterHistory(
            mean,
            covariance,
            all_nis[0] if len(sensors) == 1 else _sum_where_read(all_nis, sensors),
            log_likelihood if lacking is None else log_likelihood + lacking,
            all_extras[0] if len(sensors) == 1 else _merged(all_extras, sensors),
            dof=sum(dof[1:], dof[0]),
            nis_by={name: all_nis[place] for name, place in by_name.items()},
            dof_by={name: dof[place] for name, place in by_name.items()},
            extras_by={name: all_extras[place] for name, place in by_name.items()},
            edits_by={
                one.sensor.name: {name: np.ascontiguousarray(count.T) for name, count in edits.items()}
                for one, edits in zip(sensors, self._edits, strict=True)
                if edits
            },
        )


def _runs_first(series: Array) -> Array:
    """Return a series (K, runs) as (runs, K), in C order."""
    return np.ascontiguousarray(series.T)


def _sum_where_read(series: list[Array], sensors: tuple[SensorReadings, ...]) -> Array:
    """Return the sum over the sensors that are read, NaN where none is."""
    total = np.zeros(series[0].shape)
    for values, one in zip(series, sensors, strict=True):
        total += np.where(one.read, values, 0.0)
    return np.where(np.any([one.read for one in sensors], axis=0), total, np.nan)


def _merged(extras: list[dict[str, Array]], sensors: tuple[SensorReadings, ...]) -> dict[str, Array]:
    """Return one series a name: of the last sensor read, or the sum where it is a count."""
    merged: dict[str, Array] = {}
    for name in dict.fromkeys(name for own in extras for name in own):
        having = [(own[name], one) for own, one in zip(extras, sensors, strict=True) if name in own]
        if name in _COUNTED:
            merged[name] = _sum_where_read([values for values, _ in having], tuple(one for _, one in having))
            continue
        last = having[0][0]
        for values, one in having[1:]:
            last = np.where(one.read, values, last)
        merged[name] = last
    return merged
