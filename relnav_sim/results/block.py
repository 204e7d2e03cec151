"""What a worker hands over for one block of runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.printable import printable
from relnav_sim.results import layout
from relnav_sim.results.by_channel import ByChannel

AnyArray = NDArray[Any]
"""Of the type that the layout names."""


class ResultsError(Exception):
    """A results file or shard that can't be used; the message says why and what to do."""


class UnavailableError(OSError):
    """A file that can't be read now, which says nothing of what it holds: in use, or not permitted."""


class RefusedError(ResultsError):
    """Files that are sound but don't fit what is asked of them; the message says how to mend the request."""


@dataclass(frozen=True, order=True)
class Failure:
    """A run that failed.

    Attributes:
        run: Number of the run.
        filter: Name of the filter, or empty where the whole run failed.
        epoch: First failed epoch, or -1 where it is not known.
        reason: Why, in words: one printable line, which any other text is turned into. It may come from anybody's
            exception, and what can't be stored would keep a whole campaign from its results.
    """

    run: int
    filter: str
    epoch: int
    reason: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "reason", printable(self.reason))


@dataclass(frozen=True)
class AugmentedStates:
    """What a filter found out about e states that it carries behind position and velocity.

    Attributes:
        names: Their names, ``azimuth_bias`` say.
        units: Their SI units.
        estimate: Estimates at the stored epochs, (runs, times, e).
        error: Estimate minus truth, (runs, times, e); NaN where the truth is not known.
        sigma: Standard deviations that the filter states, (runs, times, e).
        mean: Mean error over the whole run and settled, (runs, 2, e).
        rms: Root mean square of the error over the whole run and settled, (runs, 2, e).
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    estimate: AnyArray
    error: AnyArray
    sigma: AnyArray
    mean: AnyArray
    rms: AnyArray

    @staticmethod
    def of_arrays(columns: layout.Columns, arrays: Mapping[str, AnyArray]) -> AugmentedStates | None:
        """Return the augmented states of arrays by their names in the layout; None without any."""
        if not columns.augmented:
            return None
        parts = {spec.name.removeprefix("extra_"): arrays[spec.name] for spec in layout.AUGMENTED}
        return AugmentedStates(columns.augmented, columns.augmented_units, **parts)


@dataclass(frozen=True)
class BySensor:
    """What came of the measurements of each of s sensors; sums are over the whole run and the steady state.

    Attributes:
        names: The sensors, in the order in which the filter takes their measurements.
        nis_sum: Sum of the NIS over the sensor's updates, (runs, 2, s).
        dof_sum: Sum of its degrees of freedom, the channels that were present, (runs, 2, s).
        updates: Epochs with a measurement, (runs, 2, s).
        nis_lag1: Autocorrelation of the NIS between successive updates, (runs, 2, s).
        nis: NIS at the stored epochs, (runs, times, s); NaN without a measurement.
        dof: Its degrees of freedom, (runs, times, s); 0 without a measurement.
        readings: Epochs with a measurement since the stored epoch before, (runs, times, s).
    """

    names: tuple[str, ...]
    nis_sum: AnyArray
    dof_sum: AnyArray
    updates: AnyArray
    nis_lag1: AnyArray
    nis: AnyArray
    dof: AnyArray
    readings: AnyArray

    def of(self, spec: layout.Dataset, sensor: str, runs: int) -> AnyArray:
        """Return one of these for one sensor, (runs, ...); NaN where the filter has no such sensor."""
        if sensor not in self.names:
            return np.full((runs, len(layout.SPANS)), np.nan)
        return np.asarray(getattr(self, spec.name.removeprefix("sensor_"))[..., self.names.index(sensor)])

    @staticmethod
    def of_arrays(columns: layout.Columns, arrays: Mapping[str, AnyArray]) -> BySensor | None:
        """Return what arrays by their names in the layout say; None where they do not tell sensors apart."""
        if not columns.sensors:
            return None
        return BySensor(
            columns.sensors, **{spec.name.removeprefix("sensor_"): arrays[spec.name] for spec in layout.BY_SENSOR}
        )


EDIT_ENDS = ("none", "rejecting", "adopted", "not_seen", "failed")
"""What the numbers of `Editing.end` mean."""


@dataclass(frozen=True)
class Editing:
    """What came of the editing of measurements, of s sensors; docs/editing.md defines the terms.

    Attributes:
        names: The sensors.
        tests: Tests made, over the whole run and settled, (runs, 2, s).
        rejected: Measurements or channels rejected, (runs, 2, s).
        lock_outs: Lock-outs, (runs, s).
        actions: Measurements at which the filter acted, (runs, s).
        recoveries: Recoveries, (runs,).
        recovery: Longest time to recover, (runs,), s; NaN: none.
        lost: Times that it diverged for 10 N epochs, (runs,).
        open: How long the run ends unrecovered, (runs,), s; NaN: it does not.
        earliest: Shortest time to recover that such a run leaves possible, (runs,), s; NaN likewise.
        end: How the run ends, (runs,): place in `EDIT_ENDS`.
    """

    names: tuple[str, ...]
    tests: AnyArray
    rejected: AnyArray
    lock_outs: AnyArray
    actions: AnyArray
    recoveries: AnyArray
    recovery: AnyArray
    lost: AnyArray
    open: AnyArray
    earliest: AnyArray
    end: AnyArray

    @staticmethod
    def of_arrays(columns: layout.Columns, arrays: Mapping[str, AnyArray]) -> Editing | None:
        """Return what arrays by their names in the layout say; None where no measurement is edited."""
        if not columns.edited:
            return None
        return Editing(
            columns.edited, **{spec.name.removeprefix("edit_"): arrays[spec.name] for spec in layout.EDITING}
        )


@dataclass(frozen=True)
class FilterResult:
    """The results of one filter over a block of runs; every array has the runs as its leading axis.

    Attributes:
        summary: One array per dataset of `layout.SUMMARY`, by its name.
        error: Estimate minus truth at the stored epochs, RTN, (runs, times, 6), m and m/s.
        sigma: Standard deviations that the filter states, (runs, times, 6).
        nis: Normalised innovation squared, (runs, times); NaN without a measurement.
        nees: Normalised estimation error squared, (runs, times).
        diagnostics: What the filter reports of its own working, by name, mean over updates (runs,).
        augmented: Its augmented states; None where it has none.
        by_sensor: What came of each sensor's measurements; None where the filter's history does not tell them apart.
        editing: What came of the editing of its measurements; None where there is none.
        covariance_root: Cholesky factors of the covariances of position and velocity, lower triangles row by row,
            (runs, times, 21); None where they are not stored.
        by_channel: What its residuals say by channel; None where they were not looked at.
    """

    summary: Mapping[str, AnyArray]
    error: AnyArray
    sigma: AnyArray
    nis: AnyArray
    nees: AnyArray
    diagnostics: Mapping[str, AnyArray] = field(default_factory=dict)
    augmented: AugmentedStates | None = None
    by_sensor: BySensor | None = None
    editing: Editing | None = None
    covariance_root: AnyArray | None = None
    by_channel: ByChannel | None = None

    @property
    def columns(self) -> layout.Columns:
        """What it holds beyond what all filters do."""
        names, units = ((), ()) if self.augmented is None else (self.augmented.names, self.augmented.units)
        sensors = () if self.by_sensor is None else self.by_sensor.names
        edited = () if self.editing is None else self.editing.names
        factor = () if self.covariance_root is None else layout.FACTOR
        channels = () if self.by_channel is None else self.by_channel.names
        return layout.Columns(
            tuple(sorted(self.diagnostics)), names, units, sensors, edited=edited, factor=factor, channels=channels
        )

    def arrays(self, columns: layout.Columns = layout.NO_COLUMNS) -> dict[str, AnyArray]:
        """Return every array by its name in the layout, in the layout's order and type.

        Args:
            columns: What is wanted beyond what all filters hold; NaN, or 0 for counts, where this one does not.

        Raises:
            ValueError: A dataset is missing, unknown or of the wrong shape.
        """
        given = dict(self.summary) | {spec.name: getattr(self, spec.name) for spec in layout.SERIES}
        if unfit := {spec.name for spec in layout.FILTER} ^ set(given):
            raise ValueError(f"the summary does not fit the layout: {', '.join(sorted(unfit))}")
        lengths = layout.sizes(*np.shape(self.nis)) | columns.lengths
        if columns.factor:
            spec, root = layout.COVARIANCE, self.covariance_root
            given[spec.name] = np.full(layout.shape(spec, lengths), np.nan) if root is None else root
        if columns.diagnostics:
            absent = np.full(lengths["run"], np.nan)
            found = [np.asarray(self.diagnostics.get(name, absent), dtype=float) for name in columns.diagnostics]
            given[layout.DIAGNOSTICS.name] = np.stack(found, axis=1)
        for specs, held, prefix in (
            (layout.AUGMENTED if columns.augmented else (), self.augmented, "extra_"),
            (layout.BY_SENSOR if columns.sensors else (), self.by_sensor, "sensor_"),
            (layout.EDITING if columns.edited else (), self.editing, "edit_"),
            (layout.BY_CHANNEL if columns.channels else (), self.by_channel, "channel_"),
        ):
            for spec in specs:
                if held is None:
                    nothing = np.nan if spec.dtype.startswith("<f") else 0
                    given[spec.name] = np.full(layout.shape(spec, lengths), nothing)
                else:
                    given[spec.name] = getattr(held, spec.name.removeprefix(prefix))
        arrays = {}
        with np.errstate(over="ignore"):
            for spec in columns.datasets:
                array, expected = np.asarray(given[spec.name]), layout.shape(spec, lengths)
                if array.shape != expected:
                    raise ValueError(f"{spec.name} has shape {array.shape}; its dimensions {spec.dims} have {expected}")
                arrays[spec.name] = np.ascontiguousarray(array, dtype=spec.dtype)
        return arrays

    @staticmethod
    def of_arrays(arrays: Mapping[str, AnyArray], columns: layout.Columns = layout.NO_COLUMNS) -> FilterResult:
        """Return the result made of arrays by their names in the layout.

        Args:
            arrays: The arrays.
            columns: What they hold beyond what all filters do.
        """
        series = {spec.name: arrays[spec.name] for spec in layout.SERIES}
        diagnostics = {name: arrays[layout.DIAGNOSTICS.name][:, i] for i, name in enumerate(columns.diagnostics)}
        summary = {spec.name: arrays[spec.name] for spec in layout.SUMMARY}
        augmented, by_sensor = AugmentedStates.of_arrays(columns, arrays), BySensor.of_arrays(columns, arrays)
        root = arrays[layout.COVARIANCE.name] if columns.factor else None
        return FilterResult(
            summary,
            **series,
            diagnostics=diagnostics,
            augmented=augmented,
            by_sensor=by_sensor,
            editing=Editing.of_arrays(columns, arrays),
            covariance_root=root,
            by_channel=ByChannel.of_arrays(columns, arrays),
        )

    @staticmethod
    def all_failed(runs: int, times: int, epoch: int = -1) -> FilterResult:
        """Return the result of runs that ended before there was anything to count, at an epoch or -1: not known."""
        lengths = layout.sizes(runs, times)
        empty: dict[str, AnyArray] = {}
        for spec in layout.FILTER:
            fill = np.nan if spec.dtype.startswith("<f") else 0
            empty[spec.name] = np.full(layout.shape(spec, lengths), fill, dtype=spec.dtype)
        empty["failed"][:] = 1
        empty["failed_epoch"][:] = epoch
        return FilterResult.of_arrays(empty)


@dataclass(frozen=True)
class BlockResult:
    """Everything that one block of runs of one case leaves behind.

    Attributes:
        case_index: Number of the case in the campaign, from 0.
        case_id: Hash of the case's content without its filters.
        runs: Numbers of the runs, ascending.
        time_s: Stored epochs, (times,), s.
        relative: True relative state, RTN, (runs or 1, times, 6), m and m/s.
        filters: One result per filter, by its name.
        failures: Runs and filters that failed.
        shared_truth: Whether all runs of the *case* fly the same truth (nothing is dispersed). It can't be seen
            from ``relative``: a block of one run has one trajectory either way.
        retry: Whether its runs were not computed, for want of memory, so that another attempt may succeed. They count
            as missing, not as failed; the failures say why.
    """

    case_index: int
    case_id: str
    runs: tuple[int, ...]
    time_s: AnyArray
    relative: AnyArray
    filters: Mapping[str, FilterResult]
    failures: tuple[Failure, ...]
    shared_truth: bool
    retry: bool = False
