"""The numbers of a results file: statistics, series and bounds, nothing to know about HDF5."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from relnav_sim.arrays import Array, Integers
from relnav_sim.measurements.channel import Channel
from relnav_sim.notebook import MOST_ROWS, table_html
from relnav_sim.results import layout
from relnav_sim.results.block import AugmentedStates, BySensor, Editing, ResultsError
from relnav_sim.results.by_channel import ByChannel
from relnav_sim.results.covariance_root import covariances
from relnav_sim.results.held import HeldResult
from relnav_sim.results.observability import Observability
from relnav_sim.results.series import Series as Series
from relnav_sim.results.settings import filter_settings
from relnav_sim.results.summary_columns import summary_columns
from relnav_sim.wording import counted, significant

if TYPE_CHECKING:
    import pandas
    import xarray

_SUMMARY = {spec.name: spec for spec in layout.SUMMARY}
_SERIES = {spec.name: spec for spec in layout.SERIES}
_BY_SENSOR = {spec.name: spec for spec in layout.BY_SENSOR}


class Results(HeldResult):
    """The numbers of an open results file; close it, or use it in a ``with`` statement.

    Wherever a case is asked for, its number, its label or its id will do. Arrays hold one row per run, in the
    order of `case_runs`. What the file says of its campaign, and what it holds, is told by `HeldResult`.

    Examples:
        >>> from relnav_sim import open_results
        >>> with open_results("results/demo.h5") as results:
        ...     summary = results.summary()
        ...     one = results.series(case=0, filter="ekf", run=0)
        >>> summary["settled_r_rms_m"].shape == summary["run"].shape, one.error.shape[1]
        (True, 6)
    """

    def __repr__(self) -> str:
        held = f"{counted(len(self.cases), 'case')}, {counted(len(self.filters), 'filter')}"
        return f"<Results of {self.campaign_name}: {held}, {counted(self.planned_runs, 'run')} planned, in {self.path}>"

    def _repr_html_(self) -> str:
        places = [(index, name) for index, case in enumerate(self.headers) for name in case.filters]
        rows = [self._in_short(*place) for place in places[:MOST_ROWS]] + [[]] * (len(places) - MOST_ROWS)
        headings = ["case", "", "filter", "runs", "failed", "steady-state position RMS, m"]
        return table_html(repr(self).strip("<>"), headings, rows)

    def _in_short(self, index: int, filter: str) -> list[str]:
        """Return a row of the table of a notebook: runs held, runs failed, mean position RMS of the others."""
        words = [str(index), self.cases[index], filter]
        if not self._file or not (runs := len(self.case_runs(index, filter))):
            return [*words, "file closed" if not self._file else "0", "", ""]
        failed = self.statistic(index, filter, "failed").astype(bool)
        sizes = self.statistic(index, filter, "rms")[~failed, 1, 6]
        return [*words, str(runs), str(int(failed.sum())), significant(float(np.mean(sizes)) if sizes.size else np.nan)]

    def summary(self) -> dict[str, NDArray[Any]]:
        """Return the per-run statistics as flat columns.

        Rows are case x filter x run in order. Columns: ``case`` (number), ``case_label``, ``filter``, ``run``,
        ``failed``, ``failed_epoch``, then those of docs/results-file.md, for example ``r_rms_m``,
        ``settled_x_mean_m``, ``convergence_s``, ``anees``, ``coverage_95``, ``cpu_us_per_step``. Where cases are
        stressed, ``stress`` names what each was flown under, empty for none.
        """
        return summary_columns(self)

    def summary_frame(self) -> pandas.DataFrame:
        """Return `summary` as a pandas DataFrame, a row for each case, filter and run.

        Raises:
            ResultsError: pandas is not installed.

        Examples:
            The mean position RMS of each filter in each case, failed runs left out::

                frame = results.summary_frame()
                frame[~frame.failed].groupby(["case_label", "filter"]).settled_r_rms_m.mean()
        """
        if importlib.util.find_spec("pandas") is None:
            raise ResultsError("pandas is not installed; pip install pandas brings it")
        import pandas

        return pandas.DataFrame(self.summary())

    def statistic(self, case: int | str, filter: str, name: str) -> NDArray[Any]:
        """Return one dataset of `layout.SUMMARY` as stored, for example ``rms`` (runs, 2 spans, 8 quantities)."""
        if name not in _SUMMARY:
            raise ResultsError(f"no statistic {name!r}; there are {', '.join(_SUMMARY)}")
        return self._filter_data(self._check(case, filter), filter, _SUMMARY[name])

    def diagnostics(self, case: int | str, filter: str) -> dict[str, Array]:
        """Return what a filter reports of its own working, by name: mean over updates of each run (runs,).

        For example ``rejected`` (share of measurements that were rejected), ``ess`` or ``alpha``; empty where the
        filter reports nothing. NaN: never reported in that run.
        """
        index = self._check(case, filter)
        names = self._filter_part(index, filter).columns().diagnostics
        if not names:
            return {}
        stored = self._filter_data(index, filter, layout.DIAGNOSTICS)
        return {name: stored[:, i] for i, name in enumerate(names)}

    def augmented(self, case: int | str, filter: str) -> AugmentedStates | None:
        """Return what a filter found out about its augmented states; None where it carries none."""
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.AUGMENTED if columns.augmented else ()
        parts = {spec.name: self._filter_data(index, filter, spec).astype(np.float64) for spec in specs}
        return AugmentedStates.of_arrays(columns, parts)

    def channels(self, case: int | str) -> Mapping[str, tuple[Channel, ...]]:
        """Return what a measurement of each sensor of a case consists of, by the sensor's name.

        Empty in files of relnav 0.1, which had one relative sensor, a radar.
        """
        return self.headers[self.case_index(case)].channels

    def by_sensor(self, case: int | str, filter: str) -> BySensor | None:
        """Return what came of the measurements of each of a filter's sensors; None where the file does not say.

        Files of relnav 0.1 do not.
        """
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.BY_SENSOR if columns.sensors else ()
        return BySensor.of_arrays(columns, {spec.name: self._filter_data(index, filter, spec) for spec in specs})

    def editing(self, case: int | str, filter: str) -> Editing | None:
        """Return what came of the editing of a filter's measurements; None where there is none."""
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.EDITING if columns.edited else ()
        return Editing.of_arrays(columns, {spec.name: self._filter_data(index, filter, spec) for spec in specs})

    def by_channel(self, case: int | str, filter: str) -> ByChannel | None:
        """Return what a filter's residuals say by channel; None where the campaign has no ``statistics.whiteness``."""
        index = self._check(case, filter)
        columns = self._filter_part(index, filter).columns()
        specs = layout.BY_CHANNEL if columns.channels else ()
        return ByChannel.of_arrays(columns, {spec.name: self._filter_data(index, filter, spec) for spec in specs})

    def nis_sum(self, case: int | str, filter: str) -> Array:
        """Return the sum of the NIS over the updates of the whole run and settled, (runs, 2)."""
        dof, nis = (self._of_sensors(case, filter, name) for name in ("sensor_dof_sum", "sensor_nis_sum"))
        updates = self.statistic(case, filter, "updates")
        former = np.where(updates > 0, self.statistic(case, filter, "nis_mean") * updates, 0.0)
        if dof is None or nis is None:
            return former
        return np.where(dof.sum(axis=-1) > 0, np.nansum(nis, axis=-1), former)

    def dof_sum(self, case: int | str, filter: str) -> Integers:
        """Return the degrees of freedom of `nis_sum`, the channels that were present, (runs, 2)."""
        by_sensor = self._of_sensors(case, filter, "sensor_dof_sum")
        updates = self.statistic(case, filter, "updates")
        told = np.zeros_like(updates) if by_sensor is None else by_sensor.sum(axis=-1)
        return np.where(told > 0, told, layout.FORMER_DOF * updates)

    def dof(self, case: int | str, filter: str) -> Integers:
        """Return the degrees of freedom of `nis`, the channels present, (runs, K); 0 without a measurement."""
        by_sensor, measured = self._of_sensors(case, filter, "sensor_dof"), np.isfinite(self.nis(case, filter))
        told = np.zeros(measured.shape, dtype=np.int64)
        if by_sensor is not None:
            told = by_sensor.sum(axis=-1, dtype=np.int64)
        return np.where(measured & (told == 0), layout.FORMER_DOF, told)

    def _of_sensors(self, case: int | str, filter: str, name: str) -> NDArray[Any] | None:
        """Return one dataset by sensor; None where the file does not tell them apart."""
        index = self._check(case, filter)
        if not self._filter_part(index, filter).columns().sensors:
            return None
        return self._filter_data(index, filter, _BY_SENSOR[name])

    def time_s(self, case: int | str) -> Array:
        """Return the stored epochs of a case, (K,), s."""
        return self._shared(self.case_index(case), layout.DIMENSIONS["time"])

    def truth(self, case: int | str) -> Array:
        """Return the true relative states of a case, RTN, (runs or 1, K, 6); 1 where all runs share them."""
        return self._shared(self.case_index(case), layout.TRUTH)

    def truth_runs(self, case: int | str) -> Integers:
        """Return which run flew each of the `truth` states, ascending; a single -1 where all runs share them."""
        return self._shared(self.case_index(case), layout.DIMENSIONS["trajectory"])

    def distance(self, case: int | str, filter: str) -> Array:
        """Return the true distance between the spacecraft in each run of a filter, (runs, K), m."""
        index = self._check(case, filter)
        distance = np.linalg.norm(self.truth(index)[..., :3], axis=-1)
        runs, owners = self.case_runs(index, filter), self.truth_runs(index)
        if owners.tolist() == [-1]:
            return np.broadcast_to(distance, (len(runs), distance.shape[1]))
        return np.asarray(distance[np.searchsorted(owners, runs)])

    def error(self, case: int | str, filter: str) -> Array:
        """Return the errors, estimate minus truth, RTN, (runs, K, 6), m and m/s; NaN once a run failed."""
        return self._series(case, filter, "error")

    def sigma(self, case: int | str, filter: str) -> Array:
        """Return the standard deviations that the filter states, (runs, K, 6), m and m/s."""
        return self._series(case, filter, "sigma")

    def covariance(
        self, case: int | str, filter: str, rows: slice = slice(None), epochs: slice = slice(None)
    ) -> Array | None:
        """Return the formal covariances of position and velocity, RTN, (runs, K, 6, 6), m and m/s.

        They are the filter's own, augmented states left out; of filters with particles or several components those of
        the whole estimate. NaN once a run failed.

        Args:
            case: The case.
            filter: The filter.
            rows: Which of the runs, by their place; all together may be large.
            epochs: Which of the stored epochs, by their place.

        Returns:
            None where the file holds none: its campaign did not ask for them (``clock.store_covariance``).

        Examples:
            The correlation of radial position with along-track velocity at the last stored epoch, one number per run::

                P = results.covariance(0, "ekf")[:, -1]
                P[:, 0, 4] / np.sqrt(P[:, 0, 0] * P[:, 4, 4])
        """
        return self._covariances(self._check(case, filter), filter, (rows, epochs))

    def _covariances(self, index: int, filter: str, rows: Any = ...) -> Array | None:
        if not self._filter_part(index, filter).columns().factor:
            return None
        return covariances(self._filter_data(index, filter, layout.COVARIANCE, rows).astype(np.float64))

    def nis(self, case: int | str, filter: str) -> Array:
        """Return the NIS (runs, K); NaN without a measurement."""
        return self._series(case, filter, "nis")

    def nees(self, case: int | str, filter: str) -> Array:
        """Return the normalised estimation errors squared, (runs, K)."""
        return self._series(case, filter, "nees")

    def series(self, case: int | str, filter: str, run: int) -> Series:
        """Return one run of one filter at the stored epochs.

        Raises:
            ResultsError: The file holds no such case, filter or run.
        """
        index = self._check(case, filter)
        rows = np.flatnonzero(self.case_runs(index, filter) == run)
        if len(rows) == 0:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r}, filter {filter!r} has no run {run}")
        row = int(rows[0])
        parts = {name: self._filter_data(index, filter, spec, row).astype(np.float64) for name, spec in _SERIES.items()}
        owners = self.truth_runs(index)
        own = np.flatnonzero((owners == run) | (owners == -1))
        if len(own) == 0:
            raise ResultsError(f"{self.path}: case {self.cases[index]!r} has no truth of run {run}")
        truth = self._shared(index, layout.TRUTH, int(own[0]))
        return Series(
            self.cases[index], filter, run, self.time_s(index), **parts, truth=truth,
            nis_by=self._by_sensor_in(index, filter, row, "sensor_nis"),
            dof_by=self._by_sensor_in(index, filter, row, "sensor_dof"),
            covariance=self._covariances(index, filter, row),
        )  # fmt: skip

    def _by_sensor_in(self, index: int, filter: str, row: int, name: str) -> dict[str, Array]:
        """Return one series by sensor of one run; empty where the file does not tell them apart."""
        sensors = self._filter_part(index, filter).columns().sensors
        if not sensors:
            return {}
        values = self._filter_data(index, filter, _BY_SENSOR[name], row)
        return {sensor: values[:, place].astype(np.float64) for place, sensor in enumerate(sensors)}

    def bound(self, case: int | str, filter: str | None = None) -> Array | None:
        """Return the posterior Cramér-Rao bound on the rms error over runs at the stored epochs, (K, 8).

        Columns are x, y, z, vx, vy, vz and the norms r and v, m and m/s. It counts the white noise of the measurement
        chain only. NaN where no run could start; docs/bound.md says how to read it.

        Args:
            case: The case.
            filter: The filter whose own model, process noise and sensors count; None: a perfect model, without process
                noise, that goes by all sensors of the case.

        Returns:
            None where the file holds no bound.
        """
        part = self._stored.case(self.case_index(case)) if filter is None else self._held(case, filter)
        return None if part is None else part.limit(layout.BOUND)

    def perfect_bound(self, case: int | str, filter: str) -> Array | None:
        """Return the bound of a perfect model that goes by the same sensors as a filter, as `bound` does, (K, 8)."""
        part = self._held(case, filter)
        own = None if part is None else part.limit(layout.PERFECT_BOUND)
        return self.bound(case) if own is None else own

    def observability(self, case: int | str, filter: str) -> Observability | None:
        """Return what the measurements of a filter's sensors can tell of the state, None where it is not known."""
        part = self._held(case, filter)
        return None if part is None else part.observability()

    def named_sensors(self, case: int | str, filter: str) -> tuple[str, ...]:
        """Return the names of the sensors that a filter goes by, as the campaign says; empty: all of the case."""
        index = self._check(case, filter)
        named = self.headers[index].variables.get(f"filters.{filter}.sensors")
        named = named or filter_settings(self, index, filter).get("sensors")
        return tuple(map(str, named)) if isinstance(named, list | tuple) else ()

    def to_xarray(self) -> xarray.DataTree:
        """Return the file as a tree of lazily read xarray datasets, ``tree["case_000/ekf"].ds["rms"]``.

        Raises:
            ResultsError: xarray is not installed.
        """
        if importlib.util.find_spec("xarray") is None:
            raise ResultsError("xarray is not installed; pip install 'relnav-sim[xarray]' brings it")
        from relnav_sim.results.labelled import labelled_tree

        return labelled_tree(self.path, self._file)

    def _series(self, case: int | str, filter: str, name: str) -> Array:
        return self._filter_data(self._check(case, filter), filter, _SERIES[name]).astype(np.float64)


def open_results(path: str | Path) -> Results:
    """Open a results file for reading; use it in a ``with`` statement.

    Args:
        path: The file that `run_campaign` or ``relnav run`` wrote.

    Raises:
        ResultsError: The file is missing, damaged, or no relnav result.

    Examples:
        >>> from relnav_sim import open_results
        >>> with open_results("results/demo.h5") as results:
        ...     results.filters, results.cases
        (('kf', 'ekf', 'ukf', 'imm'), ('sensors.radar.noise.kind=gaussian', 'sensors.radar.noise.kind=mixture'))
    """
    return Results(Path(path))
